"""The wall by its own equations of motion, from event to event."""
