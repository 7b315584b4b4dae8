"""From a record to signals that can be analysed: instruments put right, families fused, gains known."""
