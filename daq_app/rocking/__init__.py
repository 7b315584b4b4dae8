"""Rocking analysis: classic theory, kinematics, impacts and restitution, online and offline.

from daq_app.rocking import RigidBlock, period
block = RigidBlock(weight_n=51300, r0_m=1.525, inertia_kg_m2=16107, alpha0_rad=0.215)
block.p_rad_s, block.r_max, period(0.35, block.p_rad_s)
"""

from daq_app.rocking.analysis.analyse import AnalysisOptions, analyse_record
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
