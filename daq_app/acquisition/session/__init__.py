"""One recording session: threads joined together, watched, kept awake."""
