"""Channels that freeze, leap or go in steps are left out; a test that one family hides is found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from daq_app.config import load_rig
from daq_app.rocking import AnalysisOptions, TestAnalysis, TestRecord, analyse_record
from studies.restitution.walls import SimulatedEffect

Floats = NDArray[np.float64]
Change = Callable[[Floats, float], Floats]

RIG = load_rig(Path(__file__).parents[3] / "configs" / "fr1.toml")
TRUE_R = 0.895
WIRES, LVDTS = ("WP-",), ("LV-",)
OPTIONS = AnalysisOptions(bias_runs=0, fit=False, keep_series=False)


def analysed(made, which: tuple[str, ...], change: Change) -> TestAnalysis:
    """A sound test with the channels whose ids begin with one of `which` changed."""
    test = made(phi=0.35, r=TRUE_R, side=-1, seed=8, full=True)
    si = test.si.copy()
    rows = [k for k, name in enumerate(test.rig.channel_ids) if name.startswith(which)]
    si[rows] = change(si[rows], test.rate_hz)
    return analyse_record(
        TestRecord.from_array(test.rig, test.rate_hz, si, time_offsets_s=test.offsets_s), OPTIONS
    )


def times(factor: float) -> Change:
    return lambda values, rate_hz: values * factor


def in_steps(metres: float) -> Change:
    return lambda values, rate_hz: metres * np.round(values / metres)


def frozen_for_moments(share: float, seconds: float) -> Change:
    """A loose contact: the last reading stays for moments, a share of the time."""

    def change(values: Floats, rate_hz: float) -> Floats:
        rng, out = np.random.default_rng(3), values.copy()
        size = round(seconds * rate_hz)
        for row in out:
            for start in rng.integers(0, row.size - size, round(share * row.size / size)):
                row[start : start + size] = row[start]
        return out

    return change


def struck(metres: float) -> Change:
    """A loose contact: single samples are off, about once a second."""

    def change(values: Floats, rate_hz: float) -> Floats:
        out = values.copy()
        out[:, 1000 :: round(0.9 * rate_hz)] += metres
        return out

    return change


def at_its_stop(metres: float) -> Change:
    """A sensor that goes no further than this, with the electronics' noise on it."""

    def change(values: Floats, rate_hz: float) -> Floats:
        noise = np.random.default_rng(4).normal(0.0, 2e-6, values.shape)
        return np.clip(values, -metres, metres) + noise

    return change


def noisier(metres: float) -> Change:
    return lambda values, rate_hz: values + np.random.default_rng(5).normal(0.0, metres, values.shape)


def filtered(seconds: float) -> Change:
    """A window of this group delay, as converters have: late, and rounder."""

    def change(values: Floats, rate_hz: float) -> Floats:
        taps = np.hanning(round(2.0 * seconds * rate_hz) + 3)[1:-1]
        before = np.repeat(values[:, :1], taps.size - 1, axis=1)
        whole = np.hstack([before, values])
        return np.array([np.convolve(row, taps / taps.sum(), mode="valid") for row in whole])

    return change


