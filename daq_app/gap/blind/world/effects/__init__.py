"""What a case can hide, as data: effects with their ranges, for either engine."""
