"""The campaign report from summaries: what it says, what it leaves out, what it writes."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pypdfium2
import pytest

from daq_app.campaign.names import TestName
from daq_app.campaign.plan import load_campaign
from daq_app.campaign.report.tables import mean_of_specimens, repetition_effect, table_4_1
from daq_app.campaign.report.write import write_report
from daq_app.campaign.status import CampaignStatus, RecordedTest, TestVerdict
from daq_app.campaign.summaries.summary import Failure, MethodResult, TestSummary
from daq_app.rocking import amplitude_after, period_after, time_of_impact


def summary(
    name: str, r: float, *, good: bool = True, reasons: tuple[str, ...] = (), eav_bias: float = 0.0
) -> TestSummary:
    """A test that follows the closed forms exactly."""
    test = TestName.parse(name)
    alpha, p = (0.215, 2.20) if test.specimen == "FR1" else (0.208, 2.17)
    phi0 = {"L1": 0.15, "L2": 0.25, "L3": 0.35, "L4": 0.40}[test.level]
    n = np.arange(0, 16)
    peaks = amplitude_after(n, phi0, r) * alpha
    impacts = [time_of_impact(int(k), phi0, r, p) for k in n[1:]]
    time = np.linspace(0.0, float(impacts[-1]), 400)
    rotation = np.interp(time, [0.0, *impacts], [phi0 * alpha, *np.zeros(15)])
    return TestSummary(
        test=name,
        specimen=test.specimen,
        level=test.level,
        repetition=test.series.repetition,
        run=f"{name}.h5",
        alpha_rad=alpha,
        p_rad_s=p,
        r_max=1 - 1.5 * np.sin(alpha) ** 2,
        theta0_rad=phi0 * alpha,
        impacts_s=tuple(map(float, impacts)),
        peaks_rad=tuple(map(float, peaks)),
        periods_s=tuple(map(float, period_after(n[1:], phi0, r, p))),
        methods={
            "CRT": MethodResult(r, 0.001, points=((1, r), (2, r))),
            "EAV": MethodResult(r + eav_bias, 0.002, bias=eav_bias, points=((3, r + eav_bias),)),
        },
        time_s=time,
        rotation_rad=rotation,
        velocity_rad_s=np.gradient(rotation, time),
        good=good,
        reasons=reasons,
    )


@pytest.fixture(scope="module")
def tests() -> list[TestSummary]:
    found = [summary(f"FR1-L3-{k}", 0.895 + 0.002 * (k - 3)) for k in range(1, 6)]
    found.append(summary("FR1-L3-R", 0.885))
    found += [summary(f"FR2-L3-{k}", 0.93, eav_bias=-0.01) for k in range(1, 4)]
    found.append(summary("FR2-L2-1", 0.5, good=False, reasons=("400 samples lost while rocking",)))
    return found


@pytest.fixture(scope="module")
def status(tests: list[TestSummary], configs: Path) -> CampaignStatus:
    recorded = [
        RecordedTest(TestName.parse(t.test), TestVerdict.GOOD if t.good else TestVerdict.BAD, k)
        for k, t in enumerate(tests)
    ]
    return CampaignStatus(load_campaign(configs / "campaigns" / "costa.toml"), recorded)


def test_means_are_of_good_tests_only_and_bias_is_taken_off(tests: list[TestSummary]) -> None:
    rows = {(row.specimen, row.method): row for row in table_4_1(tests)}
    assert rows["FR2", "CRT"].mean.mean == pytest.approx(0.93)
    assert rows["FR2", "CRT"].mean.tests == 3
    assert rows["FR2", "EAV"].mean.mean == pytest.approx(0.92)
    assert rows["FR2", "EAV"].corrected.mean == pytest.approx(0.93)
    assert rows["FR1", "CRT"].ratio == pytest.approx(rows["FR1", "CRT"].mean.mean / 0.9317, abs=1e-4)


def test_the_repetition_is_compared_with_the_first_tests(tests: list[TestSummary]) -> None:
    (row,) = [row for row in repetition_effect(tests) if row.method == "CRT"]
    assert (row.specimen, row.level) == ("FR1", "L3")
    assert row.change == pytest.approx(-0.010, abs=1e-6)
    # One repetition says little while the first tests scatter by 0.003.
    assert row.change_standard_error > 0.003
    low, high = row.change_interval95
    assert (low + high) / 2 == pytest.approx(row.change)
    assert high - low == pytest.approx(2 * 2.776 * row.change_standard_error, rel=1e-3)  # t, 4 degrees


def test_what_tests_scatter_by_is_asked_of_all_levels_of_the_specimen(tests: list[TestSummary]) -> None:
    """Five first tests and one repetition know it badly: their interval is too wide."""
    others = [summary(f"FR1-L2-{k}", 0.885 + 0.002 * (k - 3)) for k in range(1, 6)]
    others.append(summary("FR1-L2-6", 0.7, good=False))
    others += [summary(f"FR2-L2-{k}", 0.5 + 0.1 * k) for k in (1, 2)]
    alone, pooled = (
        next(row for row in repetition_effect(group) if row.method == "CRT")
        for group in (tests, tests + others)
    )
    assert (alone.degrees_of_freedom, pooled.degrees_of_freedom) == (4, 8)
    assert pooled.change == pytest.approx(alone.change)
    assert np.ptp(pooled.change_interval95) < 0.9 * np.ptp(alone.change_interval95)


def test_the_last_row_is_the_mean_of_the_specimens(tests: list[TestSummary]) -> None:
    rows = table_4_1(tests)
    means = {row.method: row for row in mean_of_specimens(rows)}
    assert means["CRT"].mean.mean == pytest.approx((0.895 + 0.93) / 2, abs=2e-3)
    assert means["CRT"].mean.tests == 9 and np.isnan(means["CRT"].mean.low95)
    assert mean_of_specimens([row for row in rows if row.specimen == "FR1"]) == []


@pytest.fixture(scope="module")
def report(
    tests: list[TestSummary], status: CampaignStatus, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    folder = tmp_path_factory.mktemp("campaign") / "report"
    failure = Failure("FR1-L4-1", Path("FR1-L4-1_x.h5"), "a release but no impact")
    written = write_report(folder, "Campaign", status, tests, failures=[failure] * 41)
    assert set(written.files) == set(folder.iterdir())
    return folder


def test_report_is_complete_and_names_what_it_leaves_out(report: Path) -> None:
    names = {path.name for path in report.iterdir()}
    assert {"report.html", "report.pdf", "table_3_2.csv", "table_4_1.csv", "figure_4_4.svg"} <= names
    assert all(path.stat().st_size > 200 for path in report.iterdir())
    html = (report / "report.html").read_text(encoding="utf-8")
    assert "FR2-L2-1: 400 samples lost while rocking" in html
    assert "FR1-L4-1 (FR1-L4-1_x.h5): a release but no impact" in html
    assert html.count("<svg") == 6
    with (report / "table_3_2.csv").open(encoding="utf-8") as file:
        places = list(csv.DictReader(file))
    assert len(places) == 36
    states = {row["test"]: row["state"] for row in places}
    assert states["FR1-L3-1"] == "done"
    assert states["FR2-L2-1"] == "to be repeated"
    assert states["FR1-L1-1"] == "missing"


def test_pages_of_the_pdf_are_in_order_under_the_campaigns_title(report: Path) -> None:
    document = pypdfium2.PdfDocument(report / "report.pdf")
    headings = ["Table 4.1:", "Effect of the repetitions"]
    headings += [f"Figure 4.{number}:" for number in (1, 1, 2, 3, 3, 4)]
    headings += ["Table 3.2:", "All tests", "Not analysed", "Not analysed"]  # 41 rows: two pages
    pages = [page.get_textpage().get_text_range() for page in document]
    assert len(pages) == len(headings)
    assert [heading for heading, page in zip(headings, pages, strict=True) if heading not in page] == []
    assert document.get_metadata_value("Title") == "Campaign"


def test_drawn_in_several_processes_it_is_the_same(
    tests: list[TestSummary], status: CampaignStatus, report: Path, tmp_path: Path
) -> None:
    failure = Failure("FR1-L4-1", Path("FR1-L4-1_x.h5"), "a release but no impact")
    write_report(tmp_path, "Campaign", status, tests, failures=[failure] * 41, at_once=True)
    assert {path.name for path in tmp_path.iterdir()} == {path.name for path in report.iterdir()}
    for path in tmp_path.glob("*[!f]"):
        assert path.read_bytes() == (report / path.name).read_bytes(), path.name
    pages = zip(*(pypdfium2.PdfDocument(folder / "report.pdf") for folder in (report, tmp_path)), strict=True)
    for here, elsewhere in pages:
        assert np.array_equal(*(page.render().to_numpy() for page in (here, elsewhere)))


def test_csv_holds_the_numbers_of_the_table(tests: list[TestSummary], report: Path) -> None:
    with (report / "table_4_1.csv").open(encoding="utf-8") as file:
        rows = {(row["specimen"], row["method"]): row for row in csv.DictReader(file)}
    assert float(rows["FR1", "CRT"]["r"]) == pytest.approx(table_4_1(tests)[0].mean.mean)
    with (report / "tests.csv").open(encoding="utf-8") as file:
        assert sum(row["good"] == "False" for row in csv.DictReader(file)) == 1


def test_nothing_to_report_is_said_in_words(status: CampaignStatus, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="nothing to report"):
        write_report(tmp_path, "Campaign", status, [])
