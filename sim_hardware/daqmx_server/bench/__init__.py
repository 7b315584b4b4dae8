"""What all tasks share: devices, wiring, clock, faults, reservations, under one lock."""
