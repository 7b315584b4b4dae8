"""Oscillations: ring-downs of the wall after impacts and vibration of the floor, seen and predicted."""
