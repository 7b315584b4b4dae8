"""The one-page report of a diagnosis: HTML with its pictures inside, and the same page as PDF."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure

from daq_app.campaign.captioned import CaptionedFigure
from daq_app.campaign.pages import page_environment
from daq_app.gap import report_figures as draw
from daq_app.gap.core import Diagnosis
from daq_app.gap.report_figures import ProbeMap
from daq_app.gap.rocking_model.library import rocking_library
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.traces import Trace, noted, traces
from daq_app.gap.words import causes_in_words, closed_share, gap_goes
from daq_app.runfile.durable import write_whole

_A4_IN: Final = (8.27, 11.69)
_LISTED: Final = 6
"""Parameters in the PDF; the HTML has all."""


def write_report(result: Diagnosis, path: Path, runs: Sequence[GapRun] = ()) -> list[Path]:
    """Write `path` (HTML) and the same page as PDF beside it; returns both. Raises `OSError`.

    `runs` are the recordings that were diagnosed: with them the page has measured against
    simulated rotations, which the result's notes hold from then on.
    """
    shown = traces(result, runs)
    result.notes["traces"] = noted(shown)
    maps = draw.probe_maps(result, _meanings())
    html = (
        page_environment("daq_app.gap")
        .get_template("gap.html")
        .render(
            d=result,
            verdict=_verdict(result),
            causes=_causes(result),
            goes=gap_goes,
            closed=closed_share,
            estimates=(*result.effect_parameters, *result.parameters),
            pictures=_pictures(result, shown, maps),
        )
    )
    return [
        write_whole(path, html.encode("utf-8"), other_name=True),
        write_whole(path.with_suffix(".pdf"), _pdf(result, shown, maps), other_name=True),
    ]


def _verdict(result: Diagnosis) -> str:
    return result.decision.verdict.replace("_", " ")


def _causes(result: Diagnosis) -> tuple[str, ...]:
    return causes_in_words(asdict(cause) for cause in result.causes)


def _meanings() -> dict[str, str]:
    """What each parameter of a probe means."""
    return {
        probe.key(parameter): parameter.meaning
        for probe in rocking_library().probes
        for parameter in probe.parameters
    }


def _pictures(result: Diagnosis, shown: Sequence[Trace], maps: Sequence[ProbeMap]) -> Mapping[str, str]:
    where, (before, after) = _grid(5.2, 0.9 + 0.22 * len(draw.map_axes(result.where)[0]), 1, 2)
    draw.draw_maps(before, after, result)
    evidence, (axes,) = _grid(5.2, 2.6, 1, 1)
    draw.draw_evidence(draw.bare(axes), result)
    pictures = {"map": _svg("gap_map", where), "evidence": _svg("gap_evidence", evidence)}
    if shown:
        figure = Figure(figsize=(10.6, 3.9), layout="constrained")
        _draw_traces(figure, result, shown)
        pictures["traces"] = _svg("gap_traces", figure)
    if result.gap is not None:
        figure, (axes,) = _grid(5.2, 2.6, 1, 1)
        draw.draw_closure(draw.bare(axes), result)
        pictures["closure"] = _svg("gap_closure", figure)
    if maps:
        rows = -(-len(maps) // 2)
        figure, panels = _grid(5.2, 1.9 * rows, rows, min(2, len(maps)))
        _draw_maps(panels, maps)
        pictures["probes"] = _svg("gap_probes", figure)
    return pictures


def _draw_traces(figure: Any, result: Diagnosis, shown: Sequence[Trace]) -> None:
    panels = figure.subplots(2, len(shown), squeeze=False, height_ratios=(2.0, 1.0))
    for column, trace in enumerate(shown):
        name = result.in_words(result.best)
        draw.draw_trace(panels[0, column], panels[1, column], trace, name)


def _draw_maps(panels: Sequence[Any], maps: Sequence[ProbeMap]) -> None:
    for axes, probe in zip(panels, maps, strict=False):
        probe.draw(draw.bare(axes))
    for axes in panels[len(maps) :]:
        axes.set_visible(False)


def _grid(width: float, height: float, rows: int, columns: int) -> tuple[Figure, list[Any]]:
    figure = Figure(figsize=(width, max(height, 1.6)), layout="constrained")
    return figure, list(figure.subplots(rows, columns, squeeze=False).ravel())


def _svg(name: str, figure: Figure) -> str:
    return CaptionedFigure(name, figure, "").svg


def _pdf(result: Diagnosis, shown: Sequence[Trace], maps: Sequence[ProbeMap]) -> bytes:
    """Everything on one A4 page."""
    page = Figure(figsize=_A4_IN, layout="constrained")
    page.get_layout_engine().set(rect=(0.03, 0.015, 0.94, 0.97))  # type: ignore[union-attr, call-arg]
    parts: Any = page.subfigures(5, 1, height_ratios=(1.6, 2.2, 3.0 if shown else 0.01, 3.0, 1.65))
    _write_head(parts[0], result)
    left, right = parts[1].subfigures(1, 2)
    left.suptitle("Where: largest gap, 1 is noise and scatter", fontsize=9, weight="bold")
    right.suptitle("Which: evidence", fontsize=9, weight="bold")
    before, after = left.subplots(1, 2)
    draw.draw_maps(before, after, result)
    draw.draw_evidence(draw.bare(right.subplots()), result)
    if shown:
        parts[2].suptitle("Measured and simulated rotation", fontsize=9, weight="bold")
        _draw_traces(parts[2], result, shown)
    left, right = parts[3].subfigures(1, 2, width_ratios=(1.0, 2.1))
    if result.gap is not None:
        left.suptitle("How far: held-out gap", fontsize=9, weight="bold")
        draw.draw_closure(draw.bare(left.subplots()), result)
    if maps:
        right.suptitle("Maps of the free forms", fontsize=9, weight="bold")
        rows = -(-len(maps) // 2)
        panels = right.subplots(rows, min(2, len(maps)), squeeze=False).ravel()
        _draw_maps(list(panels), maps)
    _write_parameters(parts[4], result)
    buffer = io.BytesIO()
    with PdfPages(buffer, metadata={"Title": f"Sim-to-real gap: {_verdict(result)}"}) as pages:
        pages.savefig(page)
    return buffer.getvalue()


def _write_head(part: Any, result: Diagnosis) -> None:
    part.text(0.04, 0.93, f"Sim-to-real gap: {_verdict(result)}", fontsize=14, weight="bold", va="top")
    lines = _wrapped(result.decision.sentence)
    if causes := _causes(result):
        lines += _wrapped(f"In words: {'; '.join(causes)}.")
    lines += _wrapped(f"Where: {result.where.sentence}")
    if (gap := result.gap) is not None:
        lines += _wrapped(
            f"How far: the held-out gap {gap_goes(gap.before, gap.after)} times noise and scatter (floor "
            f"{gap.floor:.1f}); {closed_share(gap.closure)} of what could be gained was gained."
        )
    lines += _wrapped(f"Measure next: {result.next_measurement}")
    for limit in result.limits:
        lines += _wrapped(f"Limit: {limit}")
    part.text(0.04, 0.74, "\n".join(lines[:9]), fontsize=8.5, va="top", linespacing=1.35, parse_math=False)


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, 125) or [""]


def _write_parameters(part: Any, result: Diagnosis) -> None:
    """The parameters of the effect, then those of the wall."""
    estimates = (*result.effect_parameters, *result.parameters)[:_LISTED]
    axes = part.subplots()
    axes.axis("off")
    cells = [
        [p.name, f"{p.value:.5g}", f"{p.low:.5g} … {p.high:.5g}", p.unit, p.meaning[:48]] for p in estimates
    ]
    table = axes.table(
        cellText=cells,
        colLabels=["parameter", "value", "95 % interval", "unit", "meaning"],
        loc="upper left",
        cellLoc="left",
        edges="horizontal",
        colWidths=(0.24, 0.12, 0.22, 0.08, 0.34),
    )
    table.auto_set_font_size(False)
    table.set_fontsize(7)
    runs = ", ".join(result.runs)
    part.text(
        0.04,
        0.02,
        textwrap.shorten(f"Runs: {runs}. What remains: {result.remaining.sentence}", 150),
        fontsize=7,
        parse_math=False,
    )
