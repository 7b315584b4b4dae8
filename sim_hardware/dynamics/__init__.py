"""Rocking dynamics: the nonlinear two-sided Housner block, with further effects as terms of one kernel."""

from sim_hardware.dynamics.batch import Workspace, simulate_batch
from sim_hardware.dynamics.body import Body
from sim_hardware.dynamics.motion import Motion, Release, Restitution, motion_vector, simulate_motion

__all__ = [
    "Body",
    "Motion",
    "Release",
    "Restitution",
    "Workspace",
    "motion_vector",
    "simulate_batch",
    "simulate_motion",
]
