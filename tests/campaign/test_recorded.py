"""The state of a campaign read from real run files and journals."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from daq_app.campaign.names import TestName
from daq_app.campaign.recorded import read_recorded
from daq_app.campaign.status import TestVerdict
from daq_app.campaign.verdicts import FILE_NAME, give_verdict, read_verdicts
from daq_app.cli.app import build_app
from daq_app.config import ConfigError
from daq_app.runfile import DerivedData, JournalWriter, RunFileError, RunHeader, finalise

_PLAN = str(Path(__file__).parents[2] / "configs" / "campaigns" / "costa.toml")
Course = tuple[str, ...]
WHOLE: Course = ("armed", "holding", "released", "rocking", "at_rest")
Record = Callable[..., Path]


@pytest.fixture
def record(tmp_path: Path) -> Record:
    """`record("FR1-L1-1", course=…, outcome=…)` writes a small run and returns its file."""
    moments = iter(range(1, 1000))

    def make(
        test: str,
        course: Course = WHOLE,
        outcome: str = "complete",
        *,
        quality: dict[str, object] | None = None,
        gap: bool = False,
        save: bool = True,
    ) -> Path:
        moment = next(moments)
        header = RunHeader(
            run_id=f"{test}_{moment:03d}",
            test=test,
            channel_ids=("WP-1",),
            reading_units=("V",),
            rate_hz=4000.0,
            start_utc_ns=moment * 10**9,
        )
        journal = tmp_path / f"{header.run_id}.journal"
        writer = JournalWriter(journal, header)
        writer.append_block(0, np.zeros((1, 400)))
        if gap:
            writer.append_gap(400, 50, "test")
        for sample, kind in enumerate(course):
            writer.append_event(kind, sample, kind, {})
        if outcome:
            writer.append_event("end", 399, "end", {"outcome": outcome})
        writer.close()
        if not save:
            return journal
        derived = DerivedData(0, {}, results={"quality": quality}) if quality else None
        run = finalise(journal, tmp_path / f"{header.run_id}.h5", derived)
        journal.unlink(missing_ok=True)
        return run

    return make


def only(folder: Path) -> tuple[str, TestVerdict, str]:
    (test,) = read_recorded(folder)
    return str(test.name), test.verdict, test.reason


def test_a_whole_test_is_unchecked_until_somebody_judges(tmp_path: Path, record: Record) -> None:
    record("FR1-L3-2")
    assert only(tmp_path) == ("FR1-L3-2", TestVerdict.UNCHECKED, "")


def test_the_quality_check_of_the_run_decides(tmp_path: Path, record: Record) -> None:
    record("FR1-L3-2", quality={"verdict": "bad", "reasons": ["WP-1 clipped", "no rest"]})
    assert only(tmp_path) == ("FR1-L3-2", TestVerdict.BAD, "WP-1 clipped; no rest")


@pytest.mark.parametrize(
    ("course", "outcome", "gap", "words"),
    [
        (WHOLE, "complete", True, "50 samples are missing"),
        (WHOLE[:4], "timeout", False, "not come to rest"),
        (WHOLE[:4], "failed", False, "failed"),
        (WHOLE[:4], "", False, "ended before"),
    ],
)
def test_what_went_wrong_is_said(
    tmp_path: Path, record: Record, course: Course, outcome: str, gap: bool, words: str
) -> None:
    record("FR1-L3-2", course, outcome, gap=gap)
    _, verdict, reason = only(tmp_path)
    assert verdict is TestVerdict.BAD
    assert words in reason


@pytest.mark.parametrize(
    ("course", "outcome"),
    [
        (("armed", "holding"), "aborted"),
        (("armed", "holding", "released", "armed"), "aborted"),
        ((), "aborted"),
    ],
)
def test_an_aborted_arming_is_no_test(tmp_path: Path, record: Record, course: Course, outcome: str) -> None:
    record("FR1-L3-2", course, outcome)
    assert read_recorded(tmp_path) == []


def test_an_imported_run_without_events_counts(tmp_path: Path, record: Record) -> None:
    record("FR1-L3-2", (), "")
    assert only(tmp_path)[1] is TestVerdict.UNCHECKED


def test_a_journal_without_a_run_counts_once(tmp_path: Path, record: Record) -> None:
    record("FR1-L3-2", save=False)
    name, verdict, reason = only(tmp_path)
    assert (name, verdict) == ("FR1-L3-2", TestVerdict.UNCHECKED)
    assert "daq-app recover" in reason


def test_a_damaged_run_burns_its_number(tmp_path: Path) -> None:
    (tmp_path / "FR1-L3-2_20260601.h5").write_bytes(b"no HDF5")
    name, verdict, reason = only(tmp_path)
    assert (name, verdict) == ("FR1-L3-2", TestVerdict.LOST)
    assert reason


def test_runs_of_other_names_are_none_of_the_campaigns(tmp_path: Path, record: Record) -> None:
    record("trial")
    assert read_recorded(tmp_path) == []


def test_no_folder(tmp_path: Path) -> None:
    with pytest.raises(RunFileError, match="no folder"):
        read_recorded(tmp_path / "none")


def test_the_operator_has_the_last_word(tmp_path: Path, record: Record) -> None:
    record("FR1-L3-2", quality={"verdict": "good"})
    give_verdict(tmp_path, "FR1-L3-2_001", "bad", "hit a rope")
    assert only(tmp_path) == ("FR1-L3-2", TestVerdict.BAD, "hit a rope")
    give_verdict(tmp_path, "FR1-L3-2_001", "good")
    assert only(tmp_path)[1] is TestVerdict.GOOD
    assert [p.name for p in tmp_path.iterdir() if p.name.endswith("tmp")] == []


def test_damaged_verdicts_are_not_ignored(tmp_path: Path, record: Record) -> None:
    record("FR1-L3-2")
    (tmp_path / FILE_NAME).write_text('{"runs": {"a": {"verdict": "fine"}}}', encoding="utf-8")
    with pytest.raises(ConfigError, match="give the verdicts again"):
        read_recorded(tmp_path)
    with pytest.raises(ConfigError):
        read_verdicts(tmp_path)


def run_cli(*arguments: str | Path) -> tuple[int, str]:
    result = CliRunner().invoke(build_app(), [*map(str, arguments)])
    return result.exit_code, result.output


def test_status_from_the_command_line(tmp_path: Path, record: Record) -> None:
    record("FR1-L1-1")
    run = record("FR1-L1-2")
    code, output = run_cli("campaign", "verdict", run, "bad", "--reason", "hit a rope")
    assert (code, output.strip()) == (0, "FR1-L1-2: bad (hit a rope)")
    code, output = run_cli("campaign", "status", tmp_path, "--plan", _PLAN, "--json")
    told = json.loads(output)
    assert code == 0
    assert told["counts"] == {"done": 1, "to be repeated": 1, "missing": 34}
    assert told["next"]["name"] == "FR1-L1-6"
    assert "hit a rope" in told["next"]["reason"]
    code, output = run_cli("campaign", "status", tmp_path, "--plan", _PLAN, "--specimen", "FR2")
    assert code == 0
    assert "Next: FR2-L3-1" in output
    assert "FR1-L1-1" not in output


def test_plan_from_the_command_line() -> None:
    code, output = run_cli("campaign", "plan", _PLAN)
    assert code == 0
    assert "36 tests" in output
    assert output.count("lost in the original") == 6


def test_bad_input_on_the_command_line(tmp_path: Path) -> None:
    assert run_cli("campaign", "status", tmp_path / "none", "--plan", _PLAN)[0] == 2
    assert run_cli("campaign", "status", tmp_path, "--plan", tmp_path / "none.toml")[0] == 2
    code, output = run_cli("campaign", "status", tmp_path, "--plan", _PLAN, "--specimen", "FR7")
    assert code == 2
    assert "Specimens: FR1, FR2" in output
    assert run_cli("campaign", "verdict", tmp_path / "none.h5", "bad")[0] == 2


def test_names_order_repetitions_last() -> None:
    names = [TestName.parse(t) for t in ("FR1-L3-R", "FR1-L3-10", "FR1-L3-2")]
    assert [str(n) for n in sorted(names)] == ["FR1-L3-2", "FR1-L3-10", "FR1-L3-R"]
