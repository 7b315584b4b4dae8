"""The one-page report of a diagnosis, and the traces that it shows."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from daq_app.gap.core.findings import Finding
from daq_app.gap.report import write_report
from daq_app.gap.report_figures import ProbeMap, map_axes, map_table
from daq_app.gap.traces import traces
from tests.support.gap.made_diagnosis import diagnosis
from tests.support.simulated_wall import simulate


@pytest.mark.parametrize(
    ("effect", "parameter", "value", "shown"),
    [
        ("winkler", "theta_c", 3e-4, "lvdt"),
        ("gain@wire", "error", 0.03, "wire"),
        ("lag@lvdt", "tau", 0.006, "lvdt"),
        ("wire_cosine@wire", "kappa", 0.8, "wire"),
        ("wire_anchor@wire", "height", 0.3, "wire"),
    ],
)
def test_the_trace_with_the_effect_lies_on_the_record_and_the_one_without_does_not(
    effect, parameter, value, shown
):
    (run,) = simulate({effect: {parameter: value}}, (0.25,))
    (trace,) = traces(diagnosis({f"{effect}.{parameter}": value}, ("0",)), [run])
    without, with_it = trace.rms_rad
    assert trace.shown == shown
    assert with_it < 3e-4
    assert without > 2.0 * with_it
    assert trace.time_s.shape == trace.measured_rad.shape == trace.augmented_rad.shape
    assert np.nanmax(np.abs(trace.measured_rad)) == pytest.approx(0.25 * run.survey.alpha_rad, rel=0.15)


def test_each_impact_gets_the_r_that_meets_the_next_peak():
    """Scatter of r is no effect: the trace of the true model stays on the record to its end."""
    runs = simulate({}, (0.15, -0.35))
    shown = traces(diagnosis({}, ("0", "1")), runs)
    assert [trace.run for trace in shown] == ["1", "0"]
    for trace in shown:
        peak = np.nanmax(np.abs(trace.measured_rad))
        late = trace.time_s > 0.7 * trace.time_s[-1]
        left = np.abs(trace.measured_rad - trace.augmented_rad)[late]
        assert np.nanmax(left) < 0.02 * peak


def test_a_record_that_asks_for_a_body_that_cannot_be_is_followed_as_well_as_one_that_can():
    """A wall that seems faster than a mass in one point, as one on a slipping base does."""
    (run,) = simulate({}, (0.25,))
    result, slow = diagnosis({}, ("0",)), {"p": 2.14, "half_base": 0.4528}
    parameters = tuple(replace(p, value=slow.get(p.name, p.value)) for p in result.parameters)
    loose = replace(run, survey=replace(run.survey, p_tolerance=0.05))
    (trace,) = traces(replace(result, parameters=parameters), [loose])
    assert all(0.0 < rms < 0.02 for rms in trace.rms_rad)


def test_the_page_has_a_table_of_what_instruments_were_found_to_do(tmp_path):
    hum = Finding(
        "hum@wire",
        "mains hum of 0.03 mm in the wires",
        "sensor",
        0.999,
        3e-5,
        2e-5,
        4e-5,
        "m",
        "5 of 8 runs",
        False,
    )
    found = replace(diagnosis({"viscous.zeta": 0.006}, ("0",)), findings=(hum,))
    page = write_report(found, tmp_path / "gap.html")[0].read_text(encoding="utf-8")
    assert "mains hum of 0.03 mm in the wires" in page and "5 of 8 runs" in page and "ordinary" in page


def test_the_page_holds_everything_and_says_it_safely(tmp_path):
    runs = simulate({"viscous": {"zeta": 0.006}}, (0.15,))
    dead = replace(runs[0], name="dead", channels=np.zeros_like(runs[0].channels))
    html, pdf = write_report(
        diagnosis({"viscous.zeta": 0.006}, ("0", "dead")), tmp_path / "gap.html", [*runs, dead]
    )
    page = html.read_text(encoding="utf-8")
    assert "viscous &lt;explains&gt; the gap &amp; more" in page
    assert "falls from 9.10 to" in page and "viscous.zeta" in page
    assert "Measure next: Repeat at another level" in page
    assert "In words: viscous damping of 0.60 ± 0.06 % of critical (closes 97 % of the gap alone)." in page
    assert "<stated>" not in page
    headings = re.findall("<h2>(.*?)</h2>", page)
    assert [h.split(":")[0] for h in headings] == [
        "Where",
        "Which",
        "Measured and simulated rotation",
        "How far",
        "Maps of the free forms",
        "Causes",
        "Parameters",
        "What remains",
    ]
    assert page.count("<svg") == 5
    assert "http://" not in re.sub(r"http://(www\.w3\.org|purl\.org|creativecommons\.org)", "", page)
    content = pdf.read_bytes()
    assert content.startswith(b"%PDF")
    assert len(re.findall(rb"/Type /Page\b", content)) == 1


def test_a_report_without_the_recordings_has_no_traces_and_one_without_held_out_runs_no_closure(tmp_path):
    bare = replace(diagnosis({}, ("0",)), gap=None, probe_shapes={}, limits=())
    html, _ = write_report(bare, tmp_path / "gap.html")
    page = html.read_text(encoding="utf-8")
    assert page.count("<svg") == 2
    assert "Measured and simulated" not in page and "How far" not in page


def test_a_gap_that_rises_is_said_to_rise_and_nothing_to_be_gained(tmp_path):
    worse = diagnosis({}, ("0",))
    assert worse.gap is not None
    worse = replace(worse, gap=replace(worse.gap, before=9.1, after=30.0, closure=-2.0))
    html, _ = write_report(worse, tmp_path / "gap.html")
    page = html.read_text(encoding="utf-8")
    assert "the gap rises from 9.10 to 30.00 times" in page
    assert "Nothing of what could be gained was gained." in page


def test_the_map_has_the_largest_gap_of_each_channel_and_phase():
    found = diagnosis({}, ()).where
    channels, phases = map_axes(found)
    assert (channels, phases) == (["lvdt", "wire"], ["swing", "peak", "run"])
    table = map_table(found, channels, phases)
    np.testing.assert_array_equal(table, [[9.0, 4.0, np.nan], [np.nan, np.nan, 0.9]])


def test_knots_become_curves_and_the_rest_bars():
    shape = {"p.a": (0.1, 0.0, 0.2), "p.b": (0.3, 0.2, 0.4), "p.side": (0.01, 0.0, 0.02)}
    meanings = {"p.a": "change of r at 0.1 rad/s", "p.b": "change of r at 0.3 rad/s", "p.side": "left"}
    probe = ProbeMap("r(v)", shape, meanings, "1")
    assert probe.curves == {"change of r": [(0.1, 0.1, 0.0, 0.2), (0.3, 0.3, 0.2, 0.4)]}
    assert probe.axis == "rad/s"
    assert probe.bars == [("left", 0.01, 0.0, 0.02)]
