"""The acquisition process: reads, records, watches the course of a test, publishes to viewers."""

from daq_app.acquisition.viewers.client import AcquisitionClient, AcquisitionUnreachable, Received
from daq_app.acquisition.viewers.launcher import AcquisitionDied, AcquisitionProcess
from daq_app.acquisition.viewers.session_file import SessionFile, read_session_file

__all__ = [
    "AcquisitionClient",
    "AcquisitionDied",
    "AcquisitionProcess",
    "AcquisitionUnreachable",
    "Received",
    "SessionFile",
    "read_session_file",
]
