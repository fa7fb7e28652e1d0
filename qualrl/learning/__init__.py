"""Learners, the table that tells them apart, and the one trainer that runs them."""
