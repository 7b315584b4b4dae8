"""Everything that stands in for the rig: the wall, its sensors, the NI device server."""
