"""Faults of instruments put into a laboratory's recording: whole families or one channel of a family."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from daq_app.config.rig import Family
from daq_app.rocking import TestRecord
from studies.restitution.laboratory import LaboratoryTest

Floats = NDArray[np.float64]
FaultKind = Literal["none", "slow", "late", "hum", "gain", "reversed", "unit", "drift", "sticks", "jumps"]


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault; `size` in SI (s, m, m/s), a share for gain, the factor for unit."""

    family: Family
    kind: FaultKind
    size: float
    single: int | None = None
    """Which channel of the family; all of them if None."""

    def record(self, test: LaboratoryTest) -> TestRecord:
        """The test's recording with this fault."""
        return self.test(test).record()

    def test(self, test: LaboratoryTest) -> LaboratoryTest:
        """The test with this fault."""
        rows = test.rows(self.family)
        rows = rows if self.single is None else [rows[self.single]]
        si = test.si.copy()
        si[rows] = self._changed(si[rows], test.rate_hz)
        return replace(test, si=si)

    def _changed(self, values: Floats, rate_hz: float) -> Floats:
        time = np.arange(values.shape[1]) / rate_hz
        if self.kind == "slow":
            keep = float(np.exp(-1.0 / rate_hz / self.size))
            return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values, axis=1))
        if self.kind in ("sticks", "jumps"):
            follow = _sticking if self.kind == "sticks" else _jumping
            return np.array([follow(row, self.size) for row in values])
        if self.kind == "late":
            by = round(self.size * rate_hz)
            return np.concatenate([np.repeat(values[:, :1], by, axis=1), values[:, :-by]], axis=1)
        added = {"hum": self.size * np.sin(2.0 * np.pi * 50.02 * time), "drift": self.size * time}
        factor = {"gain": 1.0 + self.size, "reversed": -1.0, "unit": self.size}
        return np.asarray(values * factor.get(self.kind, 1.0) + added.get(self.kind, 0.0))


def _sticking(values: Floats, play: float) -> Floats:
    """Values (n,) of an instrument that is dragged along: by half of `play` behind, each way."""
    shown, followed = float(values[0]), []
    for value in values.tolist():
        shown = min(max(shown, value - play / 2.0), value + play / 2.0)
        followed.append(shown)
    return np.array(followed)


def _jumping(values: Floats, pull: float) -> Floats:
    """Values (n,) of an instrument that stays where it is until it is off by `pull`, and jumps there."""
    shown, followed = float(values[0]), []
    for value in values.tolist():
        if abs(value - shown) > pull:
            shown = value
        followed.append(shown)
    return np.array(followed)


FAULTS = (
    Fault("wire", "none", 0.0),
    *(Fault("wire", "slow", size) for size in (0.005, 0.02, 0.03)),
    Fault("lvdt", "slow", 0.02),
    *(Fault("wire", "late", size) for size in (0.008, 0.03)),
    *(Fault("lvdt", "late", size) for size in (0.01, 0.03)),
    *(Fault("accelerometer", "late", size) for size in (0.01, 0.03)),
    *(Fault("wire", "hum", size) for size in (0.5e-3, 4.7e-3)),
    Fault("lvdt", "hum", 0.5e-3),
    *(Fault("wire", "gain", size, single=2) for size in (0.01, 0.02)),
    *(Fault("wire", "gain", size) for size in (0.02, 0.05)),
    Fault("lvdt", "gain", 0.03),
    Fault("tiltmeter", "gain", 0.03),
    *(Fault(family, "reversed", 1.0) for family in ("wire", "lvdt", "tiltmeter")),
    *(Fault("wire", "unit", size) for size in (0.1, 10.0)),
    Fault("lvdt", "unit", 0.1),
    *(Fault("wire", "drift", size, single=2) for size in (0.3e-3, 1e-3)),
    *(Fault("wire", "drift", size) for size in (0.1e-3, 0.3e-3)),
    Fault("lvdt", "drift", 0.3e-3),
    *(Fault("wire", kind, size, single=4) for kind in ("sticks", "jumps") for size in (1e-3, 2e-3)),
    Fault("wire", "slow", 0.02, single=2),
    Fault("wire", "late", 0.02, single=2),
)
