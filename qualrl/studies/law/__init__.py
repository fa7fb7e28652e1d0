"""The law behind Figures 7 to 9: what episodes x alpha is."""
