"""The screen of a test's course: pull, hold, release and rocking, to be read from beside the wall."""
