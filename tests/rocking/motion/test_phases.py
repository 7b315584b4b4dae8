"""The phase detector: a release is believed, handling is not."""

from __future__ import annotations

import numpy as np
import pytest

from daq_app.rocking import Phase, PhaseDetector, PhaseSettings, free_rocking
from daq_app.rocking.theory.housner import exact_impact_speed

RATE, P, ALPHA, NOISE = 4000.0, 2.2, 0.215, 6e-5
SETTINGS = PhaseSettings(RATE, P, ALPHA, NOISE)


class Script:
    """Builds a rotation history piece by piece; tilt follows with 0.3 s."""

    def __init__(self, seed=0):
        self.pieces = []
        self.level = 0.0
        self.rng = np.random.default_rng(seed)

    @property
    def now_s(self):
        return sum(piece.size for piece in self.pieces) / RATE

    def _t(self, seconds):
        return np.arange(round(seconds * RATE)) / RATE

    def stay(self, seconds):
        self.pieces.append(np.full(self._t(seconds).size, self.level))
        return self

    def move(self, to, seconds):
        x = self._t(seconds) / seconds
        self.pieces.append(self.level + (to - self.level) * x * x * (3 - 2 * x))
        self.level = to
        return self

    def add(self, signal, seconds):
        """Something on top of standing still."""
        self.pieces.append(self.level + signal(self._t(seconds)))
        return self

    def rock(self, r=0.88, rest_s=2.5):
        motion = free_rocking(self.level, r, P, ALPHA, release_s=0.0)
        self.motion, self.release_s = motion, self.now_s
        self.pieces.append(motion.at(self._t(motion.impacts_s[-1] + rest_s))[0])
        self.level = 0.0
        return self

    def events(self, tilts=True):
        clean = np.concatenate(self.pieces)
        tilt = np.empty_like(clean)
        level, step = clean[0], 1 - np.exp(-1 / RATE / 0.3)
        for k, value in enumerate(clean):
            level += (value - level) * step
            tilt[k] = level
        rotation = clean + self.rng.normal(0, NOISE, clean.size)
        tilt += self.rng.normal(0, 1.5e-4, clean.size)
        detector = PhaseDetector(SETTINGS)
        found = detector.process(rotation, tilt[None] if tilts else np.empty((0, clean.size)))
        return found, detector


def kinds(events):
    return [event.kind for event in events]


def bump(size, tau=0.15, frequency=6.0):
    return lambda t: size * np.exp(-t / tau) * np.sin(2 * np.pi * frequency * t)


@pytest.mark.parametrize("phi", [0.15, 0.25, 0.4])
@pytest.mark.parametrize("side", [1, -1])
def test_a_plain_test_on_either_side(phi, side):
    script = Script().stay(1).move(side * phi * ALPHA, 2).stay(3).rock()
    events, detector = script.events()
    assert kinds(events)[:2] == ["hold", "release"] and kinds(events)[-1] == "rest"
    assert detector.side == side
    release = events[1]
    assert release.sample / RATE == pytest.approx(script.release_s, abs=2e-3)
    assert release.detected_sample / RATE < script.release_s + script.motion.impacts_s[0]
    impacts = np.array([event.sample for event in events if event.kind == "impact"]) / RATE - script.release_s
    expected = script.motion.impacts_s[script.motion.peaks_rad[1:] > 4e-4]
    assert impacts.size >= expected.size
    np.testing.assert_allclose(impacts[: expected.size], expected, atol=1.5e-3)
    rest_s = events[-1].sample / RATE - script.release_s
    assert script.motion.impacts_s[-1] - 0.6 < rest_s < script.motion.impacts_s[-1] + 0.3


def test_without_tiltmeters_too():
    events, _ = Script().stay(1).move(-0.05, 2).stay(3).rock().events(tilts=False)
    assert kinds(events)[:2] == ["hold", "release"]


def test_handling_around_upright_is_no_test():
    script = Script().stay(1)
    for size in (2e-3, -4e-3, 5e-3):
        script.add(bump(size), 1.0)
    script.add(lambda t: 3e-3 * np.sin(2 * np.pi * 1.3 * t), 4).stay(1)
    script.rng = np.random.default_rng(1)
    assert script.events()[0] == []


def test_a_wall_nudged_into_rocking_from_upright_is_no_test():
    script = Script().stay(1)
    script.level = 0.02
    script.rock(r=0.9)
    assert "release" not in kinds(script.events()[0])


