"""Rotation in time: velocity, phases, swings, release, a fit of the whole motion."""
