"""Channels whose readings are not fit to be used: coarse steps, standstill, leaps; and noisy ones."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.config.families import FAMILY_NAMES, Family
from daq_app.rocking.analysis.preparation.crude_rotations import CrudeRotations
from daq_app.rocking.families import unfit_words
from daq_app.rocking.families.channels.readings import Readings, readings_of
from daq_app.rocking.families.finding import FamilyFinding
from daq_app.rocking.geometry.kinematics import RotationGeometry
from daq_app.rocking.record import TestRecord

Floats = NDArray[np.float64]

_FEWEST_LEAPS: Final = 5
"""Leaps of one channel in a record from which it is left out: a lone one or two move no half-cycle (assumed).
Raising it lets drop-outs bend a few half-cycles."""
_MISSED_M: Final = 3e-3
"""What the wall must move a channel by meanwhile for its standstill to count: play of 2 mm hides less.
Raising it overlooks sensors that stop near the largest rotation."""
_LONGEST_STILL_S: Final = 0.3
"""Time without even noise from which a channel is left out: a half-cycle of a rocking wall (assumed). Raising
it lets sensors that stop at the top of the first half-cycles bend them."""
_NOISY: Final = 4.0
"""Noise over that of the rig file that is named: ordinary laboratories reach 2, and r has its noise in its
error. Raising it leaves unsaid why the error of r is large."""
_MOST_LEFT_OUT: Final[Mapping[Family, float]] = {"wire": 0.4, "lvdt": 0.34}
"""Share of a family that is left out channel by channel: two of five wires, a third of the LVDTs. Beyond it
the whole family is not asked."""


@dataclass(frozen=True, slots=True)
class UnfitChannels:
    """What the readings say of the channels before a test is looked for."""

    left_out: tuple[FamilyFinding, ...]
    """Single channels that are left out."""
    families: tuple[FamilyFinding, ...]
    """Families that have too many of them."""
    noisy: tuple[FamilyFinding, ...]

    @property
    def ids(self) -> frozenset[str]:
        """The channels that are left out."""
        return frozenset(name for finding in self.left_out for name in finding.channels)

    def spoils(self, family: str) -> bool:
        """Whether a whole family, by its name for the reader, is not fit to be used."""
        return any(finding.family == family for finding in self.families)


def unfit_channels(record: TestRecord, rotations: CrudeRotations) -> UnfitChannels:
    """Look at the readings of all wires and LVDTs; `rotations` tell when the wall moves."""
    levers = _levers_m(record)
    left_out: list[FamilyFinding] = []
    families: list[FamilyFinding] = []
    noisy: list[FamilyFinding] = []
    for family, most in _MOST_LEFT_OUT.items():
        ids = record.family(family)
        if not ids:
            continue
        rows = record.load(ids)
        declared = [record.rig.channel(name).noise_si for name in ids]
        seen = [_readings(record, name, row) for name, row in zip(ids, rows, strict=True)]
        still = [
            _missed_s(readings, levers[name], rotations) for name, readings in zip(ids, seen, strict=True)
        ]
        found = _unfit(FAMILY_NAMES[family], ids, seen, still)
        if len(found) > most * len(ids):
            families.append(unfit_words.whole_family_unfit(found, len(ids)))
        else:
            left_out += found
        unfit = {name for finding in found for name in finding.channels}
        noises = {
            name: readings.noise_si / noise
            for name, readings, noise in zip(ids, seen, declared, strict=True)
            if name not in unfit and noise > 0.0 and math.isfinite(readings.noise_si)
        }
        noisy += _noisy(FAMILY_NAMES[family], noises)
    return UnfitChannels(tuple(left_out), tuple(families), tuple(noisy))


def _readings(record: TestRecord, name: str, values: Floats) -> Readings:
    channel, zero = record.rig.channel(name), record.zeros_si.get(name, 0.0)
    low, high = channel.range_si
    return readings_of(values, record.rate_hz, channel.noise_si, (low - zero, high - zero))


def _levers_m(record: TestRecord) -> dict[str, float]:
    """What each wire and LVDT moves by for a rotation of one rad, m, roughly."""
    levers = dict.fromkeys(record.family("lvdt"), record.rig.specimen.base_width_m)
    if record.family("wire"):
        wires = RotationGeometry.from_rig(record.rig).wires
        levers.update(zip(wires.ids, np.abs(wires.lever_m).tolist(), strict=True))
    return levers


def _missed_s(readings: Readings, lever_m: float, rotations: CrudeRotations) -> float:
    """How long a channel stands still while the wall moves on, s.

    A held wall stands still as well, and a wire with play follows it a little later.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], readings.still, [False]]).astype(np.int8)))
    missed = 0
    for start, stop in edges.reshape(-1, 2).tolist():
        # Of its first and its last block a part may have moved.
        inner_s = ((start + 1) * readings.block_s, (stop - 1) * readings.block_s)
        span_rad = rotations.span_rad(*inner_s)
        missed += (stop - start) * (span_rad * lever_m > _MISSED_M)
    return missed * readings.block_s


def _unfit(
    family: str, ids: Sequence[str], seen: Sequence[Readings], still_s: Sequence[float]
) -> list[FamilyFinding]:
    found = []
    for name, readings, missed_s in zip(ids, seen, still_s, strict=True):
        if readings.step_si > 0.0:
            found.append(unfit_words.coarse_steps(family, name, readings.step_si))
        elif missed_s > _LONGEST_STILL_S:
            found.append(unfit_words.stands_still(family, name, missed_s))
        elif readings.leaps >= _FEWEST_LEAPS:
            found.append(unfit_words.leaps(family, name, readings.leaps))
    return found


def _noisy(family: str, times: Mapping[str, float]) -> list[FamilyFinding]:
    """The family where half of it is noisy, else single channels. `times`: noise over the rig file's."""
    usual = float(np.median(list(times.values()))) if times else 0.0
    if usual > _NOISY:
        return [unfit_words.noisy(family, (), usual)]
    return [unfit_words.noisy(family, (name,), ratio) for name, ratio in times.items() if ratio > _NOISY]
