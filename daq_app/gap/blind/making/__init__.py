"""Draw, write, label and seal the cases of a check."""
