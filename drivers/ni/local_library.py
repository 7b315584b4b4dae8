"""What the driver says of a computer without NI-DAQmx, told without loading the client that needs it."""

from __future__ import annotations

from daq_app.ni_daqmx import ADVICE, NOT_INSTALLED, is_installed
from drivers.protocol import Block, DriverError


def require_ni_daqmx() -> None:
    """Raise `DriverError` where the connection ``local`` cannot be had."""
    if not is_installed():
        raise not_installed()


def not_installed(partial: Block | None = None) -> DriverError:
    """What to say of a computer without NI-DAQmx; `partial` holds samples that are good."""
    return DriverError(NOT_INSTALLED, advice=ADVICE, partial=partial)
