"""A small rig, made-up readings, and journals of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter
from numpy.typing import NDArray

from daq_app.config import ConfigError, Rig, load_rig
from daq_app.runfile import JournalWriter, RunFileError, RunHeader, open_run, verify
from daq_app.runfile.importers import ImportMap, ImportReport, import_file
from daq_app.runfile.seal.format import Sign, write_seal
from tests.support.files.hostile_folder import take_seal_off

Readings = NDArray[np.float64]
MakeJournal = Callable[..., Readings]


@pytest.fixture(scope="session")
def rig(configs: Path) -> Rig:
    return load_rig(configs / "fr1.toml")


@pytest.fixture(scope="session")
def header(configs: Path, rig: Rig) -> RunHeader:
    """Header of a run of four channels, one of each family."""
    ids = ("LV-A01", "WP-1", "AC-1", "TL-1X")
    channels = [rig.channel(channel_id) for channel_id in ids]
    return RunHeader(
        run_id="20240102-FR1-L3-2",
        test="FR1-L3-2",
        specimen="FR1",
        rig_name=rig.name,
        rig_text=(configs / "fr1.toml").read_text(encoding="utf-8"),
        channel_ids=ids,
        reading_units=tuple(channel.reading_unit for channel in channels),
        rate_hz=4000.0,
        tare={"WP-1": 0.25},
        start_utc_ns=1_704_187_800_000_000_000,
        host="lab",
    )


@pytest.fixture
def make_journal(header: RunHeader) -> MakeJournal:
    """`make_journal(path, n_blocks=…, block=…, first=…, gap_after=…)` writes a journal, returns readings."""

    def make(
        path: Path,
        *,
        n_blocks: int = 8,
        block: int = 400,
        first: int = 1000,
        gap_after: int | None = None,
        gap_samples: int = 150,
        close: bool = True,
        seed: int = 3,
    ) -> Readings:
        rng = np.random.default_rng(seed)
        lsb = 20.0 / 65536
        pieces: list[Readings] = []
        sample = first
        writer = JournalWriter(path, header)
        writer.append_event("state", first, "armed, θ steady", {"theta": 0.07})
        for number in range(n_blocks):
            readings = np.round(rng.normal(size=(header.n_channels, block)) / lsb) * lsb
            writer.append_block(sample, readings)
            pieces.append(readings)
            sample += block
            if number == gap_after:
                writer.append_gap(sample, gap_samples, "the chassis was off the network")
                pieces.append(np.full((header.n_channels, gap_samples), np.nan))
                sample += gap_samples
        if close:
            writer.close()
        else:
            writer.sync()
            writer.abandon()
        return np.concatenate(pieces, axis=1) if pieces else np.empty((header.n_channels, 0))

    return make


@pytest.fixture(scope="session")
def without_seal() -> Callable[[Path], Path]:
    """`without_seal(path)` makes a run one of format version 1, which differs by its seal only."""

    return take_seal_off


@pytest.fixture(scope="session")
def with_new_seal() -> Callable[..., Path]:
    """`with_new_seal(path, sign)` makes the seal anew, as somebody who edits a file could."""

    def change(path: Path, sign: Sign | None = None) -> Path:
        with h5py.File(path) as file:
            place = file["integrity/seal"]
            offset, n_bytes = place.id.get_offset(), place.shape[0]
        write_seal(path, offset, n_bytes, sign)
        return path

    return change


Bring = Callable[..., ImportReport]


@pytest.fixture
def bring(rig: Rig, configs: Path, tmp_path: Path) -> Bring:
    """`bring(path, channels={…}, source={…})` imports into a folder of runs and proves the result."""
    runs = tmp_path / "runs"
    runs.mkdir()
    text = (configs / "fr1.toml").read_text(encoding="utf-8")

    def do(
        path: Path, channels: dict[str, Any] | None = None, source: dict[str, Any] | None = None, **run: str
    ) -> ImportReport:
        named = {
            key: {"from": value} if isinstance(value, str) else value
            for key, value in (channels or {}).items()
        }
        import_map = ImportMap.model_validate({"channels": named, "source": source or {}, "run": run})
        before = sorted(runs.iterdir())
        try:
            report = import_file(path, rig, text, runs, import_map)
        except (RunFileError, ConfigError):
            assert sorted(runs.iterdir()) == before, "something was left behind"
            raise
        checked = verify(report.run)
        assert checked.ok, checked.problems
        assert sorted(runs.iterdir()) == sorted([*before, report.run])
        return report

    return do


@pytest.fixture(scope="session")
def si_of() -> Callable[[ImportReport, str], Readings]:
    """SI values of a channel of an imported run."""

    def read(report: ImportReport, channel_id: str) -> Readings:
        with open_run(report.run) as run:
            return run.si([channel_id])[0]

    return read


@pytest.fixture(scope="session")
def write_tdms() -> Callable[..., Path]:
    """`write_tdms(path, {name: values}, pieces=3, **properties)` as LabVIEW streams it: piece by piece."""

    def write(path: Path, channels: dict[str, Readings], pieces: int = 3, **properties: Any) -> Path:
        known = {"wf_increment": 1 / 4000.0, "unit_string": "V"} | properties
        with TdmsWriter(str(path)) as writer:
            for part in range(pieces):
                objects = [
                    ChannelObject("Measurement", name, np.array_split(values, pieces)[part], properties=known)
                    for name, values in channels.items()
                ]
                writer.write_segment([RootObject({}), GroupObject("Measurement"), *objects])
        return path

    return write
