"""What drives a recorder in tests: benches, faults, kills, orders in random sequence."""
