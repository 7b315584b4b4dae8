"""What must hold before a test is armed: room on the disk, the right modules in the slots, a good name."""

from __future__ import annotations

import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from daq_app.acquisition.messages.items import RequestRefused
from daq_app.config.hardware import catalogue
from daq_app.config.hardware.comparison import wrong_module
from daq_app.config.hardware.own_products import own_products
from daq_app.config.rig import Rig
from drivers import DeviceInfo

_BYTES_PER_READING: Final = 8
_COPIES: Final = 3.0
"""Journal, run file being written, and a little: the journal goes only after the run is proven."""
_HOLD_ALLOWANCE_S: Final = 600.0
"""Time between arming and release that a pull by hand may take."""
LOW_SPACE_BYTES: Final = 200 * 2**20
"""Below this while running the operator hears of it."""
_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,59}")


def needed_bytes(rig: Rig, rate_hz: float) -> int:
    """Room for the longest run that may follow from arming now."""
    settings = rig.acquisition
    longest_s = _HOLD_ALLOWANCE_S + settings.max_duration_s + settings.post_rest_s
    return int(_COPIES * _BYTES_PER_READING * len(rig.channels) * rate_hz * longest_s)


def check_space(folder: Path, rig: Rig, rate_hz: float) -> None:
    """Raise `RequestRefused` unless the disk holds the longest run."""
    need = needed_bytes(rig, rate_hz)
    try:
        free = shutil.disk_usage(folder).free
    except OSError as error:
        raise RequestRefused(f"{folder} cannot be used ({error.strerror}). Choose another folder") from error
    if free < need:
        raise RequestRefused(
            f"{folder} has {free / 1e9:.2f} GB free and the longest run that may follow needs "
            f"{need / 1e9:.2f} GB. Free space, choose another disk, or lower acquisition.max_duration_s"
        )


def check_name(test: str) -> str:
    """A test's name that can be part of a file's name. Raises `RequestRefused`."""
    if not _NAME.fullmatch(test):
        raise RequestRefused(
            f"'{test[:60]}' is no name of a test: letters, digits, '-', '_' and '.', for instance FR1-L3-2"
        )
    return test


def check_modules(rig: Rig, devices: Sequence[DeviceInfo]) -> list[str]:
    """One sentence for each module that is not what the rig file says; empty if all are."""
    device_by_name = {device.name: device for device in devices}
    wrong = []
    for chassis in rig.hardware.chassis:
        bus = catalogue.chassis(chassis.product, own_products(rig.hardware).chassis).bus
        for module in chassis.modules:
            name = module.name or catalogue.device_name(chassis.name, bus, module.slot)
            device = device_by_name.get(name)
            if device is None:
                continue  # no channel uses it, so it was not opened
            if sentence := wrong_module(name, module, device):
                wrong.append(sentence)
    return wrong
