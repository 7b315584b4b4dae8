"""From sensor positions and readings to rotations: wires and the base joint."""
