"""Calls that hand out samples: analogue, digital and counted."""
