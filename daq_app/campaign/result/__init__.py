"""The result page of one test, beside its level."""
