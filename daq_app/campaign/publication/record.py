"""One recorded test as it is published: what was planned, what was measured, and where its files are."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from daq_app.campaign.status import RecordedTest
from daq_app.config import Rig


@dataclass(frozen=True, slots=True)
class PublishedTest:
    """A test with the results of its analysis (`TestAnalysis.as_dict()`; empty where there is none)."""

    recorded: RecordedTest
    started_utc: str
    planned_level: float | None
    side: str
    operator: str
    conditions: str
    notes: tuple[str, ...]
    rig: Rig | None
    rig_name: str
    analysis: dict[str, Any]
    data_file: Path
    """netCDF file, relative to the published folder."""
    source_name: str
    source_sha256: str

    @property
    def name(self) -> str:
        return str(self.recorded.name)
