"""Runs on disk: the journal, the HDF5 run file, and what checks, mends and converts them."""

from daq_app.runfile.errors import (
    BusyError,
    JournalDeviceError,
    JournalDiskFull,
    JournalError,
    JournalSlowDisk,
    RunFileError,
)
from daq_app.runfile.folder import JOURNAL_SUFFIX, RUN_SUFFIX
from daq_app.runfile.hdf5.read import Run, open_run
from daq_app.runfile.integrity.recovery import Recovery, recover
from daq_app.runfile.integrity.saving import finalise
from daq_app.runfile.integrity.verification import VerifyReport, verify
from daq_app.runfile.journal.flusher import Flusher, idle_flusher
from daq_app.runfile.journal.locks import FolderLock
from daq_app.runfile.journal.read import JournalContents, read_journal
from daq_app.runfile.journal.writer import JournalWriter
from daq_app.runfile.model import (
    DerivedData,
    DerivedSignal,
    Event,
    Gap,
    RunHeader,
    host_name,
    plan_to_dict,
    software_versions,
)
from daq_app.runfile.source import rig_of
from daq_app.runfile.test_plan import CheckFinding, CheckRecord, TestPlan

__all__ = [
    "JOURNAL_SUFFIX",
    "RUN_SUFFIX",
    "BusyError",
    "CheckFinding",
    "CheckRecord",
    "DerivedData",
    "DerivedSignal",
    "Event",
    "Flusher",
    "FolderLock",
    "Gap",
    "JournalContents",
    "JournalDeviceError",
    "JournalDiskFull",
    "JournalError",
    "JournalSlowDisk",
    "JournalWriter",
    "Recovery",
    "Run",
    "RunFileError",
    "RunHeader",
    "TestPlan",
    "VerifyReport",
    "finalise",
    "host_name",
    "idle_flusher",
    "open_run",
    "plan_to_dict",
    "read_journal",
    "recover",
    "rig_of",
    "software_versions",
    "verify",
]
