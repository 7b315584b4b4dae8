"""Tasks: settings, states, reading and logging."""
