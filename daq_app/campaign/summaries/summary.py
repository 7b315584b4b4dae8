"""What the campaign's tables and figures need to know of one test."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from daq_app.campaign.status import RecordedTest, TestVerdict
from daq_app.rocking.families.verdict import FamilyView, RVerdict

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class MethodResult:
    """r of one test by one estimator."""

    r: float
    standard_error: float
    bias: float = 0.0
    """What the method gives beyond the truth on simulated motion of this amplitude and noise."""
    bias_standard_error: float = 0.0
    points: tuple[tuple[int, float], ...] = ()
    """(impact, r) of each point."""

    @property
    def corrected(self) -> float:
        """r less the method's bias."""
        return self.r - self.bias

    @property
    def corrected_standard_error(self) -> float:
        return float(np.hypot(self.standard_error, self.bias_standard_error))


@dataclass(frozen=True, slots=True)
class TestSummary:
    """One analysed test. Angles are signed so that the release is positive."""

    __test__ = False  # not a test case, whatever its name starts with

    test: str
    specimen: str
    level: str
    repetition: bool
    """One of the repetitions at the end (L3-R)."""
    run: str
    """File name of the run."""
    alpha_rad: float
    p_rad_s: float
    r_max: float
    theta0_rad: float
    impacts_s: tuple[float, ...]
    """Seconds after the release."""
    peaks_rad: tuple[float, ...]
    """|peak| of each half-cycle, the release first."""
    periods_s: tuple[float, ...]
    """Full period T_n after impact n (from 1): peaks of the same side of the velocity."""
    methods: dict[str, MethodResult]
    """By estimator: ``EAV``, ``CRT`` and others."""
    time_s: Floats
    """(n,) seconds after the release."""
    rotation_rad: Floats
    velocity_rad_s: Floats
    good: bool
    trust: str = ""
    """How far r is to be believed by everything that was recorded: good, remarks or doubtful."""
    verdict: RVerdict | None = None
    """r from all families; None in summaries made by hand."""
    families: tuple[FamilyView, ...] = ()
    """What each family says of the test."""
    reasons: tuple[str, ...] = ()
    """Why the test is left out of the means, or what the reader should know."""

    @property
    def phi(self) -> Floats:
        """Peaks as θ/α."""
        return np.asarray(self.peaks_rad) / self.alpha_rad

    @property
    def phi0(self) -> float:
        """θ0/α of the release, from the tiltmeters."""
        return abs(self.theta0_rad) / self.alpha_rad


@dataclass(frozen=True, slots=True)
class Failure:
    """A run that could not be analysed, and why."""

    test: str
    path: Path
    reason: str
    flagged_bad: bool = False
    """Somebody or the recorder had rejected it before: nobody expected an analysis."""


def judged(summary: TestSummary, test: RecordedTest) -> TestSummary:
    """The summary under the name and the verdict that hold now: the operator may have changed both since.

    The reasons of a rejected test are why it was rejected; what the analysis remarked is left out.
    """
    name, good = test.name, test.verdict is not TestVerdict.BAD
    rejected = (test.reason,) if test.reason else ()
    return replace(
        summary,
        test=str(name),
        specimen=name.specimen,
        level=name.level,
        repetition=name.repetition,
        run=summary.run if test.path is None else test.path.name,
        good=good,
        reasons=summary.reasons if good else rejected,
    )
