"""The append-only journal: frames, writing, scanning, reading, locks."""
