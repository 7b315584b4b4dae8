"""The analysis kept beside a run: taken to the last digit, or refused with the reason."""

from __future__ import annotations

import dataclasses
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from daq_app.campaign.recorded import RunAccount
from daq_app.campaign.report.collect import collect
from daq_app.campaign.result.result import load_result, page_is_current
from daq_app.campaign.status import TestFacts, TestVerdict
from daq_app.campaign.summaries.mark import ANALYSIS_CODE, AnalysisMark, digest_of, surroundings
from daq_app.campaign.summaries.store import SUFFIX, KeptAnalysis, NotKept, keep_analysis, kept_analysis
from daq_app.campaign.summaries.summary import MethodResult, TestSummary
from daq_app.campaign.verdicts import give_place, give_verdict
from daq_app.cli.app import build_app
from daq_app.rocking.analysis.options import AnalysisOptions
from daq_app.rocking.families.verdict import FamilyView, RVerdict
from daq_app.runfile import open_run

NUMBERS = st.floats(allow_nan=True, allow_infinity=True)
TUPLES = st.lists(NUMBERS, max_size=4).map(tuple)
ARRAYS = st.lists(NUMBERS, max_size=5).map(lambda values: np.array(values, dtype=np.float64))
WORDS = st.text(max_size=8)
INTERVALS = st.none() | st.tuples(NUMBERS, NUMBERS)


def dataclass_of(kind: Any, **strategies: Any) -> st.SearchStrategy[Any]:
    """A dataclass whose fields of type float are any number at all; the others as given."""
    numbers = {f.name: NUMBERS for f in dataclasses.fields(kind) if f.type == "float"}
    return st.builds(kind, **{**numbers, **strategies})


METHODS = dataclass_of(
    MethodResult, points=st.lists(st.tuples(st.integers(1, 40), NUMBERS), max_size=3).map(tuple)
)
VIEWS = dataclass_of(
    FamilyView,
    family=WORDS,
    impacts=st.integers(0, 60),
    interval95_eav=INTERVALS,
    interval95_crt=INTERVALS,
    used=st.booleans(),
    remarks=st.lists(WORDS, max_size=2).map(tuple),
)
VERDICTS = dataclass_of(
    RVerdict,
    r=st.none() | NUMBERS,
    standard_error=st.none() | NUMBERS,
    interval95=INTERVALS,
    trust=st.sampled_from(["good", "remarks", "doubtful"]),
    used=st.lists(WORDS, max_size=2).map(tuple),
    left_out=st.just(()),
    reasons=st.lists(WORDS, max_size=2).map(tuple),
)
SUMMARIES = dataclass_of(
    TestSummary,
    test=WORDS,
    specimen=WORDS,
    level=WORDS,
    repetition=st.booleans(),
    run=WORDS,
    impacts_s=TUPLES,
    peaks_rad=TUPLES,
    periods_s=TUPLES,
    methods=st.dictionaries(st.sampled_from(["EAV", "CRT", "fit"]), METHODS, max_size=3),
    time_s=ARRAYS,
    rotation_rad=ARRAYS,
    velocity_rad_s=ARRAYS,
    good=st.booleans(),
    trust=WORDS,
    verdict=st.none() | VERDICTS,
    families=st.lists(VIEWS, max_size=3).map(tuple),
    reasons=st.lists(WORDS, max_size=2).map(tuple),
)

FACTS = dataclass_of(
    TestFacts,
    theta0_over_alpha=st.none() | NUMBERS,
    r=st.dictionaries(st.sampled_from(["EAV", "CRT"]), NUMBERS, max_size=2),
    operator=WORDS,
    notes=st.lists(WORDS, max_size=2).map(tuple),
)
ACCOUNTS = st.builds(RunAccount, verdict=st.sampled_from(TestVerdict), facts=FACTS)
KEPT = st.builds(KeptAnalysis, account=ACCOUNTS, summary=SUMMARIES)


def digits(summary: TestSummary) -> str:
    """Every number of a summary as Python writes it: equal only where all bits are."""
    plain = {
        f.name: value.tolist() if isinstance(value := getattr(summary, f.name), np.ndarray) else value
        for f in dataclasses.fields(summary)
    }
    return repr(plain)


