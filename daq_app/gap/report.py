"""The one-page report of a diagnosis as HTML with its pictures inside."""

from __future__ import annotations

import base64
import io
from pathlib import Path
from typing import Any

from jinja2 import Environment
from matplotlib.figure import Figure

from daq_app.gap.core import Diagnosis

_PAGE = """<!doctype html><html lang="en"><meta charset="utf-8"><title>Sim-to-real gap</title>
<style>body{font:15px/1.45 sans-serif;max-width:1060px;margin:2em auto;padding:0 1em;color:#222}
h1{font-size:1.35em}h2{font-size:1.05em;margin-top:1.6em}table{border-collapse:collapse}
td,th{padding:.2em .8em;border-bottom:1px solid #ddd;text-align:left}
.verdict{background:#eef4fb;padding:.8em 1em}
img{max-width:100%}.limit{color:#8a4b00}</style>
<h1>Sim-to-real gap: {{ d.decision.verdict | replace("_", " ") }}</h1>
<p class="verdict"><b>{{ d.decision.sentence }}</b><br>{{ d.where.sentence }}<br>
{% if d.gap %}On runs that were not used for the fit the gap falls from {{ "%.2f"|format(d.gap.before) }} to
{{ "%.2f"|format(d.gap.after) }} times noise and scatter (floor {{ "%.1f"|format(d.gap.floor) }}); closure
{{ "%.0f"|format(100 * d.gap.closure) }} %.<br>{% endif %}
Next: {{ d.next_measurement }}</p>
{% for limit in d.limits %}<p class="limit">{{ limit }}</p>{% endfor %}
<h2>Where: size of the gap before and after, in units of noise and scatter</h2><img src="{{ where }}">
<h2>Which: evidence of each hypothesis relative to the best</h2><img src="{{ evidence }}">
{% if closure %}<h2>How far: held-out gap per level</h2><img src="{{ closure }}">{% endif %}
{% if probes %}<h2>What the free forms of each family found</h2><img src="{{ probes }}">{% endif %}
<h2>Parameters</h2><table><tr><th>name<th>value<th>95 % interval<th>unit<th>meaning</tr>
{% for p in estimates %}<tr><td>{{ p.name }}<td>{{ "%.5g"|format(p.value) }}
<td>{{ "%.5g"|format(p.low) }} … {{ "%.5g"|format(p.high) }}
<td>{{ p.unit }}<td>{{ p.meaning }}</tr>{% endfor %}
</table>
<h2>What remains</h2><p>{{ d.remaining.sentence }}
Goodness of fit: {{ "passed" if d.goodness.passed else "failed" }}
({{ d.goodness.worst }}).</p>
<p>Runs: {{ d.runs | join(", ") }}. {{ "%.1f"|format(d.seconds) }} s.</p></html>
"""


def write_report(result: Diagnosis, path: Path) -> None:
    """Write the report; pictures are part of the file."""
    page = Environment(autoescape=True).from_string(_PAGE)
    html = page.render(
        d=result,
        where=_where(result),
        evidence=_evidence(result),
        closure=_closure(result),
        probes=_probes(result),
        estimates=(*result.effect_parameters, *result.parameters),
    )
    path.write_text(html, encoding="utf-8")


def _image(figure: Figure) -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")


def _axes(width: float, height: float) -> tuple[Figure, Any]:
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots()


def _where(result: Diagnosis, most: int = 14) -> str:
    after = {(c.channel, c.phase, c.observable): c.in_noise for c in result.remaining.cells}
    cells = result.where.cells[:most][::-1]
    figure, axes = _axes(9.5, 0.6 + 0.28 * len(cells))
    names = [f"{c.observable} · {c.channel} · {c.phase}" for c in cells]
    rows = range(len(cells))
    axes.barh(rows, [c.in_noise for c in cells], color="#c7d7ea", label="before")
    axes.barh(
        rows,
        [after.get((c.channel, c.phase, c.observable), 0.0) for c in cells],
        0.4,
        color="#d1495b",
        label="after",
    )
    axes.set_yticks(list(rows), names, fontsize=8)
    axes.axvline(1.0, color="k", lw=0.8, ls=":")
    axes.set_xlabel("rms over noise and scatter")
    axes.legend(fontsize=8)
    return _image(figure)


def _evidence(result: Diagnosis, most: int = 10) -> str:
    ranked = sorted(result.which, key=lambda r: -r.log_evidence)[:most][::-1]
    best = ranked[-1].log_evidence
    figure, axes = _axes(9.5, 0.6 + 0.28 * len(ranked))
    axes.barh(range(len(ranked)), [max(r.log_evidence - best, -60.0) for r in ranked], color="#7a9cc6")
    names = [" + ".join(r.effects) or "nothing missing" for r in ranked]
    axes.set_yticks(range(len(ranked)), names, fontsize=8)
    axes.set_xlabel("log evidence less that of the best (cut at −60)")
    return _image(figure)


def _closure(result: Diagnosis) -> str:
    if result.gap is None:
        return ""
    levels = list(result.gap.per_level)
    figure, axes = _axes(7.0, 2.6)
    place = range(len(levels))
    axes.bar([k - 0.2 for k in place], [result.gap.per_level[k][0] for k in levels], 0.38, label="before")
    axes.bar([k + 0.2 for k in place], [result.gap.per_level[k][1] for k in levels], 0.38, label="after")
    axes.axhline(result.gap.floor, color="k", lw=0.8, ls=":", label="floor")
    axes.set_xticks(list(place), levels)
    axes.set_ylabel("gap")
    axes.legend(fontsize=8)
    return _image(figure)


def _probes(result: Diagnosis) -> str:
    shapes = {name: shape for name, shape in result.probe_shapes.items() if shape}
    if not shapes:
        return ""
    columns = min(len(shapes), 4)
    rows = -(-len(shapes) // columns)
    figure = Figure(figsize=(2.6 * columns, 2.2 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes, (name, shape) in zip(grid.flat, shapes.items(), strict=False):
        values = list(shape.values())
        middle = [v for v, _, _ in values]
        errors = [[v - low for v, low, _ in values], [high - v for v, _, high in values]]
        axes.errorbar(range(len(values)), middle, yerr=errors, fmt="o-", ms=3, lw=1)
        axes.axhline(0.0, color="k", lw=0.6)
        axes.set_title(name, fontsize=8)
        axes.tick_params(labelsize=7)
    for axes in list(grid.flat)[len(shapes) :]:
        axes.set_visible(False)
    return _image(figure)
