"""The page of one test: what is said of it, what it is compared with, and that it survives on disk."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from daq_app.campaign.names import TestName
from daq_app.campaign.result.family_rows import family_rows
from daq_app.campaign.result.motions import measured_periods, period_deviation, theory_motion
from daq_app.campaign.result.report import write_result
from daq_app.campaign.result.words import repetition_rows, verdict_sentence
from daq_app.campaign.status import RecordedTest, TestVerdict
from daq_app.campaign.summaries.mark import AnalysisMark
from daq_app.campaign.summaries.store import NotKept, kept_analysis
from daq_app.campaign.summaries.summary import MethodResult, TestSummary, judged
from daq_app.rocking import free_rocking
from daq_app.rocking.analysis.options import AnalysisOptions
from daq_app.rocking.families.verdict import FamilyView, RVerdict

ALPHA, P = 0.215, 2.20


def summary(name: str, r: float = 0.9, phi0: float = 0.35, **changes: object) -> TestSummary:
    """A test that follows Housner's block exactly."""
    test = TestName.parse(name)
    motion = free_rocking(phi0 * ALPHA, r, P, ALPHA, smallest_peak_rad=2e-3)
    time = np.arange(-0.3, float(motion.impacts_s[-1]) + 0.3, 0.005)
    rotation, velocity = motion.at(time)
    made = TestSummary(
        test=name,
        specimen=test.specimen,
        level=test.level,
        repetition=test.repetition,
        run=f"{name}.h5",
        alpha_rad=ALPHA,
        p_rad_s=P,
        r_max=0.9317,
        theta0_rad=phi0 * ALPHA,
        impacts_s=tuple(map(float, motion.impacts_s)),
        peaks_rad=tuple(map(float, motion.peaks_rad)),
        periods_s=tuple(map(float, 2 * np.diff(motion.impacts_s))),
        methods={
            "CRT": MethodResult(r, 0.002, 0.001, 0.0005, points=((1, r), (2, r))),
            "EAV": MethodResult(r, 0.004, points=((3, r),)),
        },
        time_s=time,
        rotation_rad=rotation,
        velocity_rad_s=velocity,
        good=True,
    )
    return dataclasses.replace(made, **changes)  # type: ignore[arg-type]


FAMILIES = (
    FamilyView("wires", 0.07525, 5e-5, 0.9, 0.001, 0.901, 0.0012, interval95_eav=(0.898, 0.902), used=True),
    FamilyView("LVDTs", 0.0753, 6e-5, 0.8, 0.001, interval95_eav=(0.798, 0.802), remarks=("slow",)),
    FamilyView("tiltmeters", 0.0752, 4e-5, used=True),
    FamilyView("survey", alpha_rad=ALPHA, p_rad_s=P),
)
VERDICT = RVerdict(0.9, 0.001, (0.898, 0.902), "doubtful", ("wires",), (), ("wires and LVDTs differ",))


def test_exact_motion_agrees_with_its_own_theory() -> None:
    test = summary("FR1-L3-2")
    found = theory_motion(test)
    assert found is not None
    rocking = test.time_s < test.impacts_s[-1]
    assert np.max(np.abs(found[1] - test.rotation_rad)[rocking]) < 1e-9
    phi, periods = measured_periods(test)
    assert phi.size == periods.size == len(test.impacts_s) - 1
    deviation = period_deviation(test)
    # (4.1) is the linearised theory: it differs from the exact motion by a fraction of a percent.
    assert deviation is not None and abs(deviation) < 0.01


def test_there_is_no_theory_without_r_and_no_periods_without_impacts() -> None:
    bare = summary("FR1-L3-2", methods={}, impacts_s=(), peaks_rad=(0.075,))
    assert theory_motion(bare) is None
    assert period_deviation(bare) is None


def test_the_verdict_is_a_sentence() -> None:
    assert verdict_sentence(summary("FR1-L3-2")) == "Good."
    assert "offered again" in verdict_sentence(
        summary("FR1-L3-2", good=False, reasons=("400 samples are missing",))
    )


def test_a_doubtful_r_is_not_called_good() -> None:
    doubtful = summary("FR1-L3-2", trust="doubtful", reasons=("half-cycles end slower than they begin",))

    assert verdict_sentence(doubtful) == (
        "Well recorded, but r is doubtful: half-cycles end slower than they begin."
    )


def test_the_page_shows_what_each_family_says_with_intervals(tmp_path: Path) -> None:
    test = summary("FR1-L3-2", families=FAMILIES, verdict=VERDICT)

    html, _ = write_result(tmp_path / "FR1-L3-2_x.h5", test)
    text = html.read_text(encoding="utf-8")

    assert family_rows(test)[:2] == [
        ("wires *", "75.25 ± 0.10", "0.9000 ± 0.0020", "0.9010", "–", "–", ""),
        ("LVDTs", "75.30 ± 0.12", "0.8000 ± 0.0020", "–", "–", "–", "slow"),
    ]
    assert all(cell in text for row in family_rows(test) for cell in row)
    assert "0.8980 … 0.9020" in text and "DOUBTFUL" in text


def test_the_comparison_ends_with_the_test_itself() -> None:
    test = summary("FR1-L3-3")
    rows = repetition_rows(test, [summary("FR1-L3-1", 0.91), summary("FR1-L3-2", good=False)])
    assert [row.test for row in rows] == ["FR1-L3-1", "FR1-L3-2", "FR1-L3-3"]
    assert [row.this for row in rows] == [False, False, True]
    assert rows[0].r["CRT"] == 0.91
    assert not rows[1].good


def test_page_and_pdf_are_written_beside_the_run(tmp_path: Path) -> None:
    run = tmp_path / "FR1-L3-2_x.h5"
    test = summary("FR1-L3-2", reasons=("a <b>rope</b> moved",))
    html, pdf = write_result(run, test, [summary("FR1-L3-1")])
    text = html.read_text(encoding="utf-8")
    assert (html.name, pdf.name) == ("FR1-L3-2_x.result.html", "FR1-L3-2_x.result.pdf")
    assert "0.9000" in text and "<svg" in text and "FR1-L3-1" in text
    assert "&lt;b&gt;rope" in text, "words of a person are no markup"
    assert "http://" not in text.replace("http://www.w3.org", "").replace("http://purl.org", "").replace(
        "http://creativecommons.org", ""
    ), "the page must open without the web"
    assert pdf.read_bytes().startswith(b"%PDF")
    assert sorted(path.name for path in tmp_path.iterdir()) == [html.name, pdf.name]


@pytest.mark.parametrize("damage", [b"", b"{", b'{"format": 1}', b"[]", b'{"format": 9, "run_bytes": 3}'])
def test_a_damaged_summary_is_made_anew(tmp_path: Path, damage: bytes) -> None:
    run = tmp_path / "run.h5"
    run.write_bytes(b"abc")
    run.with_suffix(".result.json").write_bytes(damage)
    with pytest.raises(NotKept):
        kept_analysis(run, AnalysisMark.of(run, AnalysisOptions()))


def test_the_verdict_that_holds_now_counts() -> None:
    test = summary("FR1-L3-2", reasons=("noted",))
    rejected = RecordedTest(TestName.parse("FR1-L3-2"), TestVerdict.BAD, 1, None, "rope")
    assert judged(test, rejected).reasons == ("rope",)
    assert not judged(test, rejected).good
    again = dataclasses.replace(rejected, verdict=TestVerdict.GOOD, reason="")
    assert judged(judged(test, rejected), again).good
