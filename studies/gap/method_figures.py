"""The pictures of docs/explanation/gap-method.md: stages of a diagnosis, features of a half-cycle.

python -m studies.gap.method_figures FOLDER
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch

from daq_app.gap.rocking_model.motion.swings import FRACTIONS
from sim_hardware.dynamics import Body, Release, Restitution, simulate_motion
from tests.support.gap.simulated_campaign import RIG, quick_rig

STAGES = (
    ("runs", "41 channels\nof each release"),
    ("inspection", "faults of instruments\nare measured and\ntaken out"),
    ("features", "swings from peak to\npeak; every channel\nagainst the rotation"),
    ("hypotheses", "each effect on top of\nthe model; up to three;\nsizes of all scatter"),
    ("what remains", "free forms, and the\nshare of the gap that\nis left"),
    ("answer", "findings, causes,\nclosure on runs that\nwere held out"),
)
INK, SOFT, MARK = "#1f3044", "#e8eef4", "#c44e28"


def draw_stages(axes: Axes) -> None:
    axes.set(xlim=(-0.1, 2 * len(STAGES) - 0.1), ylim=(0, 1.5))
    axes.axis("off")
    for k, (title, text) in enumerate(STAGES):
        left = 2.0 * k
        axes.add_patch(
            FancyBboxPatch((left, 0.1), 1.62, 1.3, boxstyle="round,pad=0.02", facecolor=SOFT, edgecolor=INK)
        )
        axes.text(left + 0.81, 1.18, title, ha="center", va="center", weight="bold", color=INK, size=9.5)
        axes.text(left + 0.81, 0.6, text, ha="center", va="center", color=INK, size=7.5, linespacing=1.35)
        if k:
            axes.annotate(
                "", (left - 0.03, 0.75), (left - 0.35, 0.75), arrowprops={"arrowstyle": "->", "color": INK}
            )


def draw_half_cycle(axes: Axes) -> None:
    """θ(t) of the shipped wall around one half-cycle, with what is read from it."""
    rig = quick_rig(RIG)
    body = Body.from_specimen(rig.specimen)
    motion = simulate_motion(body, Release(0.4 * body.alpha_rad), Restitution(body.r_max))
    first, last = motion.impact_time_s[0], motion.impact_time_s[1]
    span = last - first
    time = np.linspace(first - 0.45 * span, last + 0.45 * span, 2000)
    theta = 1e3 * motion.rotation(time)
    axes.plot(time, theta, color=INK, lw=1.4)
    axes.axhline(0, color="0.6", lw=0.7)
    inside = (time > first) & (time < last)
    top = int(np.flatnonzero(inside)[np.argmax(np.abs(theta[inside]))])
    peak, side = theta[top], np.sign(theta[top])
    for fraction in FRACTIONS:
        level = fraction * peak
        above = np.flatnonzero(inside & (side * theta > side * level))
        axes.plot(time[above[[0, -1]]], [level, level], "o", color=MARK, ms=4.5)
        axes.text(last + 0.03 * span, level, f"{fraction:g} of the peak", va="center", color=MARK, size=8.5)
    axes.plot(time[top], peak, "s", color=MARK, ms=6)
    axes.text(time[top], 1.1 * peak, "next peak", ha="center", va="center", color=MARK, size=8.5)
    low = FRACTIONS[-1] * peak
    before = np.flatnonzero((time < first) & (side * theta < -side * low))
    after = np.flatnonzero(inside & (side * theta > side * low))
    ends = (time[before[-1]], time[after[0]])
    axes.annotate("", (ends[0], -1.25 * low), (ends[1], -1.25 * low), arrowprops={"arrowstyle": "<->"})
    axes.text(ends[1] + 0.02 * span, -1.35 * low, "time across the impact", va="center", size=8.5)
    over = np.flatnonzero(inside & (side * theta > side * FRACTIONS[0] * peak))
    axes.annotate(
        "", (time[over[0]], 0.8 * peak), (time[over[-1]], 0.8 * peak), arrowprops={"arrowstyle": "<->"}
    )
    axes.text(time[top], 0.74 * peak, "time over the top", ha="center", va="center", size=8.5)
    axes.set(xlabel="time after the release, s", ylabel="rotation, mrad")
    axes.margins(y=0.12)
    axes.spines[["top", "right"]].set_visible(False)


def main() -> None:
    parser = argparse.ArgumentParser(description="Draw the pictures of the page on the method.")
    parser.add_argument("folder", type=Path)
    folder: Path = parser.parse_args().folder
    mpl.use("Agg")
    folder.mkdir(parents=True, exist_ok=True)
    for name, size, draw in (
        ("gap-stages.png", (10.0, 1.7), draw_stages),
        ("gap-half-cycle.png", (8.0, 3.8), draw_half_cycle),
    ):
        figure, axes = plt.subplots(figsize=size, layout="constrained")
        draw(axes)
        figure.savefig(folder / name, dpi=130)
        plt.close(figure)


if __name__ == "__main__":
    main()