def test_handling_on_the_hold_is_no_release():
    script = Script().stay(1).move(0.075, 2).stay(2)
    script.add(bump(6e-3), 1.5)  # someone leans on the wall
    script.add(bump(-8e-3, 0.4, 2.5), 2.0)  # jerk of the cable
    script.add(lambda t: 3e-3 * np.sin(2 * np.pi * 0.8 * t), 4)  # the pull wobbles
    script.add(lambda t: 2e-4 * np.sin(2 * np.pi * 17 * t), 1)  # footsteps
    script.add(lambda t: -4e-4 * t, 6)  # slow creep of the cable
    script.level -= 4e-4 * 6
    before = script.now_s
    script.rock()
    events, _ = script.events()
    assert kinds(events)[:2] == ["hold", "release"]
    assert events[1].sample / RATE == pytest.approx(before, abs=3e-3)


def test_release_out_of_a_wobbling_hold():
    script = Script().stay(1).move(0.075, 2).stay(2)
    script.add(lambda t: 2e-3 * np.sin(2 * np.pi * 0.5 * t), 6)
    events, _ = script.rock().events()
    assert kinds(events)[:2] == ["hold", "release"]
    assert events[1].sample / RATE == pytest.approx(script.release_s, abs=0.03)


def test_lowering_by_hand_is_no_release():
    script = Script().stay(1).move(0.075, 2).stay(3).move(0.0, 2.5).stay(4)
    events, detector = script.events()
    assert kinds(events) == ["hold", "hold_lost"]
    assert detector.phase is Phase.WAITING


def test_lowering_across_to_the_other_side_is_no_release():
    events, _ = Script().stay(1).move(0.05, 2).stay(3).move(-0.05, 3).stay(3).events()
    assert kinds(events) == ["hold", "hold_lost", "hold"]


def test_pulling_in_steps_ends_in_one_release():
    script = Script().stay(1).move(0.03, 1).stay(3).move(0.05, 1).stay(3).move(0.075, 1).stay(2)
    events, _ = script.rock().events()
    assert [kind for kind in kinds(events) if kind != "hold_lost"].count("release") == 1
    release = next(event for event in events if event.kind == "release")
    assert release.sample / RATE == pytest.approx(script.release_s, abs=3e-3)


def test_a_fall_that_is_caught_is_said_and_the_next_release_found():
    script = Script().stay(1).move(0.075, 2).stay(3)
    motion = free_rocking(0.075, 0.9, P, ALPHA)
    fall = motion.at(script._t(motion.impacts_s[0] * 0.85))[0]
    script.pieces.append(fall)
    script.level = float(fall[-1])
    script.stay(2).move(0.06, 1).stay(3)
    events, _ = script.rock().events()
    assert kinds(events)[:4] == ["hold", "release", "caught", "hold"] or kinds(events)[:5] == [
        "hold",
        "release",
        "caught",
        "hold",
        "hold_lost",
    ]
    releases = [event for event in events if event.kind == "release"]
    assert len(releases) == 2
    assert releases[1].sample / RATE == pytest.approx(script.release_s, abs=5e-3)


def test_a_wall_slipping_while_it_is_lowered_is_a_release_after_all():
    """The early test fails (no fall from the hold), the passage through zero tells."""
    script = Script().stay(1).move(0.075, 2).stay(3).move(0.058, 1.0)
    events, _ = script.rock().events()
    assert "release" in kinds(events) and kinds(events).count("impact") > 5


def test_a_wall_caught_by_the_safety_ropes_is_at_rest_but_not_upright():
    script = Script().stay(1).move(0.075, 2).stay(3)
    motion = free_rocking(0.075, 0.9, P, ALPHA)
    stop = motion.impacts_s[1] - 0.1
    half = motion.at(script._t(stop))[0]
    script.pieces.append(half)
    script.level = float(half[-1])
    events, _ = script.stay(3).events()
    assert kinds(events)[-1] == "rest" and "not upright" in events[-1].text


def test_impact_speed_and_time_scale_may_differ_from_nominal():
    """A wall whose p is 5 % off is still recognised."""
    script = Script().stay(1).move(0.05, 2).stay(3)
    motion = free_rocking(0.05, 0.9, P * 1.05, ALPHA)
    assert exact_impact_speed(0.05, P * 1.05, ALPHA) > exact_impact_speed(0.05, P, ALPHA)
    script.release_s = script.now_s
    script.pieces.append(motion.at(script._t(motion.impacts_s[-1] + 2.5))[0])
    events, _ = script.events()
    assert kinds(events)[:2] == ["hold", "release"]
    assert events[1].sample / RATE == pytest.approx(script.release_s, abs=6e-3)
