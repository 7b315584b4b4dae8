"""The score of a blind check as a page: HTML with its pictures inside, or Markdown with them beside it."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from daq_app.campaign.pages import page_environment
from daq_app.gap.blind.scoring.judge import Judged
from daq_app.gap.blind.scoring.score import Score, claims, confusion
from daq_app.gap.blind.scoring.statistics import number, reliability
from daq_app.runfile.durable import write_whole


def write_report(score: Score, path: Path) -> None:
    """Write the page as HTML with the pictures inside."""
    template = page_environment("daq_app.gap").get_template("blind_score.html")
    text = template.render(
        n=len(score.judged),
        waiting=score.waiting,
        rows=score.rows,
        pictures=[(title, note, base64.b64encode(data).decode()) for title, note, data in _pictures(score)],
        wrong=[j for j in score.judged if not j.answered_rightly],
        number=number,
    )
    write_whole(path, text)


def write_markdown(score: Score, path: Path) -> None:
    """Write the page as Markdown; its pictures lie beside it in ``images/``, named after it."""
    met = {True: "met", False: "**missed**", None: ""}
    lines = [
        f"# Blind check: {len(score.judged)} cases with a result, {len(score.waiting)} still without",
        "",
        "Every label was opened after the diagnosis and agreed with its seal. Intervals are 95 %.",
        "",
        "| score | found | 95 % interval | cases | target | |",
        "|---|---|---|---|---|---|",
        *(f"| {' | '.join(row.cells)} | {met[row.met]} |" for row in score.rows),
    ]
    images = path.parent / "images"
    images.mkdir(parents=True, exist_ok=True)
    for title, note, data in _pictures(score):
        name = f"{path.stem}-{title.split()[0].lower()}.png"
        write_whole(images / name, data)
        lines += ["", f"## {title}", "", note, "", f"![{title}](images/{name})"]
    lines += ["", "## Cases that were answered wrongly", ""]
    lines += ["| case | hidden | strength, sd | decision | named first | p |", "|---|---|---|---|---|---|"]
    lines += [
        f"| {j.case} | {' + '.join(j.truth) or 'nothing'} | {number(j.strength)} | {j.decision} | "
        f"{' + '.join(j.named)} | {number(j.claimed)} |"
        for j in score.judged
        if not j.answered_rightly
    ]
    write_whole(path, "\n".join(lines) + "\n")


def _pictures(score: Score) -> list[tuple[str, str, bytes]]:
    """(title, what it shows, PNG)."""
    return [
        (
            "Confusion matrix",
            "Rows: what was hidden. Columns: what was answered; decisions that name nothing in brackets.",
            _picture(lambda axes: _draw_confusion(axes, score), (13.0, 12.0)),
        ),
        (
            "Reliability",
            "Claimed probability of the first answer against how often it was right.",
            _picture(lambda axes: _draw_reliability(axes, score), (6.0, 6.0)),
        ),
        (
            "Closure by effect",
            "Share of the reachable held-out score that was gained, each case a dot.",
            _picture(lambda axes: _draw_closure(axes, score), (9.0, 9.0)),
        ),
    ]


def _picture(draw: Callable[[Axes], None], size: tuple[float, float]) -> bytes:
    figure = Figure(figsize=size, layout="constrained")
    draw(figure.add_subplot())
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=80)
    return buffer.getvalue()


def _draw_confusion(axes: Axes, score: Score) -> None:
    counts = confusion(score.judged)
    truths, answers = (sorted(set(names)) for names in zip(*counts, strict=True)) if counts else ([], [])
    grid = np.zeros((max(1, len(truths)), max(1, len(answers))))
    for (truth, answer), count in counts.items():
        grid[truths.index(truth), answers.index(answer)] = count
    axes.imshow(grid, cmap="Blues", aspect="auto", vmax=1.3 * grid.max() or 1.0)
    for (truth, answer), count in counts.items():
        column, row = answers.index(answer), truths.index(truth)
        ink = "white" if count > 0.5 * grid.max() else "black"
        axes.text(column, row, str(count), ha="center", va="center", fontsize=7, color=ink)
    axes.set_xticks(range(len(answers)), answers, rotation=90, fontsize=7)
    axes.set_yticks(range(len(truths)), truths, fontsize=7)
    axes.set_xlabel("answer")
    axes.set_ylabel("hidden")


def _draw_reliability(axes: Axes, score: Score) -> None:
    claimed, right = claims(score.judged)
    axes.plot([0, 1], [0, 1], color="grey", linewidth=1)
    for bar in reliability(claimed, right):
        below, above = bar.found.value - bar.found.low, bar.found.high - bar.found.value
        axes.errorbar(
            bar.claimed,
            bar.found.value,
            yerr=[[max(0.0, below)], [max(0.0, above)]],
            fmt="o",
            color="C0",
            capsize=3,
        )
        axes.annotate(
            str(bar.found.n), (bar.claimed, bar.found.value), xytext=(6, -10), textcoords="offset points"
        )
    axes.set(xlim=(0, 1.02), ylim=(0, 1.02), xlabel="claimed probability", ylabel="share that was right")


def _draw_closure(axes: Axes, score: Score) -> None:
    groups: dict[str, list[Judged]] = {}
    for j in score.judged:
        if j.category == "single" and math.isfinite(j.closure):
            groups.setdefault(j.truth[0], []).append(j)
    names = sorted(groups, reverse=True)
    for row, name in enumerate(names):
        for j in groups[name]:
            axes.plot(j.closure, row, "o" if j.first_right else "x", color="C0" if j.first_right else "C3")
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.axvline(1.0, color="grey", linewidth=1)
    axes.axvline(0.9, color="grey", linewidth=1, linestyle=":")
    axes.set_xlim(-0.1, 1.15)
    axes.set_xlabel("closure (cross: named wrongly)")
