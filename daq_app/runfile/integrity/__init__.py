"""A run is kept: journal to run file, verification, recovery."""
