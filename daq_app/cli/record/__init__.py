"""`daq-app run`, `simulate`, `view` and keys."""
