"""Tolerances of the rocking model: quantity, unit, source, and what raising each does."""
