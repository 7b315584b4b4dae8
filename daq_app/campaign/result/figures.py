"""Pictures of one test beside the earlier tests of its level and the classic theory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from daq_app.campaign.report.figures import METHOD_COLOURS
from daq_app.campaign.result.motions import measured_periods, theory_motion
from daq_app.campaign.summaries.summary import TestSummary
from daq_app.config.wording import METHOD_MARKS, plus_minus
from daq_app.rocking import period

TEST_COLOUR: Final = "#1f5fa8"
EARLIER_COLOUR: Final = "#b5bdc6"
THEORY_COLOUR: Final = "#7b4fa3"


def result_figure(
    test: TestSummary, earlier: Sequence[TestSummary] = (), *, size_in: tuple[float, float] = (11.0, 7.2)
) -> Figure:
    """θ(t), θ̇(t), r per impact and period against amplitude of one test; letters as `rcParams` says."""
    figure = Figure(figsize=size_in, layout="constrained")
    rotation, restitution, velocity, periods = figure.subplots(
        2, 2, gridspec_kw={"width_ratios": (1.7, 1.0)}
    ).ravel()
    _draw_histories(rotation, velocity, test, earlier)
    _draw_restitution(restitution, test)
    _draw_periods(periods, test, earlier)
    for axis in (rotation, restitution, velocity, periods):
        axis.grid(color="#dddddd", lw=0.6)
        axis.set_axisbelow(True)
        axis.spines[["top", "right"]].set_visible(False)
    figure.suptitle(test.test, fontweight="bold", x=0.01, ha="left")
    return figure


def _draw_histories(
    rotation: Axes, velocity: Axes, test: TestSummary, earlier: Sequence[TestSummary]
) -> None:
    velocity.sharex(rotation)
    for other in earlier:
        label = "earlier tests of the level" if other is earlier[0] else None
        rotation.plot(other.time_s, 1e3 * other.rotation_rad, color=EARLIER_COLOUR, lw=0.9, label=label)
        velocity.plot(other.time_s, other.velocity_rad_s, color=EARLIER_COLOUR, lw=0.9)
    rotation.plot(test.time_s, 1e3 * test.rotation_rad, color=TEST_COLOUR, lw=1.3, label=test.test)
    velocity.plot(test.time_s, test.velocity_rad_s, color=TEST_COLOUR, lw=1.3)
    theory = theory_motion(test)
    if theory is not None:
        style: dict[str, Any] = {"color": THEORY_COLOUR, "ls": "--", "lw": 1.0}
        rotation.plot(theory[0], 1e3 * theory[1], **style, label="Housner with the test's r")
        velocity.plot(theory[0], theory[2], **style)
    rotation.plot(test.impacts_s, np.zeros(len(test.impacts_s)), "^", ms=4, color="#111111", label="impacts")
    rotation.set_ylabel("rotation θ (mrad)")
    per_alpha = 1e-3 / test.alpha_rad
    second = rotation.secondary_yaxis(
        "right", functions=(lambda y: np.asarray(y) * per_alpha, lambda y: np.asarray(y) / per_alpha)
    )
    second.set_ylabel("θ/α")
    velocity.set_ylabel("angular velocity dθ/dt (rad/s)")
    velocity.set_xlabel("time after release (s)")
    rotation.legend(frameon=False, fontsize="small", loc="upper right")


def _draw_restitution(axis: Axes, test: TestSummary) -> None:
    for name in ("CRT", "EAV"):
        method = test.methods.get(name)
        if method is None:
            continue
        impacts = [impact for impact, _ in method.points]
        axis.plot(
            impacts,
            [r for _, r in method.points],
            METHOD_MARKS[name],
            ms=5,
            color=METHOD_COLOURS[name],
            label=f"{name} {method.r:.4f} {plus_minus(method.standard_error)}",
        )
        low, high = method.r - method.standard_error, method.r + method.standard_error
        axis.axhspan(low, high, color=METHOD_COLOURS[name], alpha=0.18, lw=0)
    axis.axhline(test.r_max, color="#333333", ls="--", lw=1, label=f"rₘₐₓ {test.r_max:.3f}")
    axis.set_xlabel("impact")
    axis.set_ylabel("coefficient of restitution r")
    axis.set_xlim(left=0)
    axis.legend(frameon=False, fontsize="small")


def _draw_periods(axis: Axes, test: TestSummary, earlier: Sequence[TestSummary]) -> None:
    for other in earlier:
        axis.plot(*measured_periods(other), "o", ms=3, color=EARLIER_COLOUR)
    axis.plot(*measured_periods(test), "o", ms=4.5, color=TEST_COLOUR, label="measured half-cycles × 2")
    phi = np.linspace(0.002, max(0.45, 1.1 * test.phi0), 200)
    axis.plot(phi, period(phi, test.p_rad_s), color=THEORY_COLOUR, lw=1.4, label="theory (4.1)")
    axis.set_xlabel("peak rotation θ/α")
    axis.set_ylabel("period T (s)")
    axis.set_xlim(left=0)
    axis.set_ylim(bottom=0)
    axis.legend(frameon=False, fontsize="small")
