"""A wall that stood armed for long: the analysis takes the part that matters and answers the same."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from daq_app.acquisition.closing.derive import derive
from daq_app.rocking import AnalysisOptions, TestRecord, analyse_record
from daq_app.rocking import record as module
from daq_app.runfile import DerivedData, JournalWriter, RunHeader, finalise, open_run, read_journal, verify


def journal(path: Path, rig: Any, rig_text: str, wall_test: Any, *, released: bool) -> Path:
    header = RunHeader(
        run_id="long",
        rig_text=rig_text,
        channel_ids=rig.channel_ids,
        reading_units=tuple(channel.reading_unit for channel in rig.channels),
        rate_hz=4000.0,
    )
    with JournalWriter(path, header) as writer:
        for start in range(0, wall_test.n_samples, 400):
            writer.append_block(1000 + start, wall_test.readings[:, start : start + 400])
        if released:
            writer.append_event("released", 1000 + wall_test.release_sample, "released")
        writer.append_event("end", 1000 + wall_test.n_samples, "done", {"outcome": "complete"})
    return path


def derived_of(path: Path) -> tuple[DerivedData, str]:
    with read_journal(path) as contents:
        derived, said = derive(contents)
    assert derived is not None, said
    return derived, said


@pytest.mark.parametrize("released", [True, False])
def test_the_part_around_the_release_gives_the_same_r(
    tmp_path: Path,
    rig: Any,
    rig_text: str,
    wall_test: Any,
    monkeypatch: pytest.MonkeyPatch,
    released: bool,
) -> None:
    path = journal(tmp_path / "long.journal", rig, rig_text, wall_test, released=released)
    whole, said = derived_of(path)
    assert said == "" and whole.first_sample == 1000
    total_s = wall_test.n_samples / 4000.0
    monkeypatch.setattr(module, "_LONGEST_S", total_s - 4.0)
    monkeypatch.setattr(module, "_BEFORE_RELEASE_S", 5.0)
    part, said = derived_of(path)
    assert "long recording" in said and part.first_sample > 1000
    for method in ("eav", "crt"):
        r = [d.results["analysis"]["estimates"][method]["r"] for d in (whole, part)]
        assert r[1] == pytest.approx(r[0], abs=2e-4)
    run = finalise(path, tmp_path / "long.h5", part)
    assert verify(run).ok
    with open_run(run) as opened:
        assert opened.n_samples == wall_test.n_samples, "all readings are kept"
        options = AnalysisOptions(fit=False, bias_runs=0)
        later = analyse_record(TestRecord.from_run(opened, opened.rig), options)
        told = [note.text for note in later.notes if "of this recording of" in note.text]
        assert len(told) == 1
        assert later.as_dict() == part.results["analysis"], "whoever analyses it later takes the same part"
