"""Each wire against the others: gain, lag, drift, and whether it sticks."""
