"""Decision processes: tabular MDP, grid world, and the hybrid MDP that couples a grid to named places."""
