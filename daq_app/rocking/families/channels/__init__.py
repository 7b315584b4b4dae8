"""What the readings of single channels say of their electronics."""
