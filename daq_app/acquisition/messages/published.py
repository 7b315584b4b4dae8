"""What the acquisition process says to viewers, and what viewers may ask of it.

Published on a PUB socket as two frames ``[topic, body]``, or three for blocks
``[b"block", body, readings]``; bodies are UTF-8 JSON of the models below, readings raw float32
C-order (n_channels, n_samples) in SI units (tared, scaled; not time-aligned).  Commands travel on a
REQ/REP socket as one JSON frame `Command` → `Reply`.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Final, Literal

from pydantic import BaseModel, ConfigDict

from daq_app.acquisition.checks.check_model import SensorCheck
from daq_app.runfile import TestPlan


class State(StrEnum):
    """States of the acquisition process, in the order of a test."""

    IDLE = "idle"
    PREVIEWING = "previewing"
    ARMED = "armed"
    HOLDING = "holding"
    RELEASED = "released"
    ROCKING = "rocking"
    AT_REST = "at_rest"
    SAVING = "saving"
    SAVED = "saved"
    FAILED = "failed"


RECORDING = frozenset({State.ARMED, State.HOLDING, State.RELEASED, State.ROCKING, State.AT_REST})
"""States in which an armed run is written."""

UNARMED: Final = "unarmed"
"""Stands for the test's name in the run of a release that nobody armed."""


class Message(BaseModel):
    # NaN (a half-cycle that could not be fitted) travels as the string "NaN": plain JSON has no such number.
    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="strings")


Tone = Literal["muted", "text", "accent", "good", "warning", "bad"]
"""How urgent words are: the role of the colour they are shown in."""


class Call(StrEnum):
    """What the operator is to do now. Every word on a screen follows from it."""

    START = "start"
    PREPARE = "prepare"
    PULL = "pull"
    EASE_BACK = "ease_back"
    OTHER_SIDE = "other_side"
    STOP = "stop"
    HOLD = "hold"
    DO_NOT_RELEASE = "do_not_release"
    RELEASE = "release"
    ARM_FIRST = "arm_first"
    KEEP_CLEAR = "keep_clear"
    WAIT = "wait"
    LOOK = "look"


class Judgement(Message):
    """What the recorder makes of the moment: state line, gauge, header and sounds show this alone."""

    call: Call = Call.START
    word: str = ""
    """The state in a word or two."""
    do: str = ""
    """What to do next, in a sentence."""
    tone: Tone = "muted"
    gauge: str = ""
    """What the gauge says beside its figure; empty while nothing is to be pulled."""
    alarm: str = ""
    """What must be heeded before anything else; empty when all is well."""
    ratio: float | None = None
    """|θ|/α now, from the tiltmeters; None where it is not known."""
    target: float | None = None
    low: float | None = None
    high: float | None = None
    """Band of |θ|/α that counts."""
    held_s: float = 0.0
    """How long the wall has been held still within the band."""
    hold_s: float = 0.0
    """How long it is to be held before the release."""


class StateMessage(Message):
    """Topic ``state``: on every change, of a word as well, and once a second."""

    state: State
    test: str = ""
    run_path: str = ""
    text: str = ""
    """A plain sentence for the operator."""
    since_sample: int = 0
    sample: int = 0
    armed: bool = False
    """False also while a release is recorded that nobody armed."""
    plan: TestPlan = TestPlan()
    """The test that is armed, or would be armed now."""
    locked: bool = False
    """The plan cannot be changed: a run is being recorded."""
    judgement: Judgement = Judgement()


class BlockMessage(Message):
    """Topic ``block``: heading of a rectangle of live data."""

    first_sample: int
    n_samples: int
    n_channels: int
    rate_hz: float
    overloaded: tuple[str, ...] = ()


class MotionMessage(Message):
    """Topic ``motion``: live rotation and velocity of one block, decimated to `step` samples."""

    first_sample: int
    step: int
    rate_hz: float
    rotation_rad: list[float]
    velocity_rad_s: list[float]
    judged_rad: float
    """The rotation that a pull is judged by: movement of the wires, level of the tiltmeters."""


class EstimatePoint(Message):
    """One value of r and the impact that completed it."""

    impact: int
    r: float


class EstimateMessage(Message):
    """Topic ``estimate``: after each impact, the whole estimate so far (idempotent)."""

    theta0_rad: float
    release_sample: int
    impact_samples: list[float]
    """Fractional sample indices of the impacts."""
    peaks_rad: list[float]
    """Signed peak rotation of each half-cycle, the release first."""
    impact_velocities_rad_s: list[float]
    """Signed peak velocity at each impact."""
    eav: list[EstimatePoint]
    crt: list[EstimatePoint]
    eav_mean: float | None = None
    eav_standard_error: float | None = None
    crt_mean: float | None = None
    crt_standard_error: float | None = None
    r_max: float
    doubts: tuple[str, ...] = ()
    """Which family, or which method, disagrees with this r; a sentence each."""


class HealthMessage(Message):
    """Topic ``health``: five times a second while tasks run."""

    sample: int
    """Samples per channel read."""
    acknowledged_sample: int
    """Samples per channel known to be on disk (fsynced); 0 when not recording."""
    recording: bool
    backlog_samples: int
    buffer_samples: int
    gaps: int
    lost_samples: int
    overloaded: tuple[str, ...] = ()
    file_bytes: int = 0
    free_bytes: int = 0
    block_to_disk_ms_p99: float = 0.0


class CheckMessage(Message):
    """Topic ``check``: the sensor check in force, when it is taken, and None when it is void."""

    check: SensorCheck | None


class EventMessage(Message):
    """Topic ``event``: something that is also written into the journal."""

    kind: str
    sample: int
    text: str
    severity: Literal["info", "warning", "error"] = "info"
    data: dict[str, float | str] = {}


class Command(Message):
    """A request. `name` is one of hello, preview, plan, tare, check, pull, arm, abort, stop, marker, note,

    shutdown.
    """

    name: str
    arguments: dict[str, float | str] = {}
    token: str = ""
    """The right to command; `hello` alone needs none."""
    request: str = ""
    """What tells this request from all others: sent again, it is answered again and not carried out twice."""


class Reply(Message):
    """The answer to a command: done, or why not and what to do."""

    ok: bool
    text: str = ""
    data: dict[str, object] = {}
