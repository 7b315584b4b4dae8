"""The operator's window: data ← widgets ← plots ← pages ← window."""
