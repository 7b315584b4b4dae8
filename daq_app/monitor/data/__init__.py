"""What the window knows: state of the acquisition, recorded runs, background work. Draws nothing."""
