"""Dietterich's taxi, where MAXQ comes from."""
