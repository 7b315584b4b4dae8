"""``python -m studies.restitution.eav_crt``: what would make EAV (4.4) fall below CRT (4.5)?

Simulated tests go through all sensors and converters and the product's own analysis; only one thing is
changed at a time: an analysis choice, or one effect of the library at half and at the whole of its
plausible range. Prints both tables and draws docs/images/analysis/eav-crt.svg.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from scipy.signal import butter, sosfiltfilt

from daq_app.config import load_rig, plan_tasks
from daq_app.config.rig import Rig
from daq_app.config.scaling import Scaling
from daq_app.rocking import AnalysisOptions, TestAnalysis, TestRecord, VelocityFilter, analyse_record
from daq_app.rocking.motion.filtered_peaks import filtered_peaks
from daq_app.rocking.theory import classic as theory
from sim_hardware.direct import synthesise_test
from sim_hardware.dynamics.effects import MOTION_EFFECTS
from sim_hardware.sensors.effects import SENSOR_EFFECTS

Floats = NDArray[np.float64]
REPOSITORY = Path(__file__).parents[2]
R_TRUE = 0.895
LEVELS = {"L1": 0.15, "L3": 0.35}
PAPER = {"FR1": -0.076, "FR2": -0.036}
"""EAV less CRT in the mean of each specimen (Table 4.1)."""
CUTOFFS_HZ = (5.0, 10.0, 20.0, 50.0, 100.0)
PAPER_CUTOFF_HZ = 20.0
MOTION = (
    "winkler",
    "pivot_shift",
    "rounded_edge",
    "dwell",
    "bounce",
    "viscous",
    "coulomb",
    "quadratic_drag",
    "restitution_slope",
    "restitution_asymmetry",
    "alpha_asymmetry",
    "base_tilt",
    "flexible_wall",
    "compliance",
    "sliding",
    "residual_cable",
    "initial_velocity",
)
SMALLER = {"gain@wire": 0.03, "wire_cosine@wire": 0.3}
"""Where the whole range is so far from the other families that the analysis finds no test at all."""
SENSOR = ("gain@wire", "lag@wire", "slow_response@wire", "filter_delay@wire", "wire_cosine@wire", "clock")


@dataclass(frozen=True, slots=True)
class Outcome:
    """What the analysis finds: CRT, EAV by one-sided fits, EAV from filtered peaks; means over impacts."""

    crt: float
    eav: float
    eav_filtered: float

    @property
    def by_fits(self) -> float:
        """EAV less CRT."""
        return self.eav - self.crt

    @property
    def by_filter(self) -> float:
        """EAV from filtered peaks less CRT."""
        return self.eav_filtered - self.crt


@dataclass(frozen=True, slots=True)
class Row:
    """One effect at one strength."""

    effect: str
    parameter: str
    value: float
    unit: str
    outcome: Outcome


class Bench:
    """The shipped FR1 rig with a wall that has no scatter, and its analysis."""

    def __init__(self) -> None:
        rig = load_rig(REPOSITORY / "configs" / "fr1.toml")
        quick = {
            "upright_s": 2.0,
            "pull_s": 2.0,
            "hold_s": 3.0,
            "restitution_scatter": 0.0,
            "theta0_scatter": 0.0,
        }
        self.rig: Rig = rig.model_copy(update={"simulation": rig.simulation.model_copy(update=quick)})
        self.plan = plan_tasks(self.rig)
        self.offsets = {c.channel.id: c.time_offset_s for task in self.plan.tasks for c in task.channels}

    def analyse(
        self, ratio: float, effects: Mapping[str, Mapping[str, float]], *, series: bool = False
    ) -> TestAnalysis:
        """One simulated test through sensors, converters, zero and analysis."""
        test = synthesise_test(
            self.rig, self.plan, ratio, 7, restitution=R_TRUE, effects=effects, post_rest_s=1.2
        )
        means = test.readings[:, : test.upright_samples].mean(axis=1)
        tare = {c.id: float(m - c.offset) for c, m in zip(self.rig.channels, means, strict=True)}
        si = Scaling.of(self.rig.channels, tare).to_si(test.readings)
        record = TestRecord.from_array(self.rig, test.rate_hz, si, time_offsets_s=self.offsets)
        options = AnalysisOptions(
            velocity_cutoff_hz=PAPER_CUTOFF_HZ, fit=False, bias_runs=0, keep_series=series
        )
        return analyse_record(record, options)

    def outcome(self, ratio: float, effects: Mapping[str, Mapping[str, float]]) -> Outcome:
        """Plain means of the points, as in the paper."""
        found = self.analyse(ratio, effects).estimates
        values = [
            found[name].plain_mean if name in found else None for name in ("crt", "eav", "eav_filtered")
        ]
        return Outcome(*(math.nan if value is None else value for value in values))


# -- analysis choices ----------------------------------------------------------------------------


def gaussian(rate_hz: float, cutoff_hz: float, theta: Floats) -> Floats:
    """The product's stated differentiator."""
    return VelocityFilter(rate_hz, cutoff_hz).velocity(theta)


