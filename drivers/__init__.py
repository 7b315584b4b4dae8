"""The seam to the hardware: one protocol, and the drivers that keep it."""
