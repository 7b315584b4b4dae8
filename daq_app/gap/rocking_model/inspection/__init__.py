"""Inspection of all runs before anything is fitted: wiring, electronics, single channels, the floor."""
