"""What the base below a wall does: steps at impacts, slips between them."""
