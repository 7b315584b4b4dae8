"""The analysis of a test as files: JSON, CSV tables and a picture."""

from __future__ import annotations

import csv
import io
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from daq_app.cli.analyse.joint import joint_figure, profile_csv
from daq_app.config.shown_text import shortened
from daq_app.config.wording import METHOD_MARKS
from daq_app.runfile.durable import write_whole

if TYPE_CHECKING:
    from daq_app.rocking.analysis.results import TestAnalysis

_SERIES_STEP_S = 0.0025
_SUFFIXES: Final = (
    *(".analysis.json", ".half_cycles.csv", ".restitution.csv", ".signals.csv", ".svg"),
    *(".joint.csv", ".joint.svg"),
)


def output_files(folder: Path, stem: str) -> list[Path]:
    """Every file that `write_outputs` may write."""
    return [folder / f"{stem}{suffix}" for suffix in _SUFFIXES]


def write_outputs(analysis: TestAnalysis, folder: Path, stem: str) -> list[Path]:
    """JSON, half-cycles and points as CSV, signals as CSV and a picture; returns what was written.

    Each file appears whole or not at all.
    """
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(analysis.as_dict(), ensure_ascii=False, allow_nan=False, indent=1)
    written = [_write(folder / f"{stem}.analysis.json", text)]
    if analysis.found:
        written.append(_write(folder / f"{stem}.half_cycles.csv", _cycles_csv(analysis)))
        written.append(_write(folder / f"{stem}.restitution.csv", _points_csv(analysis)))
    if analysis.series is not None:
        written.append(_write(folder / f"{stem}.signals.csv", _series_csv(analysis)))
        written.append(_picture(analysis, folder / f"{stem}.svg"))
    if analysis.joint is not None:
        written.append(_write(folder / f"{stem}.joint.csv", profile_csv(analysis.joint)))
        if analysis.series is not None:
            written.append(_save(joint_figure(analysis), folder / f"{stem}.joint.svg"))
    return written


def _write(path: Path, text: str) -> Path:
    return write_whole(path, text, other_name=True)


def _cycles_csv(analysis: TestAnalysis) -> str:
    out = io.StringIO()
    rows = analysis.as_dict()["half_cycles"]
    writer = csv.DictWriter(out, fieldnames=list(rows[0]))
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()


def _points_csv(analysis: TestAnalysis) -> str:
    out = io.StringIO()
    writer = csv.writer(out)
    writer.writerow(["method", "impact", "first", "last", "r", "sigma"])
    for key, estimate in analysis.estimates.items():
        writer.writerows([key, p.impact, p.first, p.last, p.r, p.sigma] for p in estimate.points)
    return out.getvalue()


def _series_csv(analysis: TestAnalysis) -> str:
    series = analysis.series
    assert series is not None
    step = max(1, round(_SERIES_STEP_S * analysis.rate_hz))
    names = (
        "time_s", "rotation_rad", "velocity_rad_s", "best_rotation_rad", "best_sigma_rad",
        "neutral_axis_m", "contact_m", "twist_rad_per_m",
    )  # fmt: skip
    out = io.StringIO()
    columns = np.column_stack([getattr(series, name)[::step] for name in names])
    np.savetxt(out, columns, delimiter=",", header=",".join(names), comments="", fmt="%.9g")
    return out.getvalue()


def _picture(analysis: TestAnalysis, path: Path) -> Path:
    """Rotation, velocity and r of the test, as SVG."""
    from matplotlib.figure import Figure

    series = analysis.series
    assert series is not None
    figure = Figure(figsize=(10, 8), layout="constrained")
    rotation, velocity, points = figure.subplots(3, 1)
    start = analysis.release_s if math.isfinite(analysis.release_s) else float(series.time_s[0])
    step = max(1, series.time_s.size // 8000)
    time = series.time_s[::step] - start
    alpha = analysis.theory.alpha_rad
    rotation.plot(time, series.rotation_rad[::step] / alpha, lw=0.8, color="tab:blue")
    rotation.set_ylabel("θ/α")
    velocity.plot(time, series.velocity_rad_s[::step], lw=0.8, color="tab:red")
    velocity.set_ylabel(r"$\dot{\theta}$, rad/s")
    velocity.set_xlabel("time from the release, s")
    velocity.sharex(rotation)
    if analysis.found:
        rotation.set_xlim(-1.0, analysis.half_cycles[-1].start_s - start + 1.0)
    cycles = [c for c in analysis.half_cycles if math.isfinite(c.peak_rad)]
    peak_times = [c.start_s - start + (0.0 if c.n == 0 else 0.5 * c.duration_s) for c in cycles]
    rotation.plot(peak_times, [c.peak_rad / alpha for c in cycles], "k.", ms=4)
    impacts = [c for c in analysis.half_cycles[1:] if math.isfinite(c.speed_before_rad_s)]
    velocity.plot([c.start_s - start for c in impacts], [c.speed_before_rad_s for c in impacts], "kx", ms=4)
    for key, method in (("eav", "EAV"), ("crt", "CRT")):
        estimate = analysis.estimates.get(key)
        if estimate is not None and estimate.points:
            points.errorbar(
                [p.impact for p in estimate.points],
                [p.r for p in estimate.points],
                [p.sigma for p in estimate.points],
                fmt=METHOD_MARKS[method], ms=4, lw=0.8, label=f"{method} {estimate.r:.4f}",
            )  # fmt: skip
    points.axhline(analysis.theory.r_max, color="0.5", ls="--", lw=0.8, label="r_max (1.2)")
    points.set_xlabel("impact")
    points.set_ylabel("r")
    points.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False)
    for axes in (rotation, velocity, points):
        axes.grid(alpha=0.3)
    rotation.set_title(shortened(analysis.label, 80), parse_math=False)
    return _save(figure, path)


def _save(figure: Any, path: Path) -> Path:
    picture = io.StringIO()
    figure.savefig(picture, format="svg")
    return write_whole(path, picture.getvalue(), other_name=True)
