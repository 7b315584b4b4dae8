"""An instrument that lies is named with its family and kind, and r stays right or is not called good."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from daq_app.rocking import AnalysisOptions, TestAnalysis, TestRecord, analyse_record
from daq_app.rocking.families.channels.compared_channels import ComparedChannels

Floats = NDArray[np.float64]
Change = Callable[[Floats, float], Floats]

TRUE_R = 0.895


def slow(seconds: float) -> Change:
    def change(values: Floats, rate_hz: float) -> Floats:
        keep = np.exp(-1.0 / rate_hz / seconds)
        return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values, axis=1))

    return change


def late(seconds: float) -> Change:
    def change(values: Floats, rate_hz: float) -> Floats:
        by = round(seconds * rate_hz)
        return np.concatenate([np.repeat(values[:, :1], by, axis=1), values[:, :-by]], axis=1)

    return change


def times(factor: float) -> Change:
    return lambda values, rate_hz: values * factor


def hum(metres: float) -> Change:
    def change(values: Floats, rate_hz: float) -> Floats:
        wave = np.sin(2.0 * np.pi * 50.013 * np.arange(values.shape[1]) / rate_hz + 0.3)
        return np.asarray(values + metres * wave)

    return change


def drift(metres_per_s: float) -> Change:
    return lambda values, rate_hz: values + metres_per_s * np.arange(values.shape[1]) / rate_hz


def analysed(made, which: tuple[str, ...], change: Change) -> TestAnalysis:
    """A sound test with the channels whose ids begin with one of `which` changed."""
    test = made(phi=0.35, r=TRUE_R, side=-1, seed=8, full=True)
    si = test.si.copy()
    rows = [k for k, name in enumerate(test.rig.channel_ids) if name.startswith(which)]
    si[rows] = change(si[rows], test.rate_hz)
    record = TestRecord.from_array(test.rig, test.rate_hz, si, time_offsets_s=test.offsets_s)
    return analyse_record(record, AnalysisOptions(bias_runs=0, fit=False, keep_series=False))


WIRES, LVDTS, TILTS = ("WP-",), ("LV-",), ("TL-1X", "TL-2X")


def test_a_sound_test_is_good_without_a_remark(made):
    analysis = analysed(made, WIRES, times(1.0))
    assert analysis.findings == ()
    assert analysis.verdict.trust == "good"
    low, high = analysis.verdict.interval95
    assert low <= TRUE_R <= high


@pytest.mark.parametrize(
    ("which", "change", "family", "kind"),
    [
        (WIRES, slow(0.02), "wires", "slow"),
        (WIRES, slow(0.03), "wires", "slow"),
        (LVDTS, slow(0.02), "LVDTs", "slow"),
        (WIRES, late(0.008), "wires", "late"),
        (WIRES, late(0.03), "wires", "late"),
        (LVDTS, late(0.01), "LVDTs", "late"),
        (WIRES, hum(4.7e-3), "wires", "hum"),
        (WIRES, times(-1.0), "wires", "reversed"),
        (TILTS, times(-1.0), "tiltmeters", "reversed"),
        (WIRES, times(0.1), "wires", "unit"),
        (("WP-3",), times(1.012), "wires", "gain"),
        (("WP-2",), drift(3e-4), "wires", "drift"),
        (WIRES, times(1.03), "wires", "gain"),
    ],
)
def test_a_fault_is_named_and_r_stays_right(made, which, change, family, kind):
    analysis = analysed(made, which, change)
    assert (family, kind) in {(finding.family, finding.kind) for finding in analysis.findings}
    assert analysis.verdict.trust != "good"
    assert analysis.verdict.r == pytest.approx(TRUE_R, abs=0.002)
    assert any(finding.text in {note.text for note in analysis.notes} for finding in analysis.findings)


def test_late_wires_are_put_in_step(made):
    sound, shifted = analysed(made, WIRES, times(1.0)), analysed(made, WIRES, late(0.03))
    expected = [cycle.start_s for cycle in sound.half_cycles[1:10]]
    assert [c.start_s for c in shifted.half_cycles[1:10]] == pytest.approx(expected, abs=5e-4)


def test_a_single_wire_that_deviates_is_left_out(made):
    analysis = analysed(made, ("WP-3",), times(1.012))
    (finding,) = analysis.findings
    assert finding.channels == ("WP-3",)
    assert finding.size == pytest.approx(0.012, abs=0.002)
    assert analysis.theta0_by_family["wires"].value == pytest.approx(-0.35 * 0.215, rel=1e-3)


@pytest.mark.parametrize(("gain", "named"), [(0.0105, False), (0.013, True)])
def test_a_wire_is_named_for_a_gain_that_chance_makes_in_less_than_one_family_of_five_hundred(gain, named):
    """The first of these gains chance makes in four families of a thousand."""
    none = np.zeros(5)
    wires = ComparedChannels(np.array([0.0015, -0.0015, 0.002, -0.002, gain]), none, none)

    assert (wires.outlier() is not None) == named


def test_the_table_shows_each_family_beside_the_survey(made):
    families = {view.family: view for view in analysed(made, WIRES, slow(0.02)).families}
    assert set(families) == {"wires", "LVDTs", "tiltmeters", "accelerometers", "survey"}
    assert families["LVDTs"].used and not families["wires"].used
    assert families["wires"].remarks == ("slow",)
    assert families["LVDTs"].alpha_rad == pytest.approx(families["survey"].alpha_rad, rel=0.02)
    assert families["wires"].alpha_rad > 1.01 * families["survey"].alpha_rad


def test_the_error_of_theta0_holds_the_noise_that_the_tiltmeters_show(made):
    noise_rad, samples = 0.01, 2 * 0.48 * 4000

    def noisy(values: Floats, rate_hz: float) -> Floats:
        return values + np.random.default_rng(1).normal(0.0, noise_rad, values.shape)

    quiet, loud = (
        analysed(made, TILTS, change).theta0_by_family["tiltmeters"].sigma for change in (times(1.0), noisy)
    )
    of_noise = noise_rad / np.sqrt(samples)
    assert 0.8 * of_noise < np.sqrt(loud**2 - quiet**2) < 2.5 * of_noise


def test_a_filter_that_wires_and_lvdts_have_in_common_is_told_and_r_is_not_called_good(made):
    """They agree with each other; the accelerometers alone show the impacts before them."""
    analysis = analysed(made, (*WIRES, *LVDTS), slow(0.01))
    (finding,) = [f for f in analysis.findings if f.kind == "late"]

    assert finding.size == pytest.approx(-0.01, abs=0.002)
    assert "a filter that wires and LVDTs have in common" in finding.text and "EAV too low" in finding.text
    assert analysis.verdict.trust != "good"


def test_readings_so_coarse_that_a_held_wall_shows_no_noise_are_analysed(made):
    test = made(phi=0.35, r=TRUE_R, side=-1, seed=8, full=True)
    si = test.si.copy()
    rows = [k for k, name in enumerate(test.rig.channel_ids) if name.startswith(WIRES)]
    si[rows] = np.round(si[rows] / 0.003) * 0.003
    record = TestRecord.from_array(test.rig, test.rate_hz, si, time_offsets_s=test.offsets_s)
    analysis = analyse_record(record, AnalysisOptions(bias_runs=0, keep_series=False))
    low, high = analysis.verdict.interval95

    assert analysis.verdict.trust != "good" and low <= TRUE_R <= high
