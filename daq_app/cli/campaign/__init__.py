"""`daq-app campaign`."""
