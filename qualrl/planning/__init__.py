"""Plans: which places to pass, by which doors, why, and the metric path."""
