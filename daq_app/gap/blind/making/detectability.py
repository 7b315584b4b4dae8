"""How visible a hidden effect is, judged by the generator that knows the truth.

An estimate in units of standard deviations, for sorting cases into weak and strong ones: it compares
two quiet twins of a run, with and without the effect, first in what swings and impacts show locally
(duration and loss of a swing, speed against peak, restitution of an impact, against impact scatter
and with α, p and r refitted), then in what the channels show beyond any motion (against their noise, with
gain, the walk of the zero, the straightness of LVDTs, the half width of the base and the distance of the
LVDTs' faces refitted as far as they are known to). A push and a slow release count against the release at
rest that comes nearest. Hum counts against the hum that sound channels pick up, and a lean, a slope of r or a
delay against what any wall and rig has of it. No diagnosis can see much more.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from daq_app.gap.blind.making.let_go import LET_GO, left_by_a_release_at_rest
from daq_app.gap.blind.world.arrays import FloatArray
from daq_app.gap.blind.world.campaign import PlannedRun, Surroundings, World
from daq_app.gap.blind.world.course import Course
from daq_app.gap.blind.world.effects.catalogue import CONTACT_OUTSIDE, Drawn
from daq_app.gap.blind.world.events.motion import Followed
from daq_app.gap.blind.world.sensors.chain import CALIBRATION_TOLERANCE, quiet_signals
from daq_app.gap.blind.world.sensors.faults import Bench, Place, not_straight, through_electronics
from daq_app.gap.blind.world.wall import Wall

_SMALLEST_PEAK_RAD: Final = 4e-3
_TIME_SD_S: Final = 3e-4
_SPEED_SD: Final = 2e-3
_RATE_HZ: Final = 500.0
_CORRELATED: Final = 10.0
"""Samples at 500 Hz that count as one: what remains of motion and calibration is not white."""
_MODEL_SHARE: Final = 1e-3
"""Part of a channel's signal that nobody trusts."""
_CLOCK_SD: Final = 1e-3
_HALF_WIDTH_SD_M: Final = 3e-3
"""A half width of the base, or half the distance of the LVDTs' faces, as it is measured by tape (the default
of the diagnosis's survey)."""
_USUAL: Final = {
    "alpha_asymmetry": ("delta_rad", 3e-4),
    "base_tilt": ("beta_rad", 3e-4),
    "restitution_slope": ("k_s_rad", 3e-3),
    "restitution_asymmetry": ("d", 3e-4),
    "lag": ("tau_s", 1.4e-3),
    "slow_response": ("tau_s", 1.4e-3),
    "filter_delay": ("tau_s", 1.4e-3),
}
"""Effects of which any wall or rig has some, and how much: a lean that a level leaves, an r that changes a
little with speed and side, amplifiers of 100 to 500 Hz."""
_USUAL_LEAN_RAD: Final = 3e-4
_SHARED: Final = 3
"""Changes that all channels share: the effect, the half width, the faces."""
_OF_RUNS: Final = 6
"""From this change on they are each run's own."""
_PINK_HZ: Final = (0.05, 300.0)
"""Where the 1/f noise of laboratories is, with as much power in each octave."""
_SLOW_PERIODS: Final = 8
"""Periods of 1/f noise in a run that are as slow as what the wall does."""
_LEAST_TURN: Final = 1e-12
"""Least square of the turn that all channels together show at an instant, over their noise: a wall that is
upright shows none, and the projection on the motion divides by it."""
_LEAST_HUM: Final = 0.02
"""Amplitude of the hum that any channel picks up, in noises: the least of all laboratories."""


def detectability(world: World, effect: Drawn) -> float:
    """Strength of one effect of a case in standard deviations of what it could be known to."""
    shown, beyond_usual = _shown(world, effect), _beyond_usual(world, effect)
    return shown if math.isinf(beyond_usual) else 1.0 / math.hypot(1.0 / max(shown, 1e-9), 1.0 / beyond_usual)


def _beyond_usual(world: World, effect: Drawn) -> float:
    """Strength of an effect over what any wall or rig has of it; infinite where that is nothing."""
    if effect.name == "eccentric_mass":
        lean = effect.parameters["e_m"] / world.wall.centroid_height
        return abs(lean) / _USUAL_LEAN_RAD
    if effect.name not in _USUAL or len(effect.targets) == 1:
        return math.inf
    parameter, usual = _USUAL[effect.name]
    return abs(effect.parameters[parameter]) / usual


