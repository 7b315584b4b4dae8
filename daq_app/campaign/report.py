"""The campaign report: HTML with SVG pictures, PDF, and CSV of every number."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
from jinja2 import Environment, PackageLoader, select_autoescape
from matplotlib.figure import Figure

from daq_app.campaign import figures, tables
from daq_app.campaign.collect import Failure
from daq_app.campaign.report_pdf import interval, number, report_pdf, signed
from daq_app.campaign.status import CampaignStatus
from daq_app.campaign.summary import TestSummary


@dataclass(frozen=True, slots=True)
class CaptionedFigure:
    """A figure with the file name it is saved under and its caption."""

    name: str
    figure: Figure
    caption: str

    @property
    def svg(self) -> str:
        """The picture as an SVG element that can stand inside a page."""
        buffer = io.StringIO()
        # A fixed salt makes the file depend on the data alone.
        with mpl.rc_context({"svg.fonttype": "path", "svg.hashsalt": self.name}):
            self.figure.savefig(buffer, format="svg", metadata={"Date": None})
        text = buffer.getvalue()
        return text[text.index("<svg") :]


def campaign_figures(tests: Sequence[TestSummary]) -> list[CaptionedFigure]:
    """Figures 4.1 to 4.4; 4.1 and 4.3 once per specimen for its level with most tests."""
    found: list[CaptionedFigure] = []
    specimens = list(dict.fromkeys(test.specimen for test in tests))
    richest = {specimen: _richest_level(tests, specimen) for specimen in specimens}
    for specimen, level in richest.items():
        own = [t for t in tests if (t.specimen, t.level) == (specimen, level)]
        caption = f"Figure 4.1: rotation and angular velocity of {specimen}-{level}; dashed: the repetition"
        picture = figures.histories(own, f"{specimen}-{level}")
        found.append(CaptionedFigure(f"figure_4_1_{specimen}_{level}", picture, caption))
    found.append(
        CaptionedFigure(
            "figure_4_2",
            figures.period_against_amplitude(tests),
            "Figure 4.2: period against peak rotation, measured and theory (4.1)",
        )
    )
    for specimen, level in richest.items():
        own = [t for t in tests if (t.specimen, t.level) == (specimen, level)]
        caption = f"Figure 4.3: periods Tₙ and rotations φₙ of {specimen}-{level} against the impact n"
        picture = figures.decay(own, f"{specimen}-{level}")
        found.append(CaptionedFigure(f"figure_4_3_{specimen}_{level}", picture, caption))
    found.append(
        CaptionedFigure(
            "figure_4_4",
            figures.restitution_by_level(tests),
            "Figure 4.4: r by level from classic theory (CRT) and from experimental evidence (EAV); "
            "bars: 95 % of the test's own error",
        )
    )
    return found


def _richest_level(tests: Sequence[TestSummary], specimen: str) -> str:
    """The level with most good tests; of equals the one of larger rotation, as the paper shows L3."""
    own = [test for test in tests if test.specimen == specimen]
    return max(
        {test.level for test in own},
        key=lambda level: (sum(t.good for t in own if t.level == level), level),
    )


def write_report(
    folder: Path,
    title: str,
    status: CampaignStatus,
    tests: Sequence[TestSummary],
    footer: str = "",
    failures: Sequence[Failure] = (),
) -> list[Path]:
    """Write ``report.html``, ``report.pdf``, the CSV files and each figure as SVG into `folder`.

    `failures` are runs that could not be analysed: they are named. Returns the files written. Raises
    `ValueError` if there is no analysed test at all.
    """
    if not tests:
        raise ValueError("no run of this campaign could be analysed: there is nothing to report")
    folder.mkdir(parents=True, exist_ok=True)
    places = tables.table_3_2(status)
    restitution = tables.table_4_1(tests)
    restitution += tables.mean_of_specimens(restitution)
    repetitions = tables.repetition_effect(tests)
    pictures = campaign_figures(tests)
    drawn = {}
    for picture in pictures:
        drawn[picture.name] = picture.svg
        # Drawn once, everything has its place: the PDF does not look for it again.
        picture.figure.set_layout_engine(None)
    written = tables.write_csv(folder, places, tests, restitution, repetitions)
    for picture in pictures:
        path = folder / f"{picture.name}.svg"
        path.write_text('<?xml version="1.0" encoding="utf-8"?>\n' + drawn[picture.name], encoding="utf-8")
        written.append(path)
    good = sum(test.good for test in tests)
    html = (
        _environment()
        .get_template("campaign.html")
        .render(
            title=title,
            subtitle=f"{len(tests)} runs analysed, {good} of them in the means",
            places=places,
            tests=tests,
            restitution=restitution,
            repetitions=repetitions,
            figures=pictures,
            drawn=drawn,
            methods=[m for m in tables.METHODS if any(m in t.methods for t in tests)],
            left_out=[test for test in tests if not test.good],
            failures=failures,
            footer=footer,
        )
    )
    written += [
        _replace(folder / "report.html", html.encode()),
        _replace(
            folder / "report.pdf",
            report_pdf(
                title,
                [(picture.figure, picture.caption) for picture in pictures],
                places,
                restitution,
                repetitions,
                tests,
                failures,
            ),
        ),
    ]
    return written


def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("daq_app.campaign"), autoescape=select_autoescape(), trim_blocks=True
    )
    environment.filters["number"] = number
    environment.filters["signed"] = signed
    environment.filters["interval"] = interval
    return environment


def _replace(path: Path, content: bytes) -> Path:
    """Whole or not at all: a reader never sees half a report."""
    part = path.with_name(path.name + ".tmp")
    part.write_bytes(content)
    part.replace(path)
    return path
