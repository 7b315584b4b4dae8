"""Measured rotation beside the simulator's, without and with what the diagnosis found.

Both simulations come from the simulator that drives the simulated hardware. r scatters from impact to
impact on any real wall, and every miss of it shifts all that follows; so each impact gets the r that
leads to the peak that was measured next, in both simulations, and what is left is what no r explains.
Both may bend α and p within the survey's tolerance to meet the instants of the impacts.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np
from scipy.optimize import least_squares

from daq_app.config.rig import G_M_S2
from daq_app.gap.core import CannotDiagnose, Diagnosis
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.response import bessel, first_order
from daq_app.gap.rocking_model.motion.hold import from_hold
from daq_app.gap.rocking_model.motion.rotation import (
    Wire,
    anchors_turn,
    mean_rotation,
    sample_noise,
    wires_of,
    zeroed,
)
from daq_app.gap.rocking_model.motion.swings import Swings, find_swings
from daq_app.gap.rocking_model.records import GapRun, Survey
from sim_hardware.dynamics import Body, Motion, Release, Restitution
from sim_hardware.dynamics import parameters as par
from sim_hardware.dynamics.effects import MOTION_EFFECTS
from sim_hardware.dynamics.motion import motion_vector, simulate_vector

TRACE_HZ: Final = 200.0
_FINE_HZ: Final = 2000.0
"""Rate at which responses of sensors are worked out."""
_BEFORE_S = 0.1
_FASTEST: Final = 0.99
"""Frequency parameter over that of a mass in one point, √(g/R), up to which a body is tried."""
_MASS_KG = 5000.0  # free in a motion that is described by α, p and R
_MOTION: Final = frozenset(spec.name for spec in MOTION_EFFECTS)
_TIME_SD_S: Final = 3e-4
"""Error of a crossing time that the fit of α, p and the release weighs against the survey."""
_ROUNDS: Final = 6
"""Corrections of r until every peak is met: each brings the error down by about ten."""

Effects = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True, slots=True)
class Trace:
    """One run at `TRACE_HZ` to the last peak that is followed; from the release, rad, all of shape (n,)."""

    run: str
    level: str
    shown: str
    """Which sensors the rotation is read from."""
    time_s: FloatArray
    measured_rad: FloatArray
    baseline_rad: FloatArray
    augmented_rad: FloatArray

    @property
    def rms_rad(self) -> tuple[float, float]:
        """Rms of measured minus baseline, and of measured minus augmented, from the release on."""
        moving = self.time_s >= 0.0
        left = (self.measured_rad - self.baseline_rad, self.measured_rad - self.augmented_rad)
        return tuple(float(np.sqrt(np.nanmean(part[moving] ** 2))) for part in left)  # type: ignore[return-value]


_NOTED: Final = 2
"""Each so manieth sample is noted in a result: 100 Hz show a half-cycle of 50 ms."""


def noted(shown: Sequence[Trace]) -> list[dict[str, object]]:
    """Traces as the notes of a result hold them, in mrad."""

    def mrad(values: FloatArray) -> list[float]:
        return [round(float(value), 4) for value in 1e3 * np.nan_to_num(values[::_NOTED])]

    return [
        {
            "run": trace.run,
            "shown": trace.shown,
            "time_s": [round(float(value), 4) for value in trace.time_s[::_NOTED]],
            "measured_mrad": mrad(trace.measured_rad),
            "baseline_mrad": mrad(trace.baseline_rad),
            "augmented_mrad": mrad(trace.augmented_rad),
            "rms_mrad": [1e3 * value for value in trace.rms_rad],
        }
        for trace in shown
    ]


def traces(result: Diagnosis, runs: Sequence[GapRun]) -> list[Trace]:
    """Traces of the run with the largest and of the one with the smallest release.

    Runs that cannot be followed (no motion, channels that reach their range) are passed over.
    """
    traced = []
    for run in runs:
        try:
            traced.append(_rotations(run, result))
        except CannotDiagnose:
            continue
    traced.sort(key=lambda entry: -abs(float(entry[1].peak_rad[0])))
    return [_trace(result, *entry) for entry in ([traced[0], traced[-1]] if len(traced) > 1 else traced)]


def _effects_of(result: Diagnosis) -> dict[str, dict[str, float]]:
    """The effects of the best hypothesis; parameters that each run has for itself are fitted here."""
    effects: dict[str, dict[str, float]] = {name: {} for name in result.best}
    for estimate in result.effect_parameters:
        name, _, parameter = estimate.name.rpartition(".")
        effects.setdefault(name, {})[parameter] = estimate.value
    return effects


def _rotations(run: GapRun, result: Diagnosis) -> tuple[GapRun, Swings, FloatArray, str, FloatArray, float]:
    """(run from its hold on, swings and impacts of the true motion, family shown, its θ, its response)."""
    families = {name.partition("@")[2] for name in _effects_of(result)}
    shown = next((f for f in ("wire", "tiltmeter", "lvdt") if f in families), "lvdt")
    run, joint = from_hold(run)
    turned = mean_rotation(run)
    wires = joint.theta if turned is None else turned
    # What the effect does not touch tells the motion; what it touches is shown.
    true = wires if shown == "lvdt" and "lvdt" in families else joint.theta
    swings = find_swings(true, sample_noise(true, run.rate_hz), run.survey.p_rad_s, run.rate_hz, run.name)
    chosen = {"lvdt": joint.theta, "wire": wires, "tiltmeter": joint.theta}[shown]
    response = 0.0
    if shown == "tiltmeter":
        rows_of = run.indices("tiltmeter", "x")
        chosen = np.mean([zeroed(run, i) for i in rows_of], axis=0)
        response = run.sensors[rows_of[0]].time_constant_s
    return run, swings, _impacts(true, swings, run.rate_hz), shown, chosen, response


def _trace(
    result: Diagnosis,
    run: GapRun,
    swings: Swings,
    impacts_s: FloatArray,
    shown: str,
    theta: FloatArray,
    slow_s: float,
) -> Trace:
    effects = _effects_of(result)
    values = {p.name: p.value for p in result.parameters}
    motion_effects = {name: terms for name, terms in effects.items() if name in _MOTION}
    sensor_effects = {name: terms for name, terms in effects.items() if name not in _MOTION}
    fitted = replace(
        run.survey,
        alpha_rad=values["alpha"],
        p_rad_s=values["p"],
        half_base_m=values.get("half_base", run.survey.half_base_m),
    )
    follow = partial(_follow, swings, impacts_s, r=values["r"], impacts_before=run.impacts_before)
    augmented = follow(fitted, motion_effects, bend=True)
    if motion_effects:
        baseline = follow(fitted, {}, bend=True)
    elif sensor_effects:
        baseline = augmented  # the motion is the same, a family shows it differently
    else:
        baseline = follow(run.survey, {}, bend=False)  # "other parameters": than those of the rig file
    time = np.arange(-_BEFORE_S, float(swings.peak_s[-1]), 1.0 / TRACE_HZ)
    samples = np.arange(theta.size) / run.rate_hz - swings.release_s
    heights = np.array([run.sensors[i].position_m[2] for i in run.indices("wire")] or [1.0])
    see = partial(
        _seen,
        time=time,
        slow_s=slow_s,
        rest_s=swings.rest_s - swings.release_s,
        height_m=float(np.sum(heights**2) / np.sum(heights)),
        wires=wires_of(run),
    )
    return Trace(
        run.name,
        run.level,
        shown,
        time,
        np.interp(time, samples, _smoothed(theta, run.rate_hz), left=math.nan, right=math.nan),
        see(baseline, sensor_effects={}),
        see(augmented, sensor_effects=sensor_effects),
    )


def _smoothed(theta: FloatArray, rate_hz: float) -> FloatArray:
    """Running mean over one step of the trace."""
    width = max(1, round(rate_hz / TRACE_HZ))
    return np.asarray(np.convolve(theta, np.ones(width) / width, "same"))


@dataclass(frozen=True, slots=True)
class _Followed:
    motion: Motion
    delay_s: float


def _follow(
    swings: Swings,
    impacts_s: FloatArray,
    survey: Survey,
    effects: Effects,
    *,
    r: float,
    bend: bool,
    impacts_before: float,
) -> _Followed:
    """The simulation set to one run by least squares of its impact times; `bend` lets α and p move."""
    held = swings.held
    pushed = 0.03 * ("initial_velocity" in effects)
    known = (held.rotation_sd + 2e-5, held.speed_sd + 2e-5 + pushed)
    spread = np.array([0.01, *known, survey.alpha_tolerance, survey.p_tolerance])
    free = np.array([True, True, True, bend, bend])
    timed = np.isfinite(swings.fall_s[0])
    first_fall = swings.fall_s[0][timed], np.sign(swings.peak_rad[0]) * swings.levels[0][timed]

    def simulate(u: FloatArray) -> _Followed:
        full = np.zeros(5)
        full[free] = u
        delay, theta0, omega, alpha, p = full * spread
        terms = {**effects, "initial_velocity": {"omega": held.away_rad_s + omega}}
        slender = survey.alpha_rad * (1.0 + alpha)
        # α may bend, the base stays as wide as it was surveyed.
        r0 = survey.half_base_m / math.sin(slender)
        # Beyond that a body would have no inertia about its centre of mass.
        frequency = min(survey.p_rad_s * (1.0 + p), _FASTEST * math.sqrt(G_M_S2 / r0))
        vector = motion_vector(
            Body(slender, frequency, r0, _MASS_KG),
            Release(float(swings.peak_rad[0]) + theta0),
            Restitution(min(r, 1.0)),
            terms,
            duration_s=float(swings.peak_s[-1]) + 3.0,
            impacts_before=impacts_before,
        )
        return _Followed(_meet_the_peaks(vector, swings), delay)

    def misfit(u: FloatArray) -> FloatArray:
        followed = simulate(u)
        impacts = followed.motion.impact_time_s[followed.motion.impact_kind == 0][: impacts_s.size]
        late = np.full(impacts_s.size, 0.1)  # an impact that the simulation never comes to
        late[: impacts.size] = impacts + followed.delay_s - impacts_s[: impacts.size]
        theta, speed, _ = followed.motion.evaluate(first_fall[0] - followed.delay_s)
        fall = (theta - first_fall[1]) / np.maximum(np.abs(speed), 0.02)
        return np.concatenate([late / _TIME_SD_S, fall / _TIME_SD_S, u])

    return simulate(least_squares(misfit, np.zeros(int(free.sum())), diff_step=1e-3, max_nfev=20).x)


def _impacts(theta: FloatArray, swings: Swings, rate_hz: float) -> FloatArray:
    """(n,) instants from the release at which θ passes zero between two peaks."""
    places = np.round((swings.release_s + swings.peak_s) * rate_hz).astype(int)
    found = []
    for start, stop in itertools.pairwise(places):
        # The last of several passages (noise, bounce) leads to the next peak.
        passed = np.flatnonzero(np.diff(np.sign(theta[start:stop])) != 0)
        if passed.size == 0:
            raise CannotDiagnose("Two peaks lie on one side of the upright wall.")
        at = start + int(passed[-1])
        share = theta[at] / (theta[at] - theta[at + 1])
        found.append((at + float(share)) / rate_hz - swings.release_s)
    return np.array(found)


def _meet_the_peaks(vector: FloatArray, swings: Swings) -> Motion:
    """The motion whose every impact has the r that leads to the next measured peak.

    The share of energy that an impact must keep follows from the peaks on both sides of it
    (E = 1 − (1−φ)², Eqn 4.2); the few corrections make up for what the effects do in between.
    """
    vector = vector.copy()
    alpha = float(vector[par.ALPHA])

    def energy(peaks: FloatArray) -> FloatArray:
        phi = np.clip(np.abs(peaks) / alpha, 1e-6, 0.95)
        return np.asarray(1.0 - (1.0 - phi) ** 2)

    wanted = np.log(energy(swings.peak_rad))
    wanted[0] = math.log(energy(np.array([vector[par.THETA0]]))[0])
    factors = np.zeros(wanted.size - 1)  # ln of each impact's r over the mean r
    vector[par.SCATTER] = 1.0
    motion = simulate_vector(vector, np.expm1(factors))
    for _ in range(_ROUNDS):
        known = min(wanted.size, motion.peak_rotation_rad.size)
        if known < 2:
            break
        off = wanted[:known] - np.log(energy(motion.peak_rotation_rad[:known]))
        factors[: known - 1] += 0.5 * np.diff(off)
        factors = np.clip(factors, -0.7, 0.7)
        motion = simulate_vector(vector, np.expm1(factors))
    return motion


def _seen(
    followed: _Followed,
    time: FloatArray,
    sensor_effects: Effects,
    slow_s: float,
    rest_s: float,
    height_m: float,
    wires: Sequence[Wire],
) -> FloatArray:
    """A motion as the family that is shown would show it; `height_m` is where the wires look."""
    fine = np.arange(time[0], time[-1] + 1.0 / _FINE_HZ, 1.0 / _FINE_HZ)
    terms = {name.partition("@")[0]: values for name, values in sensor_effects.items()}
    clock = 1.0 + terms.get("clock", {}).get("error", 0.0)
    late = followed.delay_s + terms.get("lag", {}).get("tau", 0.0)
    theta = followed.motion.rotation(fine * clock - late)
    theta = first_order(theta, slow_s, _FINE_HZ)
    theta = first_order(theta, terms.get("slow_response", {}).get("tau", 0.0), _FINE_HZ)
    if delay := terms.get("filter_delay", {}).get("tau", 0.0):
        theta = bessel(theta, delay, _FINE_HZ)
    theta = theta * (1.0 + terms.get("gain", {}).get("error", 0.0))
    if higher := terms.get("wire_anchor", {}).get("height", 0.0):
        theta = theta + anchors_turn(wires, theta, higher)
    theta = theta + terms.get("wire_cosine", {}).get("kappa", 0.0) * height_m * theta**2
    # A drift of all LVDTs lifts the joint and turns nothing; one of the wires looks like a rotation.
    for name, per in (("drift@wire", height_m), ("drift@tiltmeter", 1.0)):
        theta = theta + sensor_effects.get(name, {}).get("rate", 0.0) / per * (fine - rest_s)
    return np.asarray(np.interp(time, fine, theta))