def _shown(world: World, effect: Drawn) -> float:
    """How many standard deviations the runs show of an effect."""
    if effect.name == "clock":
        return abs(effect.parameters["error"]) / _CLOCK_SD
    if effect.name == "hum" and world.surroundings.installation is not None:
        return _over_ordinary_hum(world, effect)
    alone = replace(
        world,
        effects=(effect,),
        usual=(),
        wall=replace(world.wall, restitution_scatter=0.0),
        runs=_extremes(world),
        surroundings=Surroundings(),
        # Points that press and give way are no sharp edges, and what they do is no part of the effect.
        engine=world.engine if effect.name in CONTACT_OUTSIDE else "events",
    )
    in_swings, noise, seen = 0.0, total_noise(world), list[FloatArray]()
    for index, run in enumerate(alone.runs):
        course = alone.course(index, (0, 30 * (len(world.runs) - 1))[index])
        seen.append(_beyond_motion(_in_channels(alone, run, course, noise, world.surroundings.sizes)))
        if effect.name in LET_GO:
            in_swings += _in_the_fall(alone, course, noise)
        if not effect.targets:
            in_swings += _in_swings(course.motion, world.wall, at_rest=effect.name not in LET_GO)
    stand_for = len(world.runs) / len(alone.runs)
    return math.sqrt(stand_for * in_swings + _evidence(seen, stand_for))


def _extremes(world: World) -> tuple[PlannedRun, PlannedRun]:
    runs = sorted(world.runs, key=lambda run: abs(run.theta0))
    return (replace(runs[0], sway=None), replace(runs[-1], sway=None))


def block_swing(theta: float, alpha: float, p: float) -> tuple[float, float]:
    """(time from a peak to upright, speed there) of a rigid block: energy integral by Gauss–Legendre.

    ω² = 2 p² [cos(α − θpeak) − cos(α − θ)], with θ = θpeak (1 − x²) to tame the root at the peak.
    """
    x, weights = np.polynomial.legendre.leggauss(32)
    x, weights = (x + 1.0) / 2.0, weights / 2.0
    angle = theta * (1.0 - x * x)
    rate = np.sqrt(2.0 * (np.cos(alpha - theta) - np.cos(alpha - angle))) * p
    time = float(np.sum(weights * 2.0 * theta * x / rate))
    speed = p * math.sqrt(2.0 * abs(math.cos(alpha - theta) - math.cos(alpha)))
    return time, speed


def _in_the_fall(alone: World, course: Course, noise_si: FloatArray) -> float:
    """Squared distance of the start of a fall from that of any wall that is let go at rest."""
    time_s = _times(course)
    plain = course.plain(time_s)
    place = Place(0.0, abs(course.motion.release.theta0))
    signals = quiet_signals(alone.rig, plain, (), np.random.default_rng(0), place)
    left_rad = left_by_a_release_at_rest(course.motion, alone.wall, time_s)
    turning = plain.theta - np.median(plain.theta)
    square = 0.0
    for channel, signal, noise in zip(alone.rig.channels, signals, noise_si, strict=True):
        if channel.family != "accelerometer":
            per_rad = float((signal - np.median(signal)) @ turning / (turning @ turning))
            square += (per_rad / _sd(noise, signal)) ** 2
    return square * float(left_rad @ left_rad)


def _in_swings(motion: Followed, wall: Wall, at_rest: bool) -> float:
    """Squared distance of a motion from any rigid block's in local features: α, p and r are free.

    Where a wall may not have been let go `at_rest`, nobody knows when the first swing begins.
    """
    values, sds, columns = _features(motion, wall, at_rest)
    if values.size <= columns.shape[1]:
        return 0.0
    weighted, design = values / sds, columns / sds[:, None]
    left = weighted - design @ np.linalg.lstsq(design, weighted, rcond=None)[0]
    return float(left @ left)


