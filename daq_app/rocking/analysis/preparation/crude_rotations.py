"""Rotations that need no test, no zero and no sound instrument: what each family says roughly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.geometry.joint import BaseJoint
from daq_app.rocking.geometry.kinematics import RotationGeometry
from daq_app.rocking.means import block_means, median_of_few
from daq_app.rocking.record import TestRecord

Floats = NDArray[np.float64]

_MEAN_S: Final = 0.005
"""Signs, units and standstills are found from means of this length: whatever they hide is none of these."""


@dataclass(frozen=True, slots=True)
class CrudeRotations:
    """By family, as it is called for the reader."""

    rad: Mapping[str, Floats]
    """(n,), at `rate_hz`, from sample 0 of the record on."""
    rate_hz: float

    def span_rad(self, start_s: float, stop_s: float) -> float:
        """How far the wall turns in a part of the record: by wires or LVDTs, whichever say more."""
        start, stop = (round(time_s * self.rate_hz) for time_s in (start_s, stop_s))
        parts = (self.rad[name][start : stop + 1] for name in ("wires", "LVDTs") if name in self.rad)
        spans = [float(np.ptp(part)) for part in parts if part.size and np.isfinite(part).all()]
        return max(spans, default=0.0)


def crude_rotations(record: TestRecord) -> CrudeRotations:
    """Rotation by family, linear, so that a wrong unit stays a factor."""
    size = max(1, round(_MEAN_S * record.rate_hz))

    def means(channel_ids: tuple[str, ...]) -> Floats:
        return block_means(record.load(channel_ids), size)

    rotations: dict[str, Floats] = {}
    ids = record.family("wire")
    if len(ids) >= 2:
        geometry = RotationGeometry.from_rig(record.rig)
        levers = {
            wire: float(lever) for wire, lever in zip(geometry.wires.ids, geometry.wires.lever_m, strict=True)
        }
        of_each_wire = means(ids) / np.array([[levers[channel_id]] for channel_id in ids])
        levels = np.nanmedian(of_each_wire, axis=1, keepdims=True)
        rotations["wires"] = median_of_few(of_each_wire - levels)
    lvdts = record.family("lvdt")
    try:
        joint = BaseJoint.from_rig(record.rig, lvdts)
    except ValueError:
        joint = None
    if joint is not None:
        openings = means(lvdts)
        left = joint.x_m < 0
        across = float(joint.x_m[~left].mean() - joint.x_m[left].mean())
        rotations["LVDTs"] = (median_of_few(openings[left]) - median_of_few(openings[~left])) / across
    tilts = record.family("tiltmeter", "x")
    if tilts:
        rotations["tiltmeters"] = means(tilts).mean(axis=0)
    return CrudeRotations(rotations, record.rate_hz / size)
