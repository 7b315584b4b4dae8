"""The rocking wall as a model of the core: the simulator's own half-cycles from the measured peaks."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core import Parameter, Prediction, Run, Scatter
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.coefficients import block_coefficients, sensor_priors, units
from daq_app.gap.rocking_model.features.families.lvdts import FACE_SKEW
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.prediction.free_forms import departed, free_times
from daq_app.gap.rocking_model.prediction.true_motion import pause_at_impact, true_rotations
from daq_app.gap.rocking_model.prediction.usual import BED, USUAL, of_bed
from daq_app.gap.rocking_model.prediction.vector import (
    HalfCycles,
    half_cycle_table,
    kernel_vector,
    restitution_of,
)
from daq_app.gap.rocking_model.prediction.wires_alone import times_carry
from daq_app.gap.rocking_model.records import Survey
from daq_app.gap.rocking_model.tolerances.walls import FLOOR_EFFECT, PUSH_RAD_S
from sim_hardware.dynamics import shooting

SCATTER_R = "scatter of r"
SCATTER_TIME = "scatter of times"
SCATTER_RELEASE = "scatter of releases"
SCATTER_SENSOR = "scatter of sensors"
FLOOR = "size of what the floor does"

_OF_FLOOR = Scatter(FLOOR, 1.0, FLOOR_EFFECT, "1", "what an irregular floor does, over what it should do")


class RockingModel:
    """Housner's block with refitted α, p, r, b and sensor calibrations; effects by the simulator's names.

    The peaks of a run are taken as measured. From each, the simulator gives the fall to the next
    impact and, backwards, the rise since the one before; the speeds on both sides of an impact then
    say what r was. Scatter of r thus enters one feature per impact and never accumulates.
    """

    name = "free rocking"
    scatters: tuple[Scatter, ...] = (
        Scatter(SCATTER_R, 0.004, 0.7, "1", "relative scatter of r from impact to impact"),
        Scatter(SCATTER_TIME, 3e-5, 1.0, "s", "what half-cycle times scatter by beyond sensor noise"),
        Scatter(SCATTER_RELEASE, 3e-5, 1.0, "s", "what the times of the first fall scatter by besides"),
        Scatter(SCATTER_SENSOR, 0.7, 0.7, "1", "repeatability of sensor coefficients, in their own units"),
    )

    def __init__(
        self,
        survey: Survey,
        channels: Mapping[str, Mapping[str, float]] | None = None,
        *,
        on_shaking_floor: bool = False,
    ) -> None:
        """`channels` are examined on their own: what a sound one may be off by in gain, lag, … (sd).

        `on_shaking_floor`: whether a run has `floor_loadings`.
        """
        self.survey = survey
        self.channels = dict(channels or {})
        self.on_shaking_floor = on_shaking_floor
        if on_shaking_floor:
            self.scatters = (*self.scatters, _OF_FLOOR)

    @property
    def nuisance(self) -> tuple[Parameter, ...]:
        s = self.survey
        return (
            Parameter(
                "alpha", s.alpha_rad, s.alpha_tolerance * s.alpha_rad, "rad", 0.02, 0.6, meaning="slenderness"
            ),
            Parameter(
                "p", s.p_rad_s, s.p_tolerance * s.p_rad_s, "rad/s", 0.5, 6.0, meaning="frequency parameter"
            ),
            Parameter("r", 0.97 * s.r_max, 0.04, "1", 0.5, 1.0, meaning="velocity restitution"),
            Parameter(
                "half_base",
                s.half_base_m,
                s.half_base_tolerance_m,
                "m",
                0.02,
                2.0,
                meaning="half width of the base",
            ),
            *USUAL,
            *(
                Parameter(f"cal_{name}_{shape}", 0.0, sd, meaning=f"{shape} of {name}", linear=True)
                for name, sound in self.channels.items()
                for shape, sd in sound.items()
            ),
            *sensor_priors(s),
        )

    def local_nuisance(self, run: Run) -> tuple[Parameter, ...]:
        assert isinstance(run, RockingRun)
        held = run.swings.held
        return (
            Parameter("zero", 0.0, 5e-5, "rad", meaning="rotation at which the wall stands upright"),
            Parameter("theta0", 0.0, held.rotation_sd + 2e-6, "rad", meaning="error of the held rotation"),
            Parameter(
                "omega0",
                held.away_rad_s,
                float(np.hypot(held.speed_sd, PUSH_RAD_S)),
                "rad/s",
                meaning="speed of the sway at release",
            ),
        )

    def predict(self, run: Run, values: Mapping[str, float]) -> Prediction:
        assert isinstance(run, RockingRun)
        values = _with_measured_inputs(run, values)
        predicted = np.empty(len(run.features))
        count = len(run.places)
        last = count + run.peaks.size
        predicted[:count], predicted[count:last] = run.cache.part(
            "swings", values, partial(swing_features, run)
        )
        predicted[last:] = block_coefficients(run, values)
        loadings = run.cache.constant("loadings", partial(_loadings, run))
        return Prediction(predicted, loadings, run.fixed_loadings)


def _with_measured_inputs(run: RockingRun, values: Mapping[str, float]) -> Mapping[str, float]:
    """The values with what is not fitted but read from the run itself: the floor's frequency and phase."""
    if "ambient.amplitude" not in values or run.vibration is None:
        return values
    seen = run.vibration
    given = {**values, "ambient.frequency": seen.frequency_hz}
    given["ambient.phase"] = seen.phase + seen.phase_sd * values.get("ambient.shift", 0.0)
    if "ambient.frequency" in values:
        given["ambient.fitted"] = values["ambient.frequency"]
    return given


