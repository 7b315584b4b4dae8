"""How wires, LVDTs and accelerometers follow each other through a test that was found."""

from __future__ import annotations

import math
from functools import partial
from typing import Final

import numpy as np

from daq_app.rocking.analysis.preparation.signals import Lead, Signals, TestTimes
from daq_app.rocking.families import words
from daq_app.rocking.families.finding import FamilyFinding
from daq_app.rocking.families.response import DRIFT_RAD, LATE_S, SLOW_S, Response, compare
from daq_app.rocking.families.shocks import LATE_SHOCKS_S, ShockTiming, shock_timing
from daq_app.rocking.motion.bending import Bending, find_bending
from daq_app.rocking.motion.transients import Accelerations
from daq_app.rocking.record import TestRecord

_GAIN_SHARE: Final = 0.01
"""Gain of one family against the other that is named: three times what calibration leaves."""
_COVERED: Final = 0.98
"""LVDTs take the wires' place where they know at least this share of the motion."""
_BENT: Final = 2.0
"""What is left between two families that were put in step, over their white noise, from which something else
than a delay is at work: slow noise and hum leave 0.9 to 1.8, a filter of 20 ms or a drum of 25 Hz leaves 2.2
and more. Raising it takes r from wires that a filter bends."""
_COMPARED_IMPACTS: Final = 12


def motion_samples(signals: Signals, times: TestTimes) -> slice:
    """Samples from just before the release to the last impact that tells something of timing."""
    assert times.release_s is not None
    last = times.impacts_s[min(len(times.impacts_s), _COMPARED_IMPACTS) - 1]
    start, stop = np.searchsorted(signals.time_s, [times.release_s - 0.3, last + 0.2])
    return slice(int(start), int(stop))


def follow(signals: Signals, times: TestTimes) -> Response | None:
    """How the wires follow the LVDTs through the motion."""
    if signals.joint is None:
        return None
    part = motion_samples(signals, times)
    return compare(signals.time_s[part], signals.joint.rotation_rad[part], signals.wire_rotation_rad[part])


def bending_of(signals: Signals, times: TestTimes, response: Response | None) -> Bending | None:
    """How the wires ring about the LVDTs through the motion, once both are as late and as slow as either."""
    if signals.joint is None:
        return None
    part = motion_samples(signals, times)
    lvdts, wires = signals.joint.rotation_rad[part], signals.wire_rotation_rad[part]
    if response is not None:
        lvdts, wires = response.made_alike(signals.record.rate_hz, lvdts, wires)
    return find_bending(signals.time_s[part], wires, lvdts, times.impacts_s)


def lvdts_cover(signals: Signals, times: TestTimes) -> bool:
    """Whether the LVDTs know enough of the motion to take the wires' place."""
    assert signals.joint is not None
    known = np.isfinite(signals.joint.rotation_rad[motion_samples(signals, times)]).mean()
    return bool(known >= _COVERED)


def accelerations_of(record: TestRecord, signals: Signals) -> Accelerations:
    """Those of all accelerometers of a record."""
    ids = record.family("accelerometer")
    offsets = [record.offset_s(channel_id) for channel_id in ids]
    read = partial(record.load, ids)
    return Accelerations(read, record.n_samples, record.rate_hz, signals.first_s, offsets)


def shocks_of(record: TestRecord, signals: Signals, times: TestTimes) -> ShockTiming | None:
    """When the accelerometers show the impacts, against when the rotation does."""
    return shock_timing(accelerations_of(record, signals), times.impacts_s)


def timing(
    record: TestRecord, signals: Signals, times: TestTimes, response: Response, shocks: ShockTiming | None
) -> tuple[list[FamilyFinding], Lead, dict[str, float]]:
    """Slow and late families: findings, the family that leads, and by how much channels are moved earlier."""
    if response.response_s > SLOW_S:
        lead: Lead = "lvdts" if lvdts_cover(signals, times) else "wires"
        return [words.slow("wires", response.response_s, left_out=lead == "lvdts")], lead, {}
    if response.response_s < -SLOW_S:
        return [words.slow("LVDTs", -response.response_s, left_out=True)], "wires", {}
    late = response.delay_s
    lag = None if shocks is None else shocks.lag_s
    if abs(late) <= LATE_S:
        if lag is not None and abs(lag) > LATE_SHOCKS_S:
            return [words.late("accelerometers", lag, "wires and LVDTs")], "wires", {}
        return [], "wires", {}
    if lag is None:
        later = "wires" if late > 0 else "LVDTs"
        return [words.one_of_two_late(later, abs(late))], "wires", {}
    bent = _leaves_more_than_noise(signals, response)
    # Shocks come `lag` after the wires' crossings and `lag + late` after the LVDTs'.
    if abs(lag) > abs(lag + late):
        lead = "lvdts" if bent and lvdts_cover(signals, times) else "wires"
        moved = dict.fromkeys(record.family("wire"), late)
        others = "LVDTs and accelerometers"
        return [words.late("wires", late, others, left_out=lead == "lvdts")], lead, moved
    moved = dict.fromkeys(record.family("lvdt"), -late)
    return [words.late("LVDTs", -late, "wires and accelerometers", left_out=bent)], "wires", moved


def _leaves_more_than_noise(signals: Signals, response: Response) -> bool:
    """Whether wires and LVDTs differ by more than noise where one is as late as the other."""
    of_one_sample = math.hypot(signals.noise_rad, signals.lvdt_noise_rad)
    return response.residual_rad > _BENT * response.noise_of_means(signals.record.rate_hz, of_one_sample)


def levels(signals: Signals, times: TestTimes, response: Response) -> list[FamilyFinding]:
    """Gain and drift of wires against LVDTs, blamed on the one that the tiltmeters contradict."""
    assert times.release_s is not None and signals.joint is not None
    drift = response.drift_rad_s * response.span_s
    apart = response.gain - 1.0
    if abs(drift) <= DRIFT_RAD and abs(apart) <= _GAIN_SHARE:
        return []
    start, stop = np.searchsorted(signals.time_s, [times.release_s - 0.5, times.release_s - 0.02])
    hold = slice(int(start), int(stop))
    wires, lvdts = (
        float(np.nanmedian(values[hold])) if np.isfinite(values[hold]).any() else math.nan
        for values in (signals.wire_rotation_rad, signals.joint.rotation_rad)
    )
    tilt = math.nan
    if signals.tilts_rad.shape[0]:
        tilt = signals.geometry.tilt(signals.tilts_rad[:, hold], wires)
    family = "wires or LVDTs"
    if math.isfinite(tilt) and math.isfinite(wires) and math.isfinite(lvdts):
        by_wires, by_lvdts = abs(wires - tilt), abs(lvdts - tilt)
        if max(by_wires, by_lvdts) > 2.0 * min(by_wires, by_lvdts):
            family = "wires" if by_wires > by_lvdts else "LVDTs"
    if abs(drift) > DRIFT_RAD:
        return [words.drift(family, drift)]
    return [words.gain(family, apart)]
