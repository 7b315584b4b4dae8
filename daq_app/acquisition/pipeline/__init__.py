"""The way of a sample: read, put into the journal, its clock watched. Knows no course of a test."""
