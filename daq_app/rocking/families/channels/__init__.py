"""What single channels say: their readings by themselves, and each against the others of its family."""
