"""The watches on clock, channels and machine, with made-up readings: what they tell, and what they do not."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from daq_app.acquisition.course.sensors.channel_watch import ChannelWatch, Doubt
from daq_app.acquisition.pipeline.clock_watch import ClockNews, ClockWatch
from daq_app.acquisition.session.machine_watch import LOW_MEMORY_BYTES, MachineNews, MachineWatch
from daq_app.config import Rig, Scaling
from drivers import Block, ClockReading

RATE_HZ = 4000.0


def readings(
    until_s: float, *, ppm: float = 0.0, reply_s: float = 0.5e-3, lump: int = 1, seed: int = 1
) -> Iterator[ClockReading]:
    """Ten a second; replies jitter, now and then one is late; the counter moves in lumps."""
    rng = np.random.default_rng(seed)
    for at in np.arange(0.1, until_s, 0.1):
        late = reply_s * (1.0 + rng.exponential()) + (0.05 if rng.random() < 0.02 else 0.0)
        asked = at + late * rng.random()
        taken = int(asked * RATE_HZ * (1 + 1e-6 * ppm)) // lump * lump
        yield ClockReading(at, at + late, taken)


def told(watch: ClockWatch, entries: Iterator[ClockReading]) -> list[ClockNews]:
    return [news for entry in entries if (news := watch.take(entry)) is not None]


@pytest.mark.parametrize("lump", [1, 40, 200])
@pytest.mark.parametrize("seed", range(4))
def test_a_sound_clock_is_never_doubted(seed: int, lump: int) -> None:
    assert told(ClockWatch(RATE_HZ), readings(1500.0, ppm=3.0, lump=lump, seed=seed)) == []


@pytest.mark.parametrize("ppm", [50.0, -50.0, 400.0])
def test_a_drift_is_told_once_and_not_more_than_it_is(ppm: float) -> None:
    (news,) = told(ClockWatch(RATE_HZ), readings(300.0, ppm=ppm))
    assert news.name == "drift"
    assert 20.0 < abs(news.value) <= abs(ppm) and news.value * ppm > 0
    assert ("fast" if ppm > 0 else "slow") in news.text


def test_a_clock_at_another_rate_is_told_within_seconds() -> None:
    watch = ClockWatch(5000.0)
    news = told(watch, readings(3.0))
    assert [entry.name for entry in news] == ["rate"]
    assert news[0].value == pytest.approx(4000.0, rel=0.01)
    assert told(ClockWatch(2000.0, speed=2.0), readings(60.0)) == [], "a device that is meant to be fast"


def shifted(
    entries: Iterator[ClockReading], at_s: float, *, ours: float = 0.0, theirs: float = 0.0
) -> Iterator[ClockReading]:
    """From `at_s` on our clock, or the device's, has stood still for so long."""
    for entry in entries:
        behind = int(theirs * RATE_HZ) if entry.before_s >= at_s else 0
        back = ours if entry.before_s >= at_s else 0.0
        yield ClockReading(entry.before_s - back, entry.after_s - back, entry.samples - behind)


def test_a_device_that_stood_still_is_told_with_the_time_and_the_place() -> None:
    (news,) = told(ClockWatch(RATE_HZ), shifted(readings(40.0), 20.0, theirs=1.5))
    assert news.name == "stood_still"
    assert news.value == pytest.approx(1.5, abs=0.02)
    assert news.sample == pytest.approx(20.0 * RATE_HZ, abs=RATE_HZ)


@pytest.mark.parametrize("at_s", [0.35, 0.75, 1.05, 1.55, 2.05])
def test_a_standstill_in_the_first_seconds_is_no_other_rate(at_s: float) -> None:
    (news,) = told(ClockWatch(RATE_HZ), shifted(readings(40.0), at_s, theirs=1.5))
    assert news.name == "stood_still"
    assert news.value == pytest.approx(1.5, abs=0.06)
    assert news.sample == pytest.approx(at_s * RATE_HZ, abs=0.4 * RATE_HZ)
    (news,) = told(ClockWatch(RATE_HZ), shifted(readings(40.0), at_s, ours=3.0))
    assert news.name == "asleep" and news.value == pytest.approx(3.0, abs=0.06)


@pytest.mark.parametrize("at_s", [0.35, 1.05, 1.55])
@pytest.mark.parametrize("expected_hz", [2000.0, 5000.0])
def test_another_rate_is_told_once_and_rightly_though_the_clock_stood_still(
    expected_hz: float, at_s: float
) -> None:
    news = told(ClockWatch(expected_hz), shifted(readings(40.0), at_s, theirs=1.5))
    assert [entry.name for entry in news].count("rate") == 1
    assert news[0].name == "rate" and news[0].value == pytest.approx(4000.0, rel=0.01)
    assert len(news) <= 2


def test_a_device_that_runs_faster_than_it_says_is_told_once() -> None:
    (news,) = told(ClockWatch(RATE_HZ / 5), readings(60.0))
    assert news.name == "rate" and news.value == pytest.approx(4000.0, rel=0.01)


