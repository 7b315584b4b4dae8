"""What an analysed run comes to, kept beside it and taken only where a fresh one would agree."""
