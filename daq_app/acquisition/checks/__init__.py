"""Checks before a test: do the sensors answer, and as they should."""
