"""Figures 4.1 to 4.4 of the paper, drawn from the summaries of a campaign."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from daq_app.campaign.summaries.summary import TestSummary
from daq_app.config.wording import METHOD_MARKS
from daq_app.rocking import amplitude_after, period, period_after

SPECIMEN_COLOURS: Final = ("#1f5fa8", "#c2571a", "#3a7d44", "#7b4fa3")
METHOD_COLOURS: Final = {"CRT": "#1f5fa8", "EAV": "#c2571a", "fit": "#3a7d44"}
_THEORY: dict[str, Any] = {"color": "#333333", "lw": 1.2}
_GRID: dict[str, Any] = {"color": "#dddddd", "lw": 0.6}


_LEFT, _RIGHT, _BOTTOM, _TOP, _BETWEEN = 0.75, 0.15, 0.6, 0.15, 0.75
"""Margins of the axes and the width between two of them, inches: room for tick labels of four characters.
They are given because matplotlib finds them by drawing each figure twice more."""
_TITLE = 0.4
"""Height of a title or a row of legend above the axes, inches."""


def _axes(figure: Figure, rows: int, columns: int, *, above: float = 0.0) -> list[Axes]:
    """Axes in a grid; `above`: room above them, inches."""
    width, height = figure.get_size_inches()
    wide = (width - _LEFT - _RIGHT - (columns - 1) * _BETWEEN) / columns
    figure.subplots_adjust(
        left=_LEFT / width,
        right=1.0 - _RIGHT / width,
        bottom=_BOTTOM / height,
        top=1.0 - (_TOP + above) / height,
        wspace=_BETWEEN / wide,
        hspace=0.08,
    )
    grid = figure.subplots(rows, columns, squeeze=False)
    axes = [axis for row in grid for axis in row]
    for axis in axes:
        axis.grid(**_GRID)
        axis.set_axisbelow(True)
        axis.spines[["top", "right"]].set_visible(False)
    return axes


def histories(tests: Sequence[TestSummary], title: str) -> Figure:
    """Figure 4.1: rotation and velocity of a level, its repetitions overlaid."""
    figure = Figure(figsize=(10, 6))
    top, bottom = _axes(figure, 2, 1, above=_TITLE)
    bottom.sharex(top)
    for index, test in enumerate(tests):
        style = "--" if test.repetition else "-"
        colour = "#111111" if test.repetition else f"C{index % 10}"
        alpha = 1.0 if test.good else 0.35
        label = test.test if test.good else f"{test.test} (left out)"
        top.plot(test.time_s, test.rotation_rad * 1e3, style, color=colour, lw=1, alpha=alpha, label=label)
        bottom.plot(test.time_s, test.velocity_rad_s, style, color=colour, lw=1, alpha=alpha)
    top.set_ylabel("rotation θ (mrad)")
    bottom.set_ylabel("angular velocity (rad/s)")
    bottom.set_xlabel("time after release (s)")
    top.tick_params(labelbottom=False)
    top.legend(loc="upper right", ncols=2, fontsize=9, frameon=False)
    figure.suptitle(title)
    return figure


def period_against_amplitude(tests: Sequence[TestSummary]) -> Figure:
    """Figure 4.2: measured periods against peak rotation, with the theory of each specimen (4.1)."""
    figure = Figure(figsize=(8, 5))
    (axis,) = _axes(figure, 1, 1)
    specimens = sorted({test.specimen for test in tests})
    amplitudes = np.linspace(0.002, max([0.45, *(t.phi0 * 1.05 for t in tests)]), 300)
    for index, specimen in enumerate(specimens):
        good_tests = [test for test in tests if test.specimen == specimen and test.good]
        colour = SPECIMEN_COLOURS[index % len(SPECIMEN_COLOURS)]
        for number, test in enumerate(good_tests):
            count = min(len(test.periods_s), test.phi.size - 1)
            axis.plot(
                test.phi[1 : count + 1],
                test.periods_s[:count],
                "o",
                ms=3.5,
                mfc="none",
                color=colour,
                alpha=0.6,
                label=f"{specimen} measured" if number == 0 else None,
            )
        if good_tests:
            theory = period(amplitudes, good_tests[0].p_rad_s)
            style = ("-", "--", "-.", ":")[index % 4]
            axis.plot(amplitudes, theory, style, color=colour, lw=1.6, label=f"{specimen} theory (4.1)")
    axis.set_xlabel("peak rotation θ/α")
    axis.set_ylabel("period T (s)")
    axis.set_xlim(left=0)
    axis.set_ylim(bottom=0)
    axis.legend(frameon=False, fontsize=9)
    return figure


def decay(tests: Sequence[TestSummary], title: str) -> Figure:
    """Figure 4.3: T_n (4.2) and φ_n (4.3) against n, measured and theory with the mean CRT r."""
    figure = Figure(figsize=(10, 4.2))
    left, right = _axes(figure, 1, 2, above=_TITLE)
    good = [test for test in tests if test.good]
    longest = max((len(test.peaks_rad) for test in good), default=2)
    n = np.arange(0, longest)
    for index, test in enumerate(good):
        colour = f"C{index % 10}"
        left.plot(np.arange(1, len(test.periods_s) + 1), test.periods_s, "o", ms=4, mfc="none", color=colour)
        right.plot(
            np.arange(test.phi.size), np.abs(test.phi), "o", ms=4, mfc="none", color=colour, label=test.test
        )
    if good:
        r = float(np.mean([test.methods["CRT"].r for test in good if "CRT" in test.methods]))
        phi0 = float(np.mean([test.phi0 for test in good]))
        left.plot(n[1:], period_after(n[1:], phi0, r, good[0].p_rad_s), **_THEORY)
        right.plot(n, amplitude_after(n, phi0, r), **_THEORY, label=f"theory, r = {r:.3f}")
        r_max = good[0].r_max
        left.plot(n[1:], period_after(n[1:], phi0, r_max, good[0].p_rad_s), ls="--", color="#888888")
        right.plot(
            n, amplitude_after(n, phi0, r_max), ls="--", color="#888888", label=f"theory, rₘₐₓ = {r_max:.3f}"
        )
    left.set_ylabel("period Tₙ (s)")
    right.set_ylabel("peak rotation φₙ = θₙ/α")
    for axis in (left, right):
        axis.set_xlabel("impact n")
        axis.set_xlim(left=0)
        axis.set_ylim(bottom=0)
    right.legend(frameon=False, fontsize=9)
    figure.suptitle(title)
    return figure


def restitution_by_level(tests: Sequence[TestSummary]) -> Figure:
    """Figure 4.4: r of every test by level, CRT and EAV, one panel per specimen, with r_max."""
    specimens = sorted({test.specimen for test in tests})
    figure = Figure(figsize=(5.2 * max(len(specimens), 1), 4.6))
    axes = _axes(figure, 1, max(len(specimens), 1), above=2 * _TITLE)
    for axis, specimen in zip(axes, specimens, strict=False):
        of_specimen = [test for test in tests if test.specimen == specimen]
        labels = sorted({_level_label(test) for test in of_specimen})
        for offset, method in ((-0.14, "CRT"), (0.14, "EAV")):
            shown = [test for test in of_specimen if method in test.methods]
            for good in (True, False):
                part = [test for test in shown if test.good == good]
                if not part:
                    continue
                places = [labels.index(_level_label(test)) + offset + _jitter(test, part) for test in part]
                axis.errorbar(
                    places,
                    [test.methods[method].r for test in part],
                    yerr=[1.96 * test.methods[method].standard_error for test in part],
                    fmt=METHOD_MARKS[method] if good else "x",
                    ms=5,
                    lw=1,
                    capsize=2,
                    color=METHOD_COLOURS[method],
                    alpha=1.0 if good else 0.4,
                    label=method if good else f"{method}, left out of the mean",
                )
        if of_specimen:
            axis.axhline(of_specimen[0].r_max, color="#333333", ls="--", lw=1, label="rₘₐₓ of the block")
        axis.set_xticks(range(len(labels)), labels)
        axis.set_xlim(-0.6, len(labels) - 0.4)
        axis.set_xlabel("level")
        axis.set_title(f"{specimen}, rₘₐₓ = {of_specimen[0].r_max:.3f}" if of_specimen else specimen)
    handles = {
        label: handle
        for axis in axes
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)
    }
    figure.legend(handles.values(), handles.keys(), loc="upper center", ncols=3 * len(axes), frameon=False)
    axes[0].set_ylabel("coefficient of restitution r")
    return figure


def _level_label(test: TestSummary) -> str:
    return f"{test.level}-R" if test.repetition else test.level


def _jitter(test: TestSummary, tests: Sequence[TestSummary]) -> float:
    """Tests of one level side by side, so that their bars do not hide each other."""
    peers = [other.test for other in tests if _level_label(other) == _level_label(test)]
    return (peers.index(test.test) - (len(peers) - 1) / 2) * 0.045
