"""Navigation from room to room (Figure 13)."""
