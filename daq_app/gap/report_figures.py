"""The pictures of a diagnosis: each draws into axes that it is given, for the page and for the PDF."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes

from daq_app.config.shown_text import shortened
from daq_app.gap.core import Diagnosis
from daq_app.gap.core.judging.where import GapMap
from daq_app.gap.traces import Trace

BEFORE, AFTER, MEASURED = "#8fa6bf", "#c8442e", "#1c232b"
_PHASES: Final = ("held", "release", "swing", "peak", "impact", "tail", "run", "rest")
_KNOT: Final = re.compile(r"^(.*?) at ([\d.]+) (.+)$")
_MOST_BARS: Final = 7

Shape = Mapping[str, tuple[float, float, float]]


def map_axes(found: GapMap) -> tuple[list[str], list[str]]:
    """Channels and phases of a map, in the order in which they are shown."""
    channels = list(dict.fromkeys(cell.channel for cell in found.cells))
    phases = sorted(
        {cell.phase for cell in found.cells},
        key=lambda phase: (_PHASES.index(phase) if phase in _PHASES else len(_PHASES), phase),
    )
    return channels, phases


def map_table(found: GapMap, channels: Sequence[str], phases: Sequence[str]) -> np.ndarray:
    """Largest gap of each channel and phase in units of noise and scatter; NaN where nothing is."""
    table = np.full((len(channels), len(phases)), np.nan)
    for cell in found.cells:
        if cell.channel in channels and cell.phase in phases:
            place = channels.index(cell.channel), phases.index(cell.phase)
            table[place] = np.fmax(table[place], cell.in_noise)
    return table


def draw_maps(before: Axes, after: Axes, result: Diagnosis) -> None:
    """Channel against phase, without and with what was found; 1 is noise and scatter."""
    channels, phases = map_axes(result.where)
    for axes, found, title in ((before, result.where, "before"), (after, result.remaining, "after")):
        table = map_table(found, channels, phases)
        shade = np.log10(np.clip(table, 0.5, 50.0))
        axes.imshow(shade, cmap="OrRd", vmin=np.log10(0.8), vmax=np.log10(30.0), aspect="auto")
        for (i, j), value in np.ndenumerate(table):
            if np.isfinite(value):
                dark = shade[i, j] > 0.9
                axes.text(
                    j, i, f"{value:.1f}", ha="center", va="center", fontsize=7, color="w" if dark else "k"
                )
        axes.set_xticks(range(len(phases)), phases, fontsize=7, rotation=30)
        axes.set_title(title, fontsize=8)
        axes.tick_params(length=0)
    before.set_yticks(range(len(channels)), channels, fontsize=7)
    after.set_yticks([])


def draw_evidence(axes: Axes, result: Diagnosis) -> None:
    """Log evidence less that of the best, of the first nine."""
    ranked = sorted(result.which, key=lambda r: -r.log_evidence)[:9][::-1]
    best = ranked[-1].log_evidence
    lengths = [max(r.log_evidence - best, -60.0) for r in ranked]
    names = [result.in_words(r.effects) for r in ranked]
    colours = [AFTER if r.effects == result.best else BEFORE for r in ranked]
    axes.barh(range(len(ranked)), [length + 60.0 for length in lengths], left=-60.0, color=colours)
    axes.set_yticks(range(len(ranked)), names, fontsize=7)
    axes.set_xlim(-60.0, 8.0)
    for row, entry in enumerate(ranked):
        if entry.probability >= 0.005:
            axes.text(1.0, row, f"{entry.probability:.2f}", va="center", fontsize=7)
    axes.set_xlabel("log evidence less that of the best (cut at −60)\nfigures: probability", fontsize=7)
    axes.tick_params(labelsize=7)


def draw_closure(axes: Axes, result: Diagnosis) -> None:
    """Held-out gap per level, before and after."""
    assert result.gap is not None
    levels = list(result.gap.per_level)
    place = np.arange(len(levels))
    axes.bar(
        place - 0.2, [result.gap.per_level[k][0] for k in levels], 0.38, color=BEFORE, label="without it"
    )
    axes.bar(place + 0.2, [result.gap.per_level[k][1] for k in levels], 0.38, color=AFTER, label="with it")
    axes.axhline(result.gap.floor, color="k", lw=0.8, ls=":", label="floor")
    axes.set_xticks(place, levels)
    axes.set_ylim(top=1.35 * axes.get_ylim()[1])  # room for the legend above the bars
    axes.set_ylabel("gap over noise and scatter", fontsize=7)
    axes.tick_params(labelsize=7)
    axes.legend(fontsize=6.5, frameon=False)


def draw_trace(upper: Axes, lower: Axes, trace: Trace, name: str) -> None:
    """θ(t) measured, without and with the effect; residuals below."""
    time = trace.time_s
    upper.plot(time, 1e3 * trace.measured_rad, color=MEASURED, lw=1.4, label=f"measured ({trace.shown})")
    upper.plot(time, 1e3 * trace.baseline_rad, color=BEFORE, lw=1.0, ls="--", label="simulated without")
    upper.plot(time, 1e3 * trace.augmented_rad, color=AFTER, lw=0.8, label=f"simulated with {name}")
    upper.set_title(shortened(f"{trace.run}, {trace.level}", 100), fontsize=8, parse_math=False)
    upper.set_ylabel("θ (mrad)", fontsize=7)
    upper.legend(fontsize=6, frameon=False, loc="upper right")
    without, with_it = (1e3 * rms for rms in trace.rms_rad)
    for simulated, colour, rms in (
        (trace.baseline_rad, BEFORE, without),
        (trace.augmented_rad, AFTER, with_it),
    ):
        lower.plot(
            time, 1e3 * (trace.measured_rad - simulated), color=colour, lw=0.9, label=f"{rms:.2f} mrad rms"
        )
    left = np.abs(trace.measured_rad - trace.baseline_rad)[trace.time_s >= 0.0]
    reach = 1.2e3 * float(np.nanmax(left, initial=1e-5))
    lower.set_ylim(-reach, reach)
    lower.axhline(0.0, color="k", lw=0.5)
    lower.set_ylabel("measured − simulated", fontsize=7)
    lower.set_xlabel("time since release (s)", fontsize=7)
    lower.legend(fontsize=6, frameon=False, loc="upper right")
    for axes in (upper, lower):
        axes.tick_params(labelsize=7)
        axes.grid(color="#e4e4e4", lw=0.5)
    upper.sharex(lower)
    upper.tick_params(labelbottom=False)


class ProbeMap:
    """One free form as curves (values at knots) or as bars (values with a name)."""

    def __init__(self, title: str, shape: Shape, meanings: Mapping[str, str], unit: str) -> None:
        self.title = title
        self.unit = unit
        self.curves: dict[str, list[tuple[float, float, float, float]]] = {}
        self.axis = ""
        self.bars: list[tuple[str, float, float, float]] = []
        for key, (value, low, high) in shape.items():
            meaning = meanings.get(key, key.rpartition(".")[2])
            knot = _KNOT.match(meaning)
            if knot is None:
                self.bars.append((meaning, value, low, high))
            else:
                self.axis = knot[3]
                self.curves.setdefault(knot[1], []).append((float(knot[2]), value, low, high))

    def draw(self, axes: Axes) -> None:
        """Draw the curves, or the bars where there is no curve."""
        if self.curves:
            self._draw_curves(axes)
        else:
            self._draw_bars(axes)
        axes.set_title(self.title, fontsize=7.5)
        axes.tick_params(labelsize=6.5)

    def _draw_curves(self, axes: Axes) -> None:
        for name, rows in self.curves.items():
            x, value, low, high = np.array(sorted(rows)).T
            axes.errorbar(
                x,
                value,
                yerr=np.abs([value - low, high - value]),
                fmt="o-",
                ms=2.5,
                lw=0.9,
                capsize=1.5,
                label=name,
            )
        axes.axhline(0.0, color="k", lw=0.5)
        axes.set_xlabel(self.axis, fontsize=6.5)
        axes.set_ylabel(self.unit, fontsize=6.5)
        if len(self.curves) > 1:
            axes.legend(fontsize=5.5, frameon=False)

    def _draw_bars(self, axes: Axes) -> None:
        rows = sorted(self.bars, key=lambda bar: abs(bar[1]) / max(bar[3] - bar[2], 1e-12))
        rows = rows[-_MOST_BARS:]
        values = np.array([row[1] for row in rows])
        errors = np.abs([[row[1] - row[2] for row in rows], [row[3] - row[1] for row in rows]])
        axes.barh(range(len(rows)), values, color=BEFORE, xerr=errors, error_kw={"lw": 0.7, "capsize": 1.5})
        axes.set_yticks(range(len(rows)), [row[0] for row in rows], fontsize=6)
        axes.axvline(0.0, color="k", lw=0.5)
        axes.set_xlabel(self.unit, fontsize=6.5)


_MAPS: Final[dict[str, tuple[str, str, float]]] = {
    "free_restitution": ("loss–velocity", "change of r", 1.0),
    "free_restoring": ("moment–rotation: time gained", "ms", 1e3),
    "free_geometry": ("moment–rotation, side against side: time gained", "ms", 1e3),
    "free_dissipation": ("loss in swings: fall later by", "ms", 1e3),
}


def probe_maps(result: Diagnosis, meanings: Mapping[str, str]) -> list[ProbeMap]:
    """The maps of the free forms: r(v), restoring moment, loss, then those of other models.

    `meanings`: probe parameter → its meaning; ``X at 0.15 α`` makes a curve.
    """
    shapes, maps = result.probe_shapes, []
    for name in sorted(shapes, key=lambda name: list(_MAPS).index(name) if name in _MAPS else len(_MAPS)):
        if shapes[name]:
            title, unit, factor = _MAPS.get(name, (name, "", 1.0))
            scaled = {key: (factor * a, factor * b, factor * c) for key, (a, b, c) in shapes[name].items()}
            maps.append(ProbeMap(title, scaled, meanings, unit))
    return maps


def bare(axes: Axes) -> Any:
    """Take away the frame at the top and the right."""
    axes.spines[["top", "right"]].set_visible(False)
    return axes
