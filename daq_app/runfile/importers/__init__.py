"""Foreign recordings into runs."""

from daq_app.runfile.importers.import_file import ImportReport, import_file
from daq_app.runfile.importers.import_map import ImportMap, load_import_map

__all__ = ["ImportMap", "ImportReport", "import_file", "load_import_map"]
