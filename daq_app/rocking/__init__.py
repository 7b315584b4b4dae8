"""Rocking analysis: classic theory, kinematics, impacts and restitution, online and offline.

from daq_app.rocking import RigidBlock, period
block = RigidBlock(weight_n=51300, r0_m=1.525, inertia_kg_m2=16107, alpha0_rad=0.215)
block.p_rad_s, block.r_max, period(0.35, block.p_rad_s)

Each name is loaded when it is first used: the operator's window needs the theory, not the analysis and SciPy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from daq_app.config.first_use import at_first_use

if TYPE_CHECKING:
    from daq_app.rocking.analysis.analyse import analyse_record
    from daq_app.rocking.analysis.options import AnalysisOptions
    from daq_app.rocking.analysis.results import TestAnalysis
    from daq_app.rocking.estimators import RestitutionEstimate, RestitutionPoint
    from daq_app.rocking.geometry.kinematics import RotationGeometry, WireRotation
    from daq_app.rocking.live import Estimate, LiveAnalyser, LiveResult
    from daq_app.rocking.motion.phases import Phase, PhaseDetector, PhaseEvent, PhaseSettings
    from daq_app.rocking.motion.velocity import VelocityFilter, VelocityStream
    from daq_app.rocking.record import TestRecord
    from daq_app.rocking.theory.block import RigidBlock, SemiRigid
    from daq_app.rocking.theory.classic import (
        amplitude_after,
        energy,
        energy_after,
        frequency_parameter,
        impacts_until,
        period,
        period_after,
        r_max_block,
        r_max_rectangular,
        restitution_from_peaks,
        restitution_from_speeds,
        time_of_impact,
        time_to_decay,
    )
    from daq_app.rocking.theory.housner import FreeRocking, exact_period, free_rocking

_PLACES = {
    "analysis.analyse": ("analyse_record",),
    "analysis.options": ("AnalysisOptions",),
    "analysis.results": ("TestAnalysis",),
    "estimators": ("RestitutionEstimate", "RestitutionPoint"),
    "geometry.kinematics": ("RotationGeometry", "WireRotation"),
    "live": ("Estimate", "LiveAnalyser", "LiveResult"),
    "motion.phases": ("Phase", "PhaseDetector", "PhaseEvent", "PhaseSettings"),
    "motion.velocity": ("VelocityFilter", "VelocityStream"),
    "record": ("TestRecord",),
    "theory.block": ("RigidBlock", "SemiRigid"),
    "theory.classic": (
        "amplitude_after",
        "energy",
        "energy_after",
        "frequency_parameter",
        "impacts_until",
        "period",
        "period_after",
        "r_max_block",
        "r_max_rectangular",
        "restitution_from_peaks",
        "restitution_from_speeds",
        "time_of_impact",
        "time_to_decay",
    ),
    "theory.housner": ("FreeRocking", "exact_period", "free_rocking"),
}
"""Module below this one → the names that it brings."""

__all__ = [
    "AnalysisOptions",
    "Estimate",
    "FreeRocking",
    "LiveAnalyser",
    "LiveResult",
    "Phase",
    "PhaseDetector",
    "PhaseEvent",
    "PhaseSettings",
    "RestitutionEstimate",
    "RestitutionPoint",
    "RigidBlock",
    "RotationGeometry",
    "SemiRigid",
    "TestAnalysis",
    "TestRecord",
    "VelocityFilter",
    "VelocityStream",
    "WireRotation",
    "amplitude_after",
    "analyse_record",
    "energy",
    "energy_after",
    "exact_period",
    "free_rocking",
    "frequency_parameter",
    "impacts_until",
    "period",
    "period_after",
    "r_max_block",
    "r_max_rectangular",
    "restitution_from_peaks",
    "restitution_from_speeds",
    "time_of_impact",
    "time_to_decay",
]

__getattr__, __dir__ = at_first_use(__name__, _PLACES)
