"""Words that somebody typed leave as words: in the terminal, in JSON, in CSV and in pages."""

from __future__ import annotations

import csv
import dataclasses
import html.parser
import io
import json
import tomllib
from pathlib import Path

import numpy as np
import pypdfium2
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner, Result

from daq_app.campaign.report.csv_files import csv_files
from daq_app.campaign.report.report_tables import ReportTables
from daq_app.campaign.result.report import write_result
from daq_app.campaign.summaries.summary import MethodResult, TestSummary
from daq_app.cli.app import build_app
from daq_app.config.shown_text import csv_cell, one_line, shortened, visible
from daq_app.runfile import JournalWriter, RunHeader, finalise, verify
from daq_app.runfile.exporters import export_run
from tests.support.files.hostile_words import ALL_KNOWN, hidden_characters, hostile

few = settings(max_examples=25, deadline=None)


def make_run(folder: Path, name: str = "FR1-L1-1", notes: str = "") -> Path:
    """A run of one channel, of a test that was released and came to rest."""
    header = RunHeader(
        run_id=name,
        test=name,
        channel_ids=("A",),
        reading_units=("V",),
        rate_hz=100.0,
        notes=notes,
        specimen=notes[:40],
        host=notes[:40],
    )
    journal = folder / f"{name}.journal"
    with JournalWriter(journal, header) as writer:
        writer.append_block(0, np.zeros((1, 100)))
        writer.append_event("released", 10, notes)
        writer.append_event("end", 100, "done", {"outcome": "complete"})
    return finalise(journal, folder / f"{name}.h5", None, keep_journal=False)


def run_command(*arguments: object) -> Result:
    return CliRunner().invoke(build_app(), list(map(str, arguments)))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_run(tmp_path_factory.mktemp("runs"))


@given(hostile())
@few
def test_what_is_shown_has_no_hidden_character_and_says_which_there_were(text: str) -> None:
    shown = visible(text)
    assert not hidden_characters(shown.replace("\r", ""))
    assert all(f"U+{ord(character):04X}" in shown for character in hidden_characters(text))
    assert visible(shown) == shown
    assert "\n" not in one_line(text) and len(shortened(text, 20)) <= 20


@given(hostile())
@few
def test_a_reason_is_words_in_the_terminal_and_itself_in_json(run: Path, text: str) -> None:
    given_ = run_command("campaign", "verdict", run, "bad", f"--reason={text}")
    assert given_.exit_code == 0, given_.output
    status = run_command("campaign", "status", run.parent)
    assert status.exit_code == 0, status.output
    for output in (given_.output, status.output):
        assert not hidden_characters(output)
    document = run_command("campaign", "status", run.parent, "--json").stdout
    assert not hidden_characters(document)
    tests = [test for place in json.loads(document)["places"] for test in place["tests"]]
    assert tests[0]["reason"] == text


@given(st.lists(hostile(), min_size=1, max_size=3))
@settings(max_examples=10, deadline=None)
def test_paths_and_errors_are_words_in_the_terminal(names: list[str]) -> None:
    said = run_command("verify", *(f"./{name}".replace("\0", "") for name in names))
    assert said.exit_code == 2 and not hidden_characters(said.output)


def formulas(text: str, delimiter: str) -> list[str]:
    """Cells that a spreadsheet would take for a formula; numbers are none."""
    found = []
    for row in csv.reader(io.StringIO(text), delimiter=delimiter):
        for cell in row:
            start = cell.lstrip(" ")[:1]
            number = cell.replace("−", "-").replace(",", ".").lstrip("+-")
            if start and start in "=+-@\t\r" and not number.replace(".", "", 1).replace("e-", "").isdigit():
                found.append(cell)
    return found


@given(hostile())
@few
def test_no_cell_of_an_export_is_a_formula_and_notes_end_no_line(
    tmp_path_factory: pytest.TempPathFactory, text: str
) -> None:
    folder = tmp_path_factory.mktemp("export")
    run = make_run(folder, notes=text)
    assert verify(run).ok
    plain = export_run(make_run(folder, "plain"), folder, "csv", units="raw").read_text(encoding="utf-8")
    for decimal, delimiter in (("point", ","), ("comma", ";")):
        out = export_run(run, folder / f"{decimal}.csv", "csv", units="raw", decimal=decimal)  # type: ignore[arg-type]
        written = out.read_text(encoding="utf-8")
        assert formulas(written, delimiter) == []
        assert written.count("\n") == plain.count("\n") and not hidden_characters(written)
        line = next(line for line in written.splitlines() if line.startswith("# notes: "))
        assert json.loads(line.removeprefix("# notes: ")) == text.replace("\0", "\ufffd")


