"""The course of a test: what must hold before it, zero, release, rocking, rest, live figures, channels."""
