"""Prediction of all features of a run by the simulator's half-cycles: the model of the core."""
