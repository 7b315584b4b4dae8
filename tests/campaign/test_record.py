"""The test record for signature: what it says, and that a reader of PDF that is not ours sees all of it."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pypdfium2
import pytest
from typer.testing import CliRunner

from daq_app.campaign.record.write import write_record
from daq_app.campaign.verdicts import give_verdict
from daq_app.cli.app import build_app
from daq_app.runfile import CheckFinding, CheckRecord, Event, RunFileError, TestPlan, open_run
from tests.support.files.rewritten_run import rewrite_run

A4_PT = (595.3, 841.9)
LONG = "Ωμέγα-" + "sehr-lange-Bezeichnung-ohne-Leerzeichen-" * 7


def pages_of(pdf: Path) -> list[str]:
    document = pypdfium2.PdfDocument(pdf)
    try:
        return [page.get_textpage().get_text_range() for page in document]
    finally:
        document.close()


def text_of(pdf: Path) -> str:
    """All words in their order, however the lines were broken."""
    return " ".join(" ".join(pages_of(pdf)).split())


def letters_of(pdf: Path) -> str:
    """All letters without white space: a long word may be broken anywhere."""
    joined = "".join("".join(pages_of(pdf)).split())
    return joined.replace("\ufffe", "-")  # PDFium's mark for a hyphen at the end of a line


@pytest.fixture(scope="module")
def planned(simulated_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The simulated run with a plan, a check that found something, words of every kind, and notes."""
    with open_run(simulated_run) as run:
        header, last = run.header, run.first_sample + run.n_samples - 1
    check = CheckRecord(
        verdict="no-go",
        summary="1 of 41 channels must be mended.",
        taken_utc="2026-03-04T09:15:00+00:00",
        overruled=True,
        findings=(CheckFinding(channel="LV-A03", verdict="no-go", text="is silent: mend its plug"),),
    )
    plan = TestPlan(
        test="FR1-L1-1",
        specimen=LONG[:60],
        level="L1",
        theta0_over_alpha=0.15,
        side="+x",
        operator="Zoë Müller 🧱 \u202egnp.exe",
        conditions="21 °C, Riß über der 3. Lage; α, θ̇ → 0\n" + "long " * 380,
        notes="long " * 900,
        check=check,
        zero_utc="2026-03-04T09:20:00+00:00",
    )
    updated = header.model_copy(
        update={
            "test_plan": plan,
            "notes": plan.notes,
            "run_id": "r1",
            "start_utc_ns": 1_893_456_000_000_000_000,
            "opened": header.opened
            | {
                "adc_timing": {"AIR": "HIGH_RESOLUTION"},
                "data_sheets": {"AC-1": {"manufacturer": 17, "model": 3, "version": "A1", "serial": 4711}},
            },
        }
    )
    events = [
        Event("note", 9000, "a crane passed \x1b[31m<b>&\x00"),
        Event("marker", 9500, ""),
        Event("note", 9600, LONG),
        Event("overload", last - 400, "AC-3 was overloaded", {"severity": "warning"}),
    ]
    return rewrite_run(simulated_run, tmp_path_factory.mktemp("planned") / "FR1-L1-1.h5", updated, events)


@pytest.fixture(scope="module")
def record(planned: Path) -> Path:
    return write_record(planned)


def test_every_page_is_a4_numbered_and_tied_to_the_run_file(planned: Path, record: Path) -> None:
    document = pypdfium2.PdfDocument(record)
    assert all(page.get_size() == pytest.approx(A4_PT, abs=1.0) for page in document)
    pages = pages_of(record)
    digest = hashlib.sha256(planned.read_bytes()).hexdigest()
    for number, page in enumerate(pages, start=1):
        assert f"page {number} of {len(pages)}" in page
        assert digest in "".join(page.split())


def test_it_says_plan_check_zero_course_and_result(record: Path) -> None:
    text = text_of(record)
    for words in (
        "0.1500 ± 5.0 % (0.1425 to 0.1575)",
        "no-go; armed in spite of it, 2026-03-04 09:15:00 UTC",
        "LV-A03 no-go is silent: mend its plug",
        "taken over 4000 samples",
        "Zoë Müller",
        "21 °C, Riß über der 3. Lage; α, θ",
        "AC-3 was overloaded",
        "CRT, rotation peaks (4.5)",
        "from wires: good, everything that was recorded agrees",
        "± is half of the 95 % interval",
        "good, every byte proven",
        "simulated: no wall was tested",
        "Operator", "Test leader", "Checked by", "Signature",
    ):  # fmt: skip
        assert words in text, words


def test_it_says_what_sensors_and_converters_told_of_themselves(record: Path) -> None:
    text = text_of(record)
    assert "Data sheet (TEDS) AC-1: maker 17, model 3, version A1, serial 4711" in text
    assert "Converter timing AIR: HIGH_RESOLUTION" in text


def test_every_sensor_stands_in_it_with_its_certificate_and_expired_ones_are_named(
    planned: Path, record: Path
) -> None:
    text = text_of(record)
    with open_run(planned) as run:
        assert run.rig is not None
        channels = run.rig.channels
    assert len(channels) == 41
    for channel in channels:
        assert channel.id in text and channel.certificate.number in text
    # The run is dated 2030: every certificate of the shipped rig has run out.
    assert "Certificates were out of date on 2030-01-01: LV-A01" in text


def test_long_and_hostile_words_are_whole_and_cannot_deceive(record: Path) -> None:
    letters = letters_of(record)
    assert "".join(LONG.split()) in letters
    assert letters.count("long") >= 1280
    assert "⟨U+202E⟩gnp.exe" in letters and "⟨U+001B⟩[31m<b>&" in letters
    assert "⟨U+1F9F1⟩" in letters, "a letter without a picture is shown by its code"


def test_a_decision_made_afterwards_stands_beside_the_recorders(
    simulated_run: Path, planned: Path, tmp_path: Path
) -> None:
    with open_run(planned) as run:
        rewritten = rewrite_run(planned, tmp_path / "FR1-L1-1.h5", run.header)
    give_verdict(tmp_path, "r1", "bad", "hit a rope")
    text = text_of(write_record(rewritten))
    assert "The recorder: " in text and ": bad: hit a rope." in text


def test_a_run_without_a_plan_or_a_release_says_so(tmp_path: Path, planned: Path) -> None:
    with open_run(planned) as run:
        bare = run.header.model_copy(
            update={"test": "", "test_plan": None, "notes": "", "tare": {}, "tare_record": {}, "rig_text": ""}
        )
    text = text_of(write_record(rewrite_run(planned, tmp_path / "bare.h5", bare)))
    assert "none: nobody planned this run" in text and "No result: " in text
    assert "not taken: the analysis takes it from the rest" in text


def test_a_record_is_never_replaced_unasked_nor_a_run_ever(planned: Path, tmp_path: Path) -> None:
    out = tmp_path / "signed.pdf"
    out.write_bytes(b"signed")
    command = ["campaign", "record", str(planned), "--out", str(out)]
    refused = CliRunner().invoke(build_app(), command)
    assert refused.exit_code == 2 and out.read_bytes() == b"signed"
    assert CliRunner().invoke(build_app(), [*command, "--overwrite"]).exit_code == 0
    assert out.read_bytes().startswith(b"%PDF")
    with pytest.raises(RunFileError, match="name of a recording"):
        write_record(planned, tmp_path / "other.h5", overwrite=True)