def swing_features(run: RockingRun, values: Mapping[str, float]) -> tuple[FloatArray, FloatArray]:
    """Predicted times (T,) and log peaks (P,) of the half-cycles of a run."""
    # r and what else acts at impacts only moves none of the half-cycles.
    cycles = run.cache.part("half-cycles", values, partial(_half_cycles, run))
    table, true = departed(run, values, cycles) + values[BED] * of_bed(run), cycles.true
    speeds_out, speeds_in = table[:, shooting.SPEED_OUT], table[:, shooting.SPEED_IN]
    pause = pause_at_impact(values, speeds_out, np.sign(true))
    across = run.across
    times = half_cycle_times(run, table)
    times[across] += pause[run.places[across, 0]]
    times = times + times_carry(run, values)
    times = times / (1.0 + values.get("clock.error", 0.0)) + free_times(run, values)
    if run.reference == "lvdt":
        # Before an impact one face opens, after it the other.
        times[across] += np.sign(true[run.places[across, 0]]) * values[FACE_SKEW]
    k = run.peaks
    before = k - 1
    r = restitution_of(run, values, speeds_out[before], np.sign(true[before]), before)
    excess = (
        np.log(np.maximum(speeds_in[k], 1e-12)) - np.log(np.maximum(speeds_out[before], 1e-12)) - np.log(r)
    )
    slopes = peak_slopes(run)
    measured = np.log(np.abs(run.swings.peak_rad[k]))
    return times, measured - excess / slopes


def _loadings(run: RockingRun) -> dict[str, FloatArray]:
    """What each scatter does to the features, (n,), or (n, k) for the floor: no parameter changes it."""
    r, times, releases, sensors = (np.zeros(len(run.features)) for _ in range(4))
    count, last = len(run.places), len(run.places) + run.peaks.size
    r[count:last] = 1.0 / peak_slopes(run)
    times[:count] = 1.0
    releases[:count] = (run.places[:, 0] == 0) & (run.places[:, 2] == 0)
    sensors[last:] = np.concatenate([np.zeros(0), *units(run)])
    loadings = {SCATTER_R: r, SCATTER_TIME: times, SCATTER_RELEASE: releases, SCATTER_SENSOR: sensors}
    if run.floor_loadings is not None:
        loadings[FLOOR] = np.zeros((r.size, run.floor_loadings.shape[1]))
        loadings[FLOOR][:last] = run.floor_loadings
    return loadings


def half_cycle_times(run: RockingRun, table: FloatArray) -> FloatArray:
    """Time features, (T,), s, of half-cycles in a table (n, 5 + 2F), without what happens at impacts."""
    count = (table.shape[1] - shooting.FIRST_CROSSING) // 2
    # Crossings as times from their own peak: positive in the fall, negative in the rise.
    crossings = table[:, shooting.FIRST_CROSSING :].copy()
    crossings[:, count:] *= -1.0
    begin, end, k = run.cache.constant("crossings", partial(_crossings_of, run))
    times: FloatArray = crossings.take(end) - crossings.take(begin)
    times[run.across] += table[k, shooting.FALL_S] + table[k + 1, shooting.RISE_S]
    return times


def _crossings_of(run: RockingRun) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Places of the crossings, row by row, between which each time feature is, (T,) each; half-cycles before
    the impacts that it spans."""
    first, a, second, b = run.places.T
    width = 2 * run.swings.levels.shape[1]
    return first * width + a, second * width + b, first[run.across]


def peak_slopes(run: RockingRun) -> FloatArray:
    """d ln speed / d ln peak of the peaks after impacts, (P,), of the block of the survey.

    The same under every hypothesis: a slope that grew with α would make what r scatters by look smaller, and
    pull α and the pivots with it.
    """
    return run.cache.constant("slopes", partial(_slopes, run))


def _slopes(run: RockingRun) -> FloatArray:
    alpha, size = run.survey.alpha_rad, np.abs(run.swings.peak_rad[run.peaks])
    fallen = np.cos(np.maximum(alpha - size, 0.0)) - np.cos(alpha)
    return np.asarray(0.5 * size * np.sin(np.maximum(alpha - size, 0.01)) / fallen)


def _half_cycles(run: RockingRun, values: Mapping[str, float]) -> HalfCycles:
    vector = kernel_vector(run, values)
    true, levels = true_rotations(run, values)
    return HalfCycles(vector, true, levels, half_cycle_table(run, vector, true, levels))
