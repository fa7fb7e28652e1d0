"""Exact values and shortest paths: what every learner is measured against."""
