"""From what the wall does to what the NI channels read."""