def _features(motion: Followed, wall: Wall, at_rest: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Departures from the rigid block (n,), their standard deviations, and the (n, 3) slopes in α, p, r."""
    crossings = [impact for impact in motion.impacts if impact.restitution > 0.0]
    turning = list(motion.peaks)
    if not turning or (crossings and turning[0][0] > crossings[0].time):
        turning.insert(0, (0.0, motion.release.theta0))  # let go at rest: the release is the first peak
    rows: list[tuple[float, float, float, float, float]] = []
    scatter = math.hypot(wall.restitution_scatter, _SPEED_SD / 2.0)
    for k, (at, peak) in enumerate(turning[: len(crossings)]):
        if abs(peak) < _SMALLEST_PEAK_RAD:
            break
        time, speed, slopes = _block_with_slopes(abs(peak), wall)
        impact = crossings[k]
        if k > 0 or at_rest:
            rows.append(((impact.time - at) / time - 1.0, _TIME_SD_S / time, slopes[0], slopes[1], 0.0))
        rows.append((abs(impact.before) / speed - 1.0, _SPEED_SD, slopes[2], slopes[3], 0.0))
        rows.append((impact.restitution - wall.restitution, scatter, 0.0, 0.0, 1.0))
        if k > 0:
            start = crossings[k - 1]
            rows.append(((at - start.time) / time - 1.0, _TIME_SD_S / time, slopes[0], slopes[1], 0.0))
            rows.append((abs(start.after) / speed - 1.0, _SPEED_SD, slopes[2], slopes[3], 0.0))
    table = np.array(rows).reshape(-1, 5)
    return table[:, 0], table[:, 1], table[:, 2:]


def _block_with_slopes(peak: float, wall: Wall) -> tuple[float, float, tuple[float, float, float, float]]:
    """Time and speed of a block, and relative slopes (time by α, by p, speed by α, by p)."""
    h = 1e-5
    time, speed = block_swing(peak, wall.alpha, wall.p)
    time_a, speed_a = block_swing(peak, wall.alpha + h, wall.p)
    time_p, speed_p = block_swing(peak, wall.alpha, wall.p + h)
    slopes = (
        (time_a / time - 1.0) / h,
        (time_p / time - 1.0) / h,
        (speed_a / speed - 1.0) / h,
        (speed_p / speed - 1.0) / h,
    )
    return time, speed, slopes


def total_noise(world: World) -> FloatArray:
    """Rms noise of each channel (n,), SI: white, slow and 1/f noise, a walking zero, pick-up."""
    around = world.surroundings
    if around.installation is None:
        return np.array([channel.noise_si for channel in world.rig.channels])
    parts = [1.0, *(around.sizes.get(name, 0.0) for name in ("slow_noise", "pink_noise", "zero_walk"))]
    mains = around.installation.mains_amplitude / math.sqrt(2.0)
    return np.asarray(around.installation.noise_si * np.hypot(math.hypot(*parts), mains))


def _over_ordinary_hum(world: World, effect: Drawn) -> float:
    """Amplitude of a hum over what a sound channel picks up besides noise, root of the sum of squares."""
    around = world.surroundings
    assert around.installation is not None
    mains = around.sizes.get("mains_pick_up", 0.0)
    square = 0.0
    for channel, noise_si in zip(world.rig.channels, around.installation.noise_si.tolist(), strict=True):
        if channel.id in effect.targets:
            amplitude = effect.parameters["times_noise"] * channel.noise_si
            square += (amplitude / (noise_si * max(mains, _LEAST_HUM))) ** 2
    return math.sqrt(square)


def _in_channels(
    alone: World, run: PlannedRun, course: Course, noise_si: FloatArray, sizes: Mapping[str, float]
) -> list[tuple[FloatArray, FloatArray]]:
    """What each channel shows, over its noise: a turn of the wall, (n,), and the changes beside it, (k, n).

    The turn is its own rotation once more. The changes are the effect, and what is off by one sd, for one and
    the same motion, with the zero taken out: the half width, the distance of the LVDTs' faces, and of each
    channel a gain, an S and an arch of an LVDT's line, and what its zero does. The imperfections of the
    laboratory have these `sizes`.
    """
    time_s = _times(course)
    place = Place(run.campaign_s + 600.0, abs(run.theta0))
    rng = np.random.default_rng(0)
    scene = course.scene(time_s)
    with_effect = quiet_signals(alone.rig, scene, alone.faults, rng, place)
    plain = scene if alone.faults else course.plain(time_s)
    without = quiet_signals(alone.rig, plain, (), rng, place)
    by_tape = _HALF_WIDTH_SD_M / alone.wall.half_width
    wider = replace(plain, pivot_x=plain.pivot_x * (1.0 + by_tape))
    of_half_width = quiet_signals(alone.rig, wider, (), rng, place)
    straight = sizes.get("lvdt_straightness", 0.0)
    zero = _of_zeros(sizes, time_s)
    found = []
    for row, channel in enumerate(alone.rig.channels):
        if plain.pivot_dd is not scene.pivot_dd and channel.family == "accelerometer":
            continue  # pulses of impacts that take their time are not those of the plain twin
        bench = Bench(channel, scene, place, rng)
        noise = noise_si[row] * rng.standard_normal(time_s.size)
        signal = through_electronics(with_effect[row] + noise, alone.faults, bench)
        reference = without[row]
        changes = np.zeros((_OF_RUNS + len(zero), time_s.size))
        changes[:2] = signal - noise - reference, of_half_width[row] - reference
        changes[3], changes[_OF_RUNS:] = CALIBRATION_TOLERANCE * reference, noise_si[row] * zero
        if channel.family == "lvdt":
            changes[2] = by_tape * reference
            for form, bend in enumerate(({"odd": straight, "even": 0.0}, {"odd": 0.0, "even": straight}), 4):
                changes[form] = not_straight(reference, bend, bench) - reference
        changes -= np.median(changes, axis=1, keepdims=True)
        turns = channel.family != "accelerometer"
        turn = turns * (reference - np.median(reference))
        sd = _sd(float(noise_si[row]), reference)
        found.append((turn / sd, changes / sd))
    return found


def _times(course: Course) -> FloatArray:
    """Times (n,), s, at which channels are compared: half a second before and after the motion too."""
    return np.arange(-0.5, course.motion.rest_s + 0.5, 1.0 / _RATE_HZ)


def _sd(noise_si: float, signal: FloatArray) -> float:
    """What a sample of a channel counts for: its noise, and what nobody trusts of its signal (n,), SI."""
    return math.hypot(noise_si, _MODEL_SHARE * float(np.max(np.abs(signal)))) * math.sqrt(_CORRELATED)


def _of_zeros(sizes: Mapping[str, float], time_s: FloatArray) -> FloatArray:
    """What zeros do in a run, (k, n) in noises, each by one sd: they walk, and 1/f noise is slow as well."""
    octaves, periods = math.log(_PINK_HZ[1] / _PINK_HZ[0]), np.arange(1, _SLOW_PERIODS + 1)
    sd = sizes.get("pink_noise", 0.0) * np.sqrt(np.log((periods + 0.5) / (periods - 0.5)) / octaves)
    place = np.linspace(0.0, 1.0, time_s.size)
    phase = 2.0 * math.pi * periods[:, None] * place
    slow = sd[:, None] * np.array([np.cos(phase), np.sin(phase)])
    return np.vstack([sizes.get("zero_walk", 0.0) * place, *slow])


def _beyond_motion(channels: Sequence[tuple[FloatArray, FloatArray]]) -> FloatArray:
    """Products of all changes that channels show in one run, whatever the motion and the walk of the zeros.

    `channels` are as `_in_channels` has them. The rotation is what makes them agree best at each instant.
    Rows are the effect, the half width and the faces, and each channel's own: gain, S and arch.
    """
    own, zeros = _OF_RUNS - _SHARED, channels[0][1].shape[0] - _OF_RUNS
    last = _SHARED + own * len(channels)
    size = last + zeros * len(channels)
    products = np.zeros((size, size))
    along, turns = np.zeros((size, channels[0][0].size)), np.zeros(channels[0][0].size)
    for k, (turn, changes) in enumerate(channels):
        first, walks = _SHARED + own * k, last + zeros * k
        rows = [*range(_SHARED), *range(first, first + own), *range(walks, walks + zeros)]
        products[np.ix_(rows, rows)] += changes @ changes.T
        along[rows] += turn * changes
        turns += turn**2
    along /= np.sqrt(np.maximum(turns, _LEAST_TURN))
    products -= along @ along.T
    of_zeros, known = products[last:, :last], np.eye(size - last) + products[last:, last:]
    return np.asarray(products[:last, :last] - of_zeros.T @ np.linalg.solve(known, of_zeros))


def _evidence(runs: Sequence[FloatArray], stand_for: float) -> float:
    """Squared distance of an effect from none, from the products that channels have in some runs.

    Gains, bends, half width and faces are the same in all runs. Each of these runs stands for `stand_for`.
    """
    products = stand_for * np.sum(runs, axis=0)
    known = np.eye(products.shape[0] - 1) + products[1:, 1:]
    return float(products[0, 0] - products[0, 1:] @ np.linalg.solve(known, products[1:, 0]))
