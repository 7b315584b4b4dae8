"""Motion of one run: rotation of the joint and of the wall, swings, release, grid for regressions."""
