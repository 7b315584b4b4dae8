"""Files that tests damage or fill with hostile words."""