@pytest.fixture(scope="module")
def folder(simulated_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one run whose analysis is kept."""
    folder = tmp_path_factory.mktemp("kept")
    shutil.copy(simulated_run, folder)
    assert "no analysis is kept" in collect(folder, workers=1).origin
    return folder


@pytest.fixture
def run(folder: Path, tmp_path: Path) -> Path:
    """A copy of that run with its kept analysis, to be changed."""
    for name in (f"FR1-L1-1{suffix}" for suffix in (".h5", SUFFIX)):
        shutil.copy(folder / name, tmp_path)
    return tmp_path / "FR1-L1-1.h5"


def mark_of(run: Path, **options: Any) -> AnalysisMark:
    return AnalysisMark.of(run, AnalysisOptions(**options))


@given(kept=KEPT)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_analysis_comes_back_to_the_last_digit(tmp_path: Path, kept: KeptAnalysis) -> None:
    run = tmp_path / "run.h5"
    run.write_bytes(b"a run")
    keep_analysis(run, mark_of(run), kept)
    again = kept_analysis(run, mark_of(run))
    assert digits(again.summary) == digits(kept.summary)
    assert repr(again.account) == repr(kept.account)


def test_a_kept_analysis_is_taken_and_is_the_fresh_one(run: Path) -> None:
    kept = collect(run.parent, workers=1)
    fresh = collect(run.parent, workers=1, anew=True)
    assert kept.origin == "Analyses: 1 kept beside their runs."
    assert fresh.origin == "Analyses: FR1-L1-1 made anew (as asked for)."
    assert digits(kept.tests[0]) == digits(fresh.tests[0])


def test_a_run_whose_analysis_is_kept_is_not_opened(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = collect(run.parent, workers=1, anew=True)

    def never(path: Path) -> None:
        raise AssertionError(f"{path} was opened")

    monkeypatch.setattr("daq_app.campaign.summaries.of_run.open_run", never)
    kept = collect(run.parent, workers=1)
    assert repr(kept.recorded) == repr(opened.recorded)
    assert digits(kept.tests[0]) == digits(opened.tests[0])


@given(kept=KEPT, content=st.binary(min_size=1, max_size=64), data=st.data())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=20)
def test_a_run_of_which_one_byte_differs_has_nothing_kept(
    tmp_path: Path, kept: KeptAnalysis, content: bytes, data: st.DataObject
) -> None:
    run = tmp_path / "run.h5"
    run.write_bytes(content)
    keep_analysis(run, mark_of(run), kept)
    place = data.draw(st.integers(0, len(content) - 1))
    run.write_bytes(content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :])
    with pytest.raises(NotKept, match="another one than was analysed"):
        kept_analysis(run, mark_of(run))


@pytest.mark.parametrize(
    ("key", "reason"),
    [("run_sha256", "the run file is another one"), ("code_sha256", "by another version of the program")],
)
def test_the_analysis_of_another_run_or_program_is_made_anew_and_said(
    run: Path, key: str, reason: str
) -> None:
    path = run.with_suffix(SUFFIX)
    document = json.loads(path.read_text())
    document["mark"][key] = "0" * 64
    document["summary"]["methods"]["EAV"]["r"] = 0.5
    path.write_text(json.dumps(document))
    found = collect(run.parent, workers=1)
    assert f"FR1-L1-1 made anew ({reason}" in found.origin.replace("it was analysed ", "")
    assert found.tests[0].methods["EAV"].r != 0.5
    assert collect(run.parent, workers=1).origin == "Analyses: 1 kept beside their runs."


def test_another_choice_is_analysed_anew_and_not_kept(run: Path) -> None:
    other = AnalysisOptions(bias_runs=0, fit=False)
    for _ in range(2):
        found = collect(run.parent, workers=1, options=other)
        assert "with other options" in found.origin
        assert set(found.tests[0].methods) == {"EAV", "CRT"}
    assert collect(run.parent, workers=1).origin == "Analyses: 1 kept beside their runs."


@pytest.mark.parametrize("key", ["run_sha256", "code_sha256"])
@given(place=st.integers(0, 63))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=20)
def test_a_mark_that_differs_in_one_digit_is_refused(run: Path, key: str, place: int) -> None:
    mark = mark_of(run)
    old = getattr(mark, key)
    other = old[:place] + ("0" if old[place] != "0" else "1") + old[place + 1 :]
    with pytest.raises(NotKept):
        kept_analysis(run, dataclasses.replace(mark, **{key: other}))


@pytest.mark.parametrize(
    "change",
    [{"velocity_cutoff_hz": 30.0}, {"zero_at_rest": True}, {"fit": False}, {"bias_runs": 5}, {"seed": 0}],
)
def test_every_option_is_in_the_mark(run: Path, change: dict[str, Any]) -> None:
    with pytest.raises(NotKept, match="other options"):
        kept_analysis(run, mark_of(run, **change))


def test_a_change_of_any_module_of_the_analysis_gives_another_mark(tmp_path: Path) -> None:
    for number, package in enumerate(ANALYSIS_CODE):
        place = tmp_path / package / "inside"
        place.mkdir(parents=True)
        (place / "module.py").write_text(f"value = {number}\n")
    (tmp_path / "config" / "products.toml").write_text("gain = 1\n")
    (tmp_path / "waiting.py").write_text("limit_s = 1\n")
    before = digest_of(tmp_path, "here")
    assert digest_of(tmp_path, "elsewhere") != before
    for path in [path for path in tmp_path.rglob("*") if path.is_file()]:
        text = path.read_text()
        path.write_text(text + "#")
        assert digest_of(tmp_path, "here") != before, path
        path.write_text(text)
    assert digest_of(tmp_path, "here") == before
    assert f"numpy {np.__version__}" in surroundings()


def test_the_mark_covers_every_module_that_an_analysis_loads(run: Path, repository: Path) -> None:
    code = (
        "import sys\nfrom pathlib import Path\n"
        "from daq_app.campaign.summaries.of_run import read_and_summarise\n"
        "from daq_app.rocking.analysis.options import AnalysisOptions\n"
        "made = read_and_summarise(Path(sys.argv[1]), {}, AnalysisOptions(), use_kept=False)\n"
        "assert made.anew\n"
        "print(*(n for n in sys.modules if n.split('.')[0] in ('daq_app', 'drivers', 'sim_hardware')))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(run)], cwd=repository, capture_output=True, text=True, check=True
    )
    inside = {name.split(".")[1] for name in done.stdout.split() if name.count(".") > 1}
    assert inside <= set(ANALYSIS_CODE)
    assert all(name.split(".")[0] == "daq_app" for name in done.stdout.split())


def test_taking_a_kept_analysis_loads_no_scipy(run: Path, repository: Path) -> None:
    code = (
        "import sys\nfrom pathlib import Path\nfrom daq_app.campaign.report.collect import collect\n"
        "print(collect(Path(sys.argv[1]), workers=1).origin)\n"
        "print('scipy.optimize' in sys.modules or 'scipy.signal' in sys.modules)\n"
    )
    # Kept analyses are taken by the process that asks for them.
    done = subprocess.run(
        [sys.executable, "-c", code, str(run.parent)],
        cwd=repository,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split("\n")[:2] == ["Analyses: 1 kept beside their runs.", "False"]


def test_the_verdict_that_the_operator_gives_later_counts(run: Path) -> None:
    with open_run(run) as opened:
        run_id = opened.header.run_id
    give_verdict(run.parent, run_id, "bad", "a rope moved")
    give_place(run.parent, run_id, "FR1-L2-4")
    kept, fresh = collect(run.parent, workers=1), collect(run.parent, workers=1, anew=True)
    (test,) = kept.tests
    assert (test.test, test.level, test.good, test.reasons) == ("FR1-L2-4", "L2", False, ("a rope moved",))
    assert digits(kept.tests[0]) == digits(fresh.tests[0])


def test_a_folder_that_keeps_nothing_is_analysed_all_the_same(run: Path) -> None:
    run.with_suffix(SUFFIX).unlink()
    run.with_suffix(SUFFIX).mkdir()  # no file can get this name
    found = collect(run.parent, workers=1)
    assert len(found.tests) == 1 and "made anew" in found.origin


def test_a_page_older_than_what_is_kept_is_not_current(run: Path) -> None:
    page = run.with_suffix(".result.pdf")
    assert not page_is_current(run)
    page.write_bytes(b"%PDF")
    assert page_is_current(run)
    kept_ns = run.with_suffix(SUFFIX).stat().st_mtime_ns
    os.utime(page, ns=(kept_ns - 1, kept_ns - 1))
    assert not page_is_current(run)


def test_the_window_shows_what_the_report_has_kept(run: Path) -> None:
    shown = load_result(run)
    assert shown is not None
    assert digits(shown.test) == digits(collect(run.parent, workers=1).tests[0])


def test_the_command_says_where_the_analyses_come_from(run: Path) -> None:
    done = CliRunner().invoke(build_app(), ["campaign", "report", str(run.parent), "--workers", "1"])
    assert "Analyses: 1 kept beside their runs." in done.output, done.output
    page = (run.parent / "report" / "report.html").read_text(encoding="utf-8")
    assert "Analyses: 1 kept beside their runs." in page