def butterworth(rate_hz: float, cutoff_hz: float, theta: Floats) -> Floats:
    """Fourth-order Butterworth forwards and backwards, then central differences."""
    smooth = sosfiltfilt(butter(4, cutoff_hz, fs=rate_hz, output="sos"), theta)
    return np.asarray(np.gradient(smooth) * rate_hz)


def moving_average(rate_hz: float, cutoff_hz: float, theta: Floats) -> Floats:
    """Running mean with its −3 dB point (0.443 over its length) at the cut-off, then central differences."""
    width = max(1, round(0.443 / cutoff_hz * rate_hz))
    padded = np.pad(theta, (width // 2, width - 1 - width // 2), mode="edge")
    return np.asarray(np.gradient(np.convolve(padded, np.ones(width) / width, "valid")) * rate_hz)


FILTERS: dict[str, Callable[[float, float, Floats], Floats]] = {
    "Gaussian": gaussian,
    "Butterworth": butterworth,
    "running mean": moving_average,
}


def eav_of(speeds: Floats, first: int | None = None) -> float:
    """Mean of √(|θ̇ₙ₊₂| / |θ̇ₙ|) (4.4) over all impacts, or over the first so many."""
    used = np.abs(speeds[:first])
    return float(np.nanmean(np.sqrt(used[2:] / used[:-2])))


@dataclass(frozen=True, slots=True)
class Choice:
    """One way to analyse the same record: EAV less CRT by level."""

    name: str
    cutoff_hz: float
    all_impacts: dict[str, float]
    first_six: dict[str, float]


def _part(signal: Floats, start: int, stop: int) -> Floats:
    return signal[start:stop]


def filter_choices(analyses: Mapping[str, TestAnalysis]) -> list[Choice]:
    """Peaks of the velocity by every filter and cut-off, and without any filter."""
    found = []
    for name, differentiate in [*FILTERS.items(), ("none", butterworth)]:
        for cutoff in CUTOFFS_HZ if name != "none" else (1000.0,):
            every, six = {}, {}
            for level, analysis in analyses.items():
                series, crt = analysis.series, analysis.estimates["crt"].plain_mean
                assert series is not None and crt is not None
                impacts = [half.start_s for half in analysis.half_cycles[1:]]
                velocity = differentiate(analysis.rate_hz, cutoff, series.rotation_rad)
                peaks = filtered_peaks(series.time_s, partial(_part, velocity), impacts)
                every[level] = eav_of(peaks) - crt
                six[level] = eav_of(peaks, 6) - crt
            found.append(Choice(name, cutoff, every, six))
    return found


def crt_choices(analysis: TestAnalysis) -> Iterator[tuple[str, float]]:
    """CRT with a wrong α or θ0 less the true r: a larger CRT lowers EAV − CRT by as much."""
    peaks = np.abs([half.peak_rad for half in analysis.half_cycles])
    alpha = analysis.theory.alpha_rad

    def crt(alpha_used: float, theta0: float) -> float:
        n = np.arange(1, peaks.size)
        phi = peaks[1:] / alpha_used
        keep = phi > 0.005
        values = theory.restitution_from_peaks(theta0 / alpha_used, phi[keep], n[keep])
        return float(np.nanmean(values))

    usual = crt(alpha, peaks[0])
    for name, factor in (("α 3 % too large", 1.03), ("α 3 % too small", 0.97), ("α 10 % too large", 1.10)):
        yield name, crt(factor * alpha, peaks[0]) - usual
    for name, factor in (("θ0 2 % too large", 1.02), ("θ0 2 % too small", 0.98)):
        yield name, crt(alpha, factor * peaks[0]) - usual


# -- effects -------------------------------------------------------------------------------------


def effect_rows(bench: Bench, effects: Sequence[str], say: Callable[[str], None]) -> list[Row]:
    """Every effect at half and whole range, both signs where it has them."""
    specs = {spec.name: spec for spec in (*MOTION_EFFECTS, *SENSOR_EFFECTS)}
    rows = []
    for key in effects:
        spec = specs[key.partition("@")[0]]
        p = spec.strength
        reach = SMALLER.get(key, p.high)
        strengths = [-reach, reach] if p.low < 0 else [0.5 * reach, reach]
        for value in strengths:
            say(f"{key} {p.name}={value:g}")
            outcome = bench.outcome(LEVELS["L3"], {key: {p.name: value}})
            rows.append(Row(key, p.name, value, p.unit, outcome))
    return rows


def verdict(rows: list[Row], wanted: float) -> str:
    """Whether an effect alone can lower EAV (fits) under CRT by `wanted` within its range."""
    lowest = min(rows, key=lambda row: row.outcome.by_fits)
    depth = lowest.outcome.by_fits
    if not math.isfinite(depth):
        return "no r found"
    if depth > 0.2 * wanted:
        return "no"
    if depth > wanted:
        return f"{100 * depth / wanted:.0f} % of it"
    return "yes"


# -- output --------------------------------------------------------------------------------------


def choice_table(choices: list[Choice]) -> Table:
    """EAV less CRT by filter, cut-off, level and impacts used."""
    table = Table("filter", "−3 dB, Hz", *(f"{level}, {n}" for level in LEVELS for n in ("all", "first 6")))
    for choice in choices:
        cells = [f"{part[level]:+.4f}" for level in LEVELS for part in (choice.all_impacts, choice.first_six)]
        table.add_row(choice.name, f"{choice.cutoff_hz:g}", *cells)
    return table


def effect_table(rows: list[Row]) -> Table:
    """CRT, EAV and their difference by effect and strength."""
    table = Table("effect", "strength", "CRT", "EAV", "EAV − CRT", "filtered at 20 Hz", "FR1", "FR2")
    for effect in dict.fromkeys(row.effect for row in rows):
        own = [row for row in rows if row.effect == effect]
        for row in own:
            o = row.outcome
            last = [verdict(own, wanted) if row is own[-1] else "" for wanted in PAPER.values()]
            strength = f"{row.parameter} {row.value:g} {row.unit if row.unit != '1' else ''}".strip()
            figures = (f"{o.crt:.4f}", f"{o.eav:.4f}", f"{o.by_fits:+.4f}", f"{o.by_filter:+.4f}")
            table.add_row(effect, strength, *figures, *last)
    return table


def draw(choices: list[Choice], rows: list[Row]) -> Figure:
    """Left: what the filter does. Right: what each effect does over its range."""
    figure = Figure(figsize=(11.0, 5.6), layout="constrained")
    left, right = figure.subplots(1, 2, gridspec_kw={"width_ratios": (1.0, 1.25)})
    colours = {"Gaussian": "#1f5fa8", "Butterworth": "#b8560b", "running mean": "#2c7a4b"}
    for name, colour in colours.items():
        of_filter = [c for c in choices if c.name == name]
        for level, style in (("L1", "o--"), ("L3", "s-")):
            y = [c.all_impacts[level] for c in of_filter]
            left.plot(
                [c.cutoff_hz for c in of_filter], y, style, ms=4, color=colour, label=f"{name}, {level}"
            )
    left.set_xscale("log")
    left.set_xticks(CUTOFFS_HZ, [f"{f:g}" for f in CUTOFFS_HZ])
    left.set_xlabel("cut-off of the velocity filter (Hz, −3 dB)")
    left.set_ylabel("EAV from velocity peaks − CRT")
    left.set_title("a) analysis: all impacts of one Housner wall, r = 0.895", fontsize=9.5)
    effects = list(dict.fromkeys(row.effect for row in rows))[::-1]
    for place, effect in enumerate(effects):
        own = [row.outcome for row in rows if row.effect == effect]
        for outcomes, shift, colour, label in (
            ([o.by_fits for o in own], 0.16, "#1f5fa8", "EAV by one-sided fits"),
            ([o.by_filter for o in own], -0.16, "#c7d7ea", "EAV from peaks filtered at 20 Hz"),
        ):
            known = [value for value in outcomes if math.isfinite(value)]
            low, high = min([0.0, *known]), max([0.0, *known])
            bar_label = label if place == 0 else None
            right.barh(place + shift, high - low, 0.3, left=low, color=colour, label=bar_label)
    right.set_yticks(range(len(effects)), effects, fontsize=8)
    right.set_xlabel("EAV − CRT over the effect's plausible range")
    right.set_title("b) physics and sensors: θ0/α = 0.35", fontsize=9.5)
    for name, wanted in PAPER.items():
        left.axhline(wanted, color="#a11", lw=0.9, ls=":")
        right.axvline(wanted, color="#a11", lw=0.9, ls=":")
        left.text(CUTOFFS_HZ[-1], wanted, f"paper, {name}", color="#a11", fontsize=8, va="bottom", ha="right")
        right.text(wanted, len(effects) - 0.4, name, color="#a11", fontsize=8, ha="center")
    left.legend(fontsize=8, frameon=False)
    right.legend(fontsize=8, loc="center left", bbox_to_anchor=(0.1, 0.5), edgecolor="none")
    for axes in (left, right):
        axes.grid(color="#e2e2e2", lw=0.6)
        axes.set_axisbelow(True)
    return figure


def main() -> None:
    """Measure, print, draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--figure", type=Path, default=REPOSITORY / "docs" / "images" / "analysis" / "eav-crt.svg"
    )
    parser.add_argument("--json", type=Path, help="write the figures as JSON")
    options = parser.parse_args()
    console = Console(width=150)
    bench = Bench()
    analyses = {level: bench.analyse(ratio, {}, series=True) for level, ratio in LEVELS.items()}
    choices = filter_choices(analyses)
    console.print("EAV from velocity peaks less CRT, of a Housner wall with r = 0.895")
    console.print(choice_table(choices))
    for name, change in crt_choices(analyses["L3"]):
        console.print(f"CRT with {name}: {change:+.4f}")
    with console.status("") as status:
        rows = effect_rows(bench, (*MOTION, *SENSOR), lambda text: status.update(text))
    console.print(effect_table(rows))
    figure = draw(choices, rows)
    figure.savefig(options.figure, metadata={"Date": None})
    console.print(f"drawn to {options.figure}")
    if options.json is not None:
        document = {"choices": [asdict(c) for c in choices], "effects": [asdict(row) for row in rows]}
        options.json.write_text(json.dumps(document, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
