"""Plots of live, replayed and analysed signals."""
