"""How far a stated r can be trusted: faults and what is said of them, and intervals against the truth."""
