"""Slips of the base: at impacts, and between them where friction does not hold it."""
