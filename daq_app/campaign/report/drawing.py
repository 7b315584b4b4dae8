"""Draws a planned figure once and saves it in both formats: its layout is half of the work."""

from __future__ import annotations

import matplotlib as mpl
import matplotlib.backends.backend_svg  # else loaded with the first picture of each process
from matplotlib.figure import Figure

from daq_app.campaign.captioned import PLAIN_TEXT, CaptionedFigure
from daq_app.campaign.report import figures
from daq_app.campaign.report.pdf import figure_page
from daq_app.campaign.report.planned_figures import DrawnFigure, PlannedFigure


def draw(planned: PlannedFigure) -> DrawnFigure:
    """The figure as SVG and as a page of the PDF."""
    with mpl.rc_context(PLAIN_TEXT):
        picture = CaptionedFigure(planned.name, _figure(planned), planned.caption)
        return DrawnFigure(picture.name, picture.caption, picture.svg, figure_page(picture))


def _figure(planned: PlannedFigure) -> Figure:
    match planned.number:
        case "4.1":
            return figures.histories(planned.tests, planned.title)
        case "4.2":
            return figures.period_against_amplitude(planned.tests)
        case "4.3":
            return figures.decay(planned.tests, planned.title)
        case "4.4":
            return figures.restitution_by_level(planned.tests)
