"""Devices that the simulated driver finds, from a rig file or an export of NI MAX."""
