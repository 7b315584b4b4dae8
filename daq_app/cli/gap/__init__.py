"""`daq-app gap`."""
