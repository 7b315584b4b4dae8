"""`daq-app analyse`."""
