"""A recorded test from signals to results, with bias and quality."""
