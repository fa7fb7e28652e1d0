"""Compiled loops: arrays in, arrays out; no names, units, graphs, files or prints."""
