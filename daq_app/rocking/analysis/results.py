"""What the analysis of a test yields, as plain data; `as_dict` is JSON-able (NaN becomes None)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from daq_app.plain import plain
from daq_app.rocking.estimators import RestitutionEstimate
from daq_app.rocking.families.finding import FamilyFinding
from daq_app.rocking.families.verdict import FamilyView, RVerdict
from daq_app.rocking.motion.motion_fit import MotionFit

Floats = NDArray[np.float64]

Zero = Literal["tare", "rest", "certificates"]
"""Taken before the test with the wall upright; from the rest after it; or the certificates' offsets alone."""


@dataclass(frozen=True, slots=True)
class QualityNote:
    """Something that a reader of the result should know."""

    severity: Literal["info", "warning"]
    text: str


@dataclass(frozen=True, slots=True)
class ValueWithSigma:
    """A value and its standard uncertainty."""

    value: float
    sigma: float


@dataclass(frozen=True, slots=True)
class HalfCycle:
    """From impact n (0: the release) to impact n + 1. Signed values; NaN where not measurable."""

    n: int
    start_s: float
    """Time of impact n, or of the release."""
    sigma_start_s: float
    """NaN for the release."""
    duration_s: float
    """To the next impact: T/2 (the fall from the release: T/4). NaN for the last."""
    sigma_duration_s: float
    peak_rad: float
    sigma_peak_rad: float
    phi: float
    """|peak| / α."""
    speed_before_rad_s: float
    """θ̇⁻ at impact n, one-sided fit."""
    sigma_speed_before_rad_s: float
    speed_after_rad_s: float
    """θ̇⁺ at impact n, one-sided fit."""
    sigma_speed_after_rad_s: float
    speed_filtered_rad_s: float
    """Peak of the filtered velocity at impact n (the paper's way)."""
    jump_ratio: float
    """|θ̇⁺| / |θ̇⁻| of this impact."""
    accelerometer_s: float
    """Impact time from the accelerometers' shock."""
    period_theory_s: float
    """T/2 by (4.1) for this peak (T/4 for the fall)."""


@dataclass(frozen=True, slots=True)
class Bias:
    """Mean error of a method on simulated motion like this test's."""

    mean: float
    standard_error: float
    scatter: float
    """Standard deviation of the error over the simulated tests."""
    runs: int


@dataclass(frozen=True, slots=True)
class JointSummary:
    """The base joint over the test."""

    half_width_m: float
    """Half the width of the base: its edges are at ± this."""
    profile_ids: tuple[str, ...]
    """LVDTs, in the order of the profile."""
    profile_x_m: tuple[float, ...]
    profile_y_m: tuple[float, ...]
    profile_opening_m: tuple[float, ...]
    """Opening at each LVDT in the hold."""
    profile_opposite_m: tuple[float, ...]
    """Opening at each LVDT at the first peak on the other side; NaN where that half-cycle is not known."""
    pivot_left_m: ValueWithSigma | None
    """Neutral axis while the wall leans to −x (median over the motion, scatter)."""
    pivot_right_m: ValueWithSigma | None
    inset_left_m: float
    """Pivot's distance from the edge it should be at."""
    inset_right_m: float
    inset_theory_m: float
    """a = 2 a_f (2.3)."""
    contact_m: float
    """Median length in contact over the motion."""
    twist_hold_rad_per_m: float
    twist_peak_rad_per_m: float
    gain_to_wires: float
    """Slope of LVDT rotation against wire rotation."""
    suspects: tuple[str, ...]
    clipped: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Residuals:
    """After the test, against the zero before it."""

    rotation_wires_rad: ValueWithSigma
    rotation_lvdts_rad: ValueWithSigma | None
    rotation_tilt_rad: ValueWithSigma | None
    sliding_m: ValueWithSigma | None
    """Shift of the base towards +x: what the wires show at height 0."""


@dataclass(frozen=True, slots=True)
class Theory:
    """Rigid-block theory of the specimen, for comparison."""

    p_rad_s: float
    alpha_rad: float
    r_max: float
    """1 − 3/2 sin²α (1.2)."""
    r_max_block: float
    """1 − 2 m R² sin²α / I_O."""
    semi_rigid_a_m: float
    semi_rigid_alpha_rad: float
    semi_rigid_p_rad_s: float
    phi_n: tuple[float, ...]
    """(4.3) from the measured φ0 with the CRT r."""
    period_n_s: tuple[float, ...]
    """(4.2) likewise."""


@dataclass(frozen=True)
class Series:
    """Signals over the whole record on one time base; not part of the JSON."""

    time_s: Floats
    rotation_rad: Floats
    """From the wires."""
    velocity_rad_s: Floats
    best_rotation_rad: Floats
    """Wires and LVDTs fused."""
    best_sigma_rad: Floats
    neutral_axis_m: Floats
    contact_m: Floats
    twist_rad_per_m: Floats


@dataclass(frozen=True)
class TestAnalysis:
    """Everything found in one test."""

    __test__ = False  # not a test class, whatever its name begins with

    label: str
    found: bool
    """Whether the record shows a release and at least one impact."""
    rate_hz: float
    theta0_rad: float
    """From the tiltmeters (from the wires where there are none)."""
    theta0_over_alpha: float
    theta0_by_family: Mapping[str, ValueWithSigma]
    """tiltmeters, wires, lvdts, best."""
    side: int
    release_s: float
    rest_s: float
    half_cycles: tuple[HalfCycle, ...]
    verdict: RVerdict
    """r from everything that was recorded, and how far it is to be believed."""
    families: tuple[FamilyView, ...]
    """What each family says, side by side; empty where no test was found."""
    findings: tuple[FamilyFinding, ...]
    """Instruments and families that disagree with the rest: who, by how much, what was done."""
    estimates: Mapping[str, RestitutionEstimate]
    """By method: eav, crt (headline), eav_filtered, eav_filtered_corrected, crt_exact, and eav and
    crt from the fused rotation and from the LVDTs."""
    fit: MotionFit | None
    bias: Mapping[str, Bias]
    """By method, where simulated."""
    theory: Theory
    joint: JointSummary | None
    residuals: Residuals | None
    noise_rad: float
    """rms of the rotation while held, one sample."""
    zero: Zero
    """Where the zero of every sensor comes from."""
    filter_statement: str
    notes: tuple[QualityNote, ...]
    series: Series | None = None

    def as_dict(self) -> dict[str, Any]:
        """JSON-able: no series, NaN and infinity as None, intervals added to the estimates."""
        result = {f.name: plain(getattr(self, f.name)) for f in fields(self) if f.name != "series"}
        for name, estimate in self.estimates.items():
            interval = estimate.interval95()
            result["estimates"][name]["interval95"] = None if interval is None else list(interval)
        if self.fit is not None:
            result["fit"]["explains_the_motion"] = self.fit.explains_the_motion
            result["fit"]["interval95"] = list(self.fit.interval95())
        return result