def test_samples_that_only_come_late_are_no_standstill() -> None:
    def late(entries: Iterator[ClockReading]) -> Iterator[ClockReading]:
        for entry in entries:
            held = 20.0 <= entry.before_s < 20.4
            yield ClockReading(entry.before_s, entry.after_s, 80_000 if held else entry.samples)

    assert told(ClockWatch(RATE_HZ), late(readings(60.0))) == []


def test_a_computer_that_slept_is_told() -> None:
    (news,) = told(ClockWatch(RATE_HZ), shifted(readings(40.0), 20.0, ours=3.0))
    assert news.name == "asleep" and news.value == pytest.approx(3.0, abs=0.02)


# -- channels ------------------------------------------------------------------------------------------


def block(rig: Rig, first: int, rotation_rad: float = 0.0, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed + first)
    si = rng.normal(size=(len(rig.channels), 400)) * np.array([c.noise_si for c in rig.channels])[:, None]
    for row, channel in enumerate(rig.channels):
        if channel.family == "wire":
            towards = 1.0 if channel.anchor_m[0] > channel.position_m[0] else -1.0
            si[row] += towards * channel.position_m[2] * rotation_rad
        if channel.family == "tiltmeter" and channel.axis == "x":
            si[row] += rotation_rad
    return np.round(Scaling.of(rig.channels).to_readings(si) / (20 / 2**16)) * (20 / 2**16)


def watched(
    rig: Rig, spoil: object = None, rotation_rad: float = 0.0, *, moving: bool = False
) -> list[Doubt]:
    watch = ChannelWatch(rig, RATE_HZ, dict.fromkeys(rig.channel_ids, (-10.0, 10.0)))
    found: list[Doubt] = []
    for first in range(0, 8000, 400):
        values = block(rig, first, rotation_rad)
        if spoil is not None and first >= 2000:
            spoil(values, first)
        found += watch.check(Block(first, values, 0, 0), moving=moving)
    return found


@pytest.mark.parametrize("rotation_rad", [0.0, 0.08, -0.08])
def test_sound_channels_are_not_doubted(rig: Rig, rotation_rad: float) -> None:
    assert watched(rig, None, rotation_rad) == []


def spoil_of(rig: Rig, kind: str, row: int) -> object:
    def spoil(values: np.ndarray, first: int) -> None:
        time = (first + np.arange(400)) / RATE_HZ
        if kind == "stuck":
            values[row] = 1.25
        elif kind == "hum":
            values[row] += 0.2 * np.sin(2 * np.pi * 50.0 * time)
        elif kind == "leap":
            values[row] = -values[row]
        else:
            values[row] = 2.0 * rig.channels[row].offset - values[row]

    return spoil


@pytest.mark.parametrize(
    ("kind", "channel", "rotation_rad"),
    [("stuck", "LV-A03", 0.0), ("hum", "LV-B02", 0.0), ("leap", "WP-3", 0.05), ("contrary", "TL-1X", 0.08)],
)
def test_a_channel_that_is_wrong_is_told_once(rig: Rig, kind: str, channel: str, rotation_rad: float) -> None:
    found = watched(rig, spoil_of(rig, kind, rig.channel_ids.index(channel)), rotation_rad)
    told_of = [doubt for doubt in found if doubt.name == kind]
    assert [doubt.channel_id for doubt in told_of] == [channel]
    assert {doubt.channel_id for doubt in found} == {channel}
    assert 1200 <= told_of[0].sample < 6000 and channel in told_of[0].text


# -- the machine ---------------------------------------------------------------------------------------


class FakeMachine:
    def __init__(self) -> None:
        self.now, self.wall, self.memory = 100.0, 1e9, 10 * LOW_MEMORY_BYTES
        self.watch = MachineWatch(lambda: self.now, lambda: self.wall, lambda: self.memory)

    def look(self, seconds: float = 0.2, step: float = 0.0) -> list[MachineNews]:
        self.now += seconds
        self.wall += seconds + step
        return self.watch.look()


def test_a_machine_that_works_is_not_talked_about() -> None:
    machine = FakeMachine()
    assert [machine.look(step=1e-4) for _ in range(500)] == [[]] * 500


@pytest.mark.parametrize(
    ("seconds", "step", "name", "words"),
    [
        (7.0, 0.0, "asleep", "stood still for 7.0 s"),
        (0.2, -3600.0, "wall_clock", "set back by 3600.0 s"),
        (0.2, 2.0, "wall_clock", "set forward by 2.0 s"),
    ],
)
def test_what_happens_to_the_machine_is_told_once(seconds: float, step: float, name: str, words: str) -> None:
    machine = FakeMachine()
    machine.look()
    (news,) = machine.look(seconds, step)
    assert news.name == name and words in news.text
    assert machine.look() == []


def test_little_memory_is_told_once_and_its_end_as_well() -> None:
    machine = FakeMachine()
    machine.look()
    machine.memory = LOW_MEMORY_BYTES // 2
    (begins,) = machine.look()
    assert begins.severity == "error" and machine.look() == []
    machine.memory = round(1.2 * LOW_MEMORY_BYTES)
    assert machine.look() == [], "not to and fro"
    machine.memory = 2 * LOW_MEMORY_BYTES
    (ends,) = machine.look()
    assert ends.severity == "info" and machine.look() == []
