"""What a run consists of, apart from its samples."""

from __future__ import annotations

import json
import math
import platform
import socket
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import PackageNotFoundError, version
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from daq_app.config.planning.plan import TaskPlan
from daq_app.runfile.plain_text import clean_text
from daq_app.runfile.test_plan import TestPlan

RUN_FORMAT = "rocking-run"
RUN_FORMAT_VERSION = 2
"""Files of version 1 have no seal; they are read all the same."""
MAX_SAMPLES = 2**31
"""Longest run, samples per channel (six days at 4000 Hz): a longer one is a damaged or hostile file."""
MAX_GAP_SAMPLES = 2**26
"""Longest total of gaps in a run (4.6 h at 4000 Hz)."""
_RESERVED_NAMES = frozenset({"time", "chunk"})


def to_json(value: object) -> str:
    """Strict JSON of nearly anything: NumPy numbers become numbers, NaN and infinity null, the rest text.

    Recording never stops because somebody put something odd into an event.
    """
    return json.dumps(_plain(value), ensure_ascii=False, allow_nan=False)


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if value is None or isinstance(value, bool | int):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {clean_text(str(key)): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [_plain(item) for item in value]
    return clean_text(str(value))


_Text = Annotated[str, AfterValidator(clean_text)]
_Finite = Annotated[float, Field(allow_inf_nan=False)]
LATEST_NS = 2**63 - 1
"""A moment in the year 2262: the last that 64 bits of nanoseconds, and so a run file, can hold."""


class RunHeader(BaseModel):
    """All that is known of a run before its first sample. Stored as JSON in journal and run file."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    format_version: Literal[1] = 1
    run_id: Annotated[_Text, Field(min_length=1, max_length=200)]
    """Unique: ties the journal to its run file."""
    test: _Text = ""
    specimen: _Text = ""
    rig_name: _Text = ""
    rig_text: _Text = ""
    """The rig file, letter by letter."""
    product_texts: Annotated[tuple[_Text, ...], Field(max_length=64)] = ()
    """The product files that the rig file names, in its order, letter by letter."""
    channel_ids: Annotated[tuple[str, ...], Field(min_length=1, max_length=4096)]
    """Row order of every block."""
    reading_units: tuple[Annotated[_Text, Field(max_length=64)], ...]
    """Unit of each row."""
    rate_hz: Annotated[float, Field(gt=0, le=1e7, allow_inf_nan=False)]
    """Rate read back from the hardware."""
    plan: dict[str, Any] = Field(default_factory=dict)
    """The task plan (`plan_to_dict`)."""
    opened: dict[str, Any] = Field(default_factory=dict)
    """What the hardware made of the plan: ranges, buffer, devices, driver."""
    tare: dict[str, _Finite] = Field(default_factory=dict)
    """Reading found at rest beyond the certificate's offset, by channel id."""
    tare_record: dict[str, Any] = Field(default_factory=dict)
    """When and on how many samples the tare was taken, scatter by channel."""
    start_utc_ns: Annotated[int, Field(ge=0, le=LATEST_NS)] = 0
    """Wall clock at the run's first sample. A stamp only: time is sample index / rate."""
    host: _Text = ""
    versions: dict[str, _Text] = Field(default_factory=dict)
    notes: _Text = ""
    test_plan: TestPlan | None = None
    """What the test was to be; None where nobody planned it (an import, a release that was not armed)."""
    kept: dict[str, Any] | None = None
    """For a release that was not armed and kept from the ring: which ring, and the release's sample."""
    truth: dict[str, Any] | None = None
    """What a simulated run was made from; None for a real one."""
    origin: dict[str, Any] | None = None
    """For an imported run: the foreign file, its SHA-256, the map, and what was doubted."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        ids = self.channel_ids
        if len(set(ids)) != len(ids):
            raise ValueError("two channels have the same id")
        for channel_id in ids:
            if not channel_id or len(channel_id) > 64 or "/" in channel_id or channel_id.startswith("."):
                raise ValueError(f"channel id {channel_id[:64]!r} cannot name a channel of a run")
            if channel_id.lower() in _RESERVED_NAMES or not channel_id.isprintable():
                raise ValueError(f"channel id {channel_id!r} is reserved or not printable")
        if len(self.reading_units) != len(ids):
            raise ValueError(f"{len(self.reading_units)} reading units for {len(ids)} channels")
        return self

    @property
    def n_channels(self) -> int:
        return len(self.channel_ids)

    def time_offset_s(self, channel_id: str) -> float:
        """Known lag of a channel: its sample k shows the instant ``k / rate + time_offset_s``."""
        return self._time_offsets.get(channel_id, 0.0)

    @cached_property
    def _time_offsets(self) -> dict[str, float]:
        try:
            return {
                str(channel["id"]): float(channel["skew_s"]) - float(channel["input_delay_s"])
                for task in self.plan["tasks"]
                for channel in task["channels"]
            }
        except (KeyError, TypeError, ValueError):
            return {}  # no plan (an imported run), or one of another version: no lag is known


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened at a sample: a state change, an overload, a marker, a note."""

    kind: str
    sample: int
    """Absolute sample index."""
    text: str
    data: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Gap:
    """Samples ``[first_sample, first_sample + n_samples)`` of every channel that are not there."""

    first_sample: int
    n_samples: int
    reason: str

    @property
    def end(self) -> int:
        return self.first_sample + self.n_samples


@dataclass(frozen=True, slots=True)
class DerivedSignal:
    """One computed signal of a run."""

    values: NDArray[np.float64]
    unit: str
    long_name: str


@dataclass(frozen=True, slots=True)
class DerivedData:
    """Signals computed from the readings, on one time base, and results as JSON-able data.

    Value i of every signal belongs to absolute sample ``first_sample + i · step``.
    """

    first_sample: int
    signals: Mapping[str, DerivedSignal]
    step: int = 1
    results: dict[str, Any] = field(default_factory=dict)


def plan_to_dict(plan: TaskPlan) -> dict[str, Any]:
    """The plan as JSON-able data: tasks, channels with their known delays, notes."""
    return {
        "rate_hz": plan.rate_hz,
        "read_samples": plan.read_samples,
        "tasks": [
            {
                "name": task.name,
                "role": task.role,
                "requested_rate_hz": task.requested_rate_hz,
                "rate_hz": task.rate_hz,
                "clock_source": task.clock_source,
                "start_trigger_source": task.start_trigger_source,
                "buffer_samples": task.buffer_samples,
                "channels": [
                    {
                        "id": planned.channel.id,
                        "physical_channel": planned.channel.physical_channel,
                        "skew_s": planned.skew_s,
                        "input_delay_s": planned.input_delay_s,
                    }
                    for planned in task.channels
                ],
            }
            for task in plan.tasks
        ],
        "notes": [{"severity": n.severity, "where": n.where, "text": n.text} for n in plan.notes],
    }


def software_versions() -> dict[str, str]:
    """Versions of this program and of what it stands on, for `RunHeader.versions`."""
    versions = {"python": platform.python_version(), "platform": platform.platform()}
    for package in ("rocking-test-recorder", "nidaqmx", "numpy", "h5py"):
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "not installed as a package"
    return versions


def host_name() -> str:
    """Name of this machine, for `RunHeader.host`."""
    return socket.gethostname()
