"""The qualitative level: named places, and the actions that lead from one to the next."""
