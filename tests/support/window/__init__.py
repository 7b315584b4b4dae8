"""What looks at the window in tests: a real display, clipped texts, a link that is quiet."""
