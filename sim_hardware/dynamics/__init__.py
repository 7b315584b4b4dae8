"""Rocking dynamics: the nonlinear two-sided Housner block, with further effects as terms of one kernel."""

from sim_hardware.dynamics.body import Body
from sim_hardware.dynamics.motion import Motion, Release, Restitution, simulate_motion

__all__ = ["Body", "Motion", "Release", "Restitution", "simulate_motion"]
