"""Occupancy grids and what is seen on them: regions, doorways, landmarks and their names."""
