"""Runs in the formats of other programs."""

from daq_app.runfile.exporters.export import FORMATS, ExportFormat, export_run
from daq_app.runfile.exporters.results import Decimal
from daq_app.runfile.exporters.selection import Selection, Units

__all__ = ["FORMATS", "Decimal", "ExportFormat", "Selection", "Units", "export_run"]
