"""Foreign recordings into runs."""

from daq_app.runfile.importers.import_file import ImportReport, import_file
from daq_app.runfile.importers.import_map import ImportMap, load_import_map
from daq_app.runfile.importers.proposal import Proposal, propose_map

__all__ = ["ImportMap", "ImportReport", "Proposal", "import_file", "load_import_map", "propose_map"]