@pytest.mark.parametrize(
    ("which", "change", "family", "kind"),
    [
        (WIRES, in_steps(1e-3), "wires", "steps"),
        (("WP-3",), in_steps(1e-3), "wires", "steps"),
        (LVDTS, in_steps(1e-3), "LVDTs", "steps"),
        (("LV-A03",), in_steps(1e-3), "LVDTs", "steps"),
        (WIRES, frozen_for_moments(0.1, 0.2), "wires", "still"),
        (("WP-3",), frozen_for_moments(0.1, 0.2), "wires", "still"),
        (LVDTS, frozen_for_moments(0.1, 0.2), "LVDTs", "still"),
        (WIRES, frozen_for_moments(0.1, 0.02), "wires", "leaps"),
        (("WP-3",), struck(0.02), "wires", "leaps"),
        (WIRES, at_its_stop(0.02), "wires", "still"),
        (("WP-3",), at_its_stop(0.02), "wires", "still"),
        (LVDTS, at_its_stop(0.005), "LVDTs", "still"),
        (("LV-A03",), filtered(0.02), "LVDTs", "late"),
        (("LV-A03",), times(1.1), "LVDTs", "gain"),
        (WIRES, filtered(0.02), "wires", "late"),
        (LVDTS, filtered(0.02), "LVDTs", "late"),
    ],
)
def test_what_is_not_fit_is_named_and_left_out_and_r_is_right(made, which, change, family, kind):
    analysis = analysed(made, which, change)
    named = [finding for finding in analysis.findings if (finding.family, finding.kind) == (family, kind)]
    assert named, [finding.text for finding in analysis.findings]
    assert all(finding.treatment == "left out" for finding in named)
    assert bool(named[0].channels) == (which not in (WIRES, LVDTS))
    assert analysis.verdict.trust == "remarks"
    assert analysis.verdict.r == pytest.approx(TRUE_R, abs=0.0015)
    assert analysis.verdict.used == (("LVDTs",) if which == WIRES else ("wires",))


def test_a_family_is_named_once_and_is_not_called_noisy_for_its_leaps(made):
    analysis = analysed(made, LVDTS, in_steps(1e-3))
    (named,) = analysis.findings
    assert "all 24" in named.text and "nothing is compared with them" in named.text


def test_noise_is_named_and_only_the_error_of_r_has_it(made):
    sound = analysed(made, WIRES, noisier(0.0))
    noisy = analysed(made, WIRES, noisier(2e-3))
    assert [(f.family, f.kind, f.channels) for f in noisy.findings] == [("wires", "noise", ())]
    assert noisy.verdict.trust == "remarks"
    assert noisy.verdict.standard_error > sound.verdict.standard_error
    low, high = noisy.verdict.interval95
    assert low <= TRUE_R <= high


@pytest.mark.parametrize(
    ("effect", "parameters", "blamed", "used"),
    [
        ("swap@wire", {"places": 1.0}, "wires", "LVDTs"),
        ("wire_sag@wire", {"kappa": 0.01}, "wires", "LVDTs"),
        ("swap@tiltmeter", {"places": 1.0}, "tiltmeters", "wires"),
    ],
)
def test_a_test_that_one_family_hides_is_found_by_the_other_two(effect, parameters, blamed, used):
    test = SimulatedEffect(effect, parameters).test(RIG, 78500)
    analysis = analyse_record(test.record(), replace(OPTIONS, keep_series=True))
    assert analysis.found
    (named,) = (finding for finding in analysis.findings if finding.severity == "warning")
    assert (named.family, named.kind, named.treatment) == (blamed, "motion", "left out")
    assert analysis.verdict.used == (used,)
    assert analysis.verdict.trust == "remarks"
    assert analysis.verdict.r == pytest.approx(test.truth["restitution"], abs=0.0015)
    theta0 = test.truth["theta0_rad"]
    assert analysis.theta0_rad == pytest.approx(theta0, rel=0.005)
    assert analysis.theta0_by_family["best"].value == pytest.approx(theta0, rel=0.005)
    assert not any("θ0" in note.text for note in analysis.notes)
    assert not any(view.used for view in analysis.families if view.family == blamed)
    best, rotation = analysis.series.best_rotation_rad, analysis.series.rotation_rad
    assert np.abs(best - rotation).max() < 0.01 * abs(theta0)


@pytest.mark.parametrize("amplitude", [0.1, 0.3])
def test_a_floor_that_shakes_is_named_and_r_is_doubtful(amplitude):
    shaken = SimulatedEffect("ambient", {"amplitude": amplitude}).test(RIG, 78500)
    analysis = analyse_record(shaken.record(), OPTIONS)
    named = [finding for finding in analysis.findings if finding.family == "floor"]
    assert [finding.kind for finding in named] == ["vibration"]
    assert named[0].size == pytest.approx(amplitude / np.sqrt(2.0), rel=0.3)
    assert analysis.verdict.trust == "doubtful"
