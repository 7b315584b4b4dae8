"""A planned figure drawn by whatever process is free: only there is loaded what draws."""

from __future__ import annotations

from daq_app.campaign.report.planned_figures import DrawnFigure, PlannedFigure


def drawn(planned: PlannedFigure) -> DrawnFigure:
    """The figure, drawn in the process that calls this."""
    from daq_app.campaign.report.drawing import draw

    return draw(planned)
