"""Files: the only place that opens them, and where every byte from a stranger is checked."""
