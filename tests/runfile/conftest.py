"""A small rig, made-up readings, and journals of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from daq_app.config import Rig, load_rig
from daq_app.runfile import JournalWriter, RunHeader

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