@given(hostile())
@few
def test_a_cell_of_a_table_is_no_formula_and_a_number_stays_one(text: str) -> None:
    line = io.StringIO()
    csv.writer(line).writerow([csv_cell(text), csv_cell(-1.5), csv_cell("-1.5")])
    assert formulas(line.getvalue(), ",") == []
    assert line.getvalue().rstrip("\r\n").endswith(",-1.5,-1.5")


def summary(reasons: tuple[str, ...]) -> TestSummary:
    time = np.linspace(-0.3, 3.0, 50)
    return TestSummary(
        test="FR1-L1-1", specimen="FR1", level="L1", repetition=False, run="FR1-L1-1.h5",
        alpha_rad=0.215, p_rad_s=2.2, r_max=0.93, theta0_rad=0.03, impacts_s=(0.3, 1.0),
        peaks_rad=(0.03, 0.02, 0.01), periods_s=(1.4, 1.2), methods={"CRT": MethodResult(0.9, 0.002)},
        time_s=time, rotation_rad=0.0 * time, velocity_rad_s=0.0 * time, good=False, reasons=reasons,
    )  # fmt: skip


class _Tags(html.parser.HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)


def tags_of(page: Path) -> list[str]:
    parser = _Tags()
    parser.feed(page.read_text(encoding="utf-8"))
    return parser.tags


def test_reasons_add_no_tag_to_a_page_and_stop_no_pdf(tmp_path: Path) -> None:
    plain = summary(("plain",))
    page, _ = write_result(tmp_path / "plain.h5", plain)
    expected = tags_of(page)
    page, pdf = write_result(tmp_path / "hostile.h5", dataclasses.replace(plain, reasons=ALL_KNOWN))
    assert tags_of(page) == expected
    assert not hidden_characters(page.read_text(encoding="utf-8"))
    document = pypdfium2.PdfDocument(pdf)
    text = " ".join(page.get_textpage().get_text_range() for page in document)
    assert "cmd|" in text
    hostile = dataclasses.replace(plain, reasons=ALL_KNOWN)
    for _, table in csv_files(ReportTables("plain", (), (), (), (hostile,), ())):
        assert formulas(table, ",") == []


@given(hostile())
@settings(max_examples=12, deadline=None)
def test_words_of_a_foreign_file_are_words_after_its_import(
    tmp_path_factory: pytest.TempPathFactory, configs: Path, text: str
) -> None:
    """A column's name and a comment of somebody else's CSV, through proposal, import, terminal and export."""
    folder = tmp_path_factory.mktemp("import")
    heading = text.replace("\r", " ").replace("\n", " ").replace("\0", " ")
    table, times = io.StringIO(), np.arange(200) / 100.0
    writer = csv.writer(table)
    writer.writerow(["time_s", f"{heading} (mm)", "WP-1 (mm)"])
    writer.writerows((f"{t:.2f}", f"{np.sin(t):.4f}", f"{np.cos(5 * t):.4f}") for t in times)
    (folder / "old.csv").write_text(f"# {heading}\n{table.getvalue()}", encoding="utf-8")
    rig, out = configs / "fr1.toml", folder / "runs"
    source = folder / "old.csv"
    proposed = run_command("import", source, "--rig", rig, "--propose-map")
    imported = run_command("import", source, "--rig", rig, "--out", out)
    for answer in (proposed, imported):
        assert not hidden_characters(answer.output), answer.output
        assert answer.exit_code in (0, 1, 2), answer.output
    if proposed.exit_code == 0:
        tomllib.loads(proposed.stdout)
    for run in out.glob("*.h5"):
        written = export_run(run, folder / "out.csv", "csv", units="raw").read_text(encoding="utf-8")
        assert formulas(written, ",") == [] and not hidden_characters(written)
