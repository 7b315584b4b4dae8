"""What a viewer knows of the acquisition, and how old each piece of it is. Knows nothing of Qt.

Messages go in with the time at which they came off the wire; pages read values out together with
the question that matters beside a wall: is this still true?  Nothing is shown as live once it is
older than `STALE_AFTER_S`.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from daq_app.acquisition.messages.published import (
    RECORDING,
    BlockMessage,
    EstimateMessage,
    EventMessage,
    HealthMessage,
    Judgement,
    MotionMessage,
    State,
    StateMessage,
)
from daq_app.config.rig import Rig
from daq_app.monitor.data.minmax_ring import MinMaxRing
from daq_app.monitor.data.motion_trace import Array, MotionTrace

STALE_AFTER_S = 0.5
"""A measured value older than this is not shown as live."""

SILENT_AFTER_S = 2.5
"""The state is repeated once a second even when no task runs; silence for longer is a lost link."""

RECENT_S = 6.0
"""How much undecimated data the sensor check may ask for."""

TRACE_S = 180.0
"""Length of the rotation history: longer than any test's motion."""

DISK_BEHIND_S = 1.5
"""When the disk is further behind than this, recording is not called safe."""

RUNNING = frozenset(
    {State.PREVIEWING, State.ARMED, State.HOLDING, State.RELEASED, State.ROCKING, State.AT_REST}
)
"""States in which the sample clock runs and data must flow."""


@dataclass(frozen=True, slots=True)
class Published:
    """One message off the wire and the (monotonic) time it came."""

    message: BaseModel
    received_s: float
    readings: NDArray[np.float32] | None = None
    """(n_channels, n_samples) in SI, for blocks."""


@dataclass(frozen=True, slots=True)
class StripSettings:
    """How much of the past the strips show, and how finely."""

    span_s: float = 12.0
    columns: int = 240


class Session:
    """The state store behind the live pages; fed and read from one thread (the window's)."""

    def __init__(
        self, clock: Callable[[], float] = time.monotonic, strips: StripSettings | None = None
    ) -> None:
        self.clock = clock
        self.strip_settings = strips or StripSettings()
        self.rig: Rig | None = None
        self.rate_hz = 0.0
        self.state: StateMessage | None = None
        self.health: HealthMessage | None = None
        self.estimate: EstimateMessage | None = None
        self.events: deque[EventMessage] = deque(maxlen=200)
        self.strips: MinMaxRing | None = None
        self.trace = MotionTrace(1)
        self.last_motion: tuple[Array, Array, Array] | None = None
        """(samples, θ, θ̇) of the last test from a second before its release: the trace goes on without it."""
        self.block_mean: NDArray[np.float64] | None = None
        """Mean of each channel over the newest block, SI."""
        self.overloaded: frozenset[str] = frozenset()
        self.judged_rad = math.nan
        """The rotation that every figure of this moment is made from."""
        self.rotation_rad = math.nan
        """The wires' alone, as the plots draw it."""
        self.velocity_rad_s = math.nan
        self._running: dict[str, dict[int, tuple[float, float]]] = {"eav": {}, "crt": {}}
        self.revision: dict[type[BaseModel], int] = {}
        """How many messages of each kind came: pages redraw when the number moves."""
        self._received: dict[type[BaseModel], float] = {}
        self._recent: deque[tuple[int, NDArray[np.float32]]] = deque()
        self._newest_sample = 0
        self._last_health_sample = -1
        self._peak_rad = 0.0
        self._rest_sample: int | None = None
        self._armed_sample = 0
        self.saw_arming = False
        """Whether this window was there when the run was armed: only then is its peak the run's peak."""
        self.zeroed: bool | None = None
        """Whether a zero is in force; None as long as the acquisition has not said."""
        self.run_zeroed: bool | None = None
        """The same for the run whose figures are shown."""

    def set_zeroed(self, zeroed: bool) -> None:
        """Take over whether a zero is in force. It cannot change within a run."""
        self.zeroed = zeroed
        if self.run_zeroed is None or (self.state is not None and self.state.state in RECORDING):
            self.run_zeroed = zeroed

    def adopt_past(self, events: Iterable[EventMessage]) -> None:
        """Take over what was said before this window came: since when the run under way is recorded."""
        if self.saw_arming:
            return
        for event in events:
            if event.kind == "armed":
                self._armed_sample = event.sample

    def set_rig(self, rig: Rig, rate_hz: float) -> None:
        """Say what is wired: names, families and α for the displays. Forgets all data."""
        if rate_hz <= 0:
            raise ValueError("the sample rate must be positive")
        self.rig, self.rate_hz = rig, rate_hz
        per_column = max(1, round(self.strip_settings.span_s * rate_hz / self.strip_settings.columns))
        self.strips = MinMaxRing(len(rig.channels), self.strip_settings.columns, per_column)
        self._forget_data()

    # -- feeding ---------------------------------------------------------------------------------

    def feed(self, published: Published) -> None:
        """Take in one message."""
        message = published.message
        kind = type(message)
        match message:
            case StateMessage():
                self._on_state(message)
            case BlockMessage():
                self._on_block(message, published.readings)
            case MotionMessage():
                self._on_motion(message)
            case EstimateMessage():
                self._on_estimate(message)
            case HealthMessage():
                if message.recording and message.sample == self._last_health_sample:
                    return  # a repeated figure says nothing new about the disk: let it go stale
                self.health, self._last_health_sample = message, message.sample
            case EventMessage():
                self.events.append(message)
            case _:
                return
        self._received[kind] = published.received_s
        self.revision[kind] = self.revision.get(kind, 0) + 1

    def _on_state(self, message: StateMessage) -> None:
        before = self.state
        self.state = message
        if _begins(before, message):
            self._on_begin(message.since_sample)
            self.saw_arming = message.state is State.ARMED
        elif before is None and message.state in RECORDING and not message.armed:
            self._armed_sample = message.since_sample  # the arming that was told is that of an older run
        if before is not None and before.state in RECORDING and message.state not in RECORDING:
            self._keep_motion()
        if message.state is State.AT_REST and self._rest_sample is None:
            self._rest_sample = message.since_sample

    def _on_begin(self, sample: int) -> None:
        """A run begins: figures and lines of the last one are not this one's."""
        self.estimate = self.last_motion = None
        for means in self._running.values():
            means.clear()
        self._peak_rad = 0.0
        self._rest_sample = None
        self._armed_sample = sample
        self.run_zeroed = self.zeroed

    def _keep_motion(self) -> None:
        """The run has ended: what it showed stays, however long the window stays open."""
        if self.estimate is not None:
            first = self.estimate.release_sample - self.rate_hz
            samples, rotation, velocity = self.trace.window(first)
            if samples.size:
                self.last_motion = samples.copy(), rotation.copy(), velocity.copy()

    def _on_estimate(self, message: EstimateMessage) -> None:
        if self.estimate is None or self.estimate.release_sample != message.release_sample:
            for means in self._running.values():
                means.clear()
        self.estimate = message
        for name, points, mean, error in (
            ("eav", message.eav, message.eav_mean, message.eav_standard_error),
            ("crt", message.crt, message.crt_mean, message.crt_standard_error),
        ):
            if points and mean is not None:
                self._running[name][points[-1].impact] = (mean, error or 0.0)

    def _on_block(self, message: BlockMessage, readings: NDArray[np.float32] | None) -> None:
        if readings is None or self.strips is None or readings.shape[0] != self.strips.n_channels:
            return
        if message.first_sample < self._newest_sample - message.n_samples:
            self._forget_data()  # the tasks were started anew
        if self.rig is not None and message.rate_hz != self.rate_hz:
            self.set_rig(self.rig, message.rate_hz)
        self._newest_sample = message.first_sample + message.n_samples
        self.strips.append(message.first_sample, readings)
        self.block_mean = readings.mean(axis=1, dtype=np.float64)
        self.overloaded = frozenset(message.overloaded)
        self._recent.append((message.first_sample, readings))
        oldest_kept = self._newest_sample - RECENT_S * message.rate_hz
        while self._recent and self._recent[0][0] + self._recent[0][1].shape[1] < oldest_kept:
            self._recent.popleft()

    def _on_motion(self, message: MotionMessage) -> None:
        self.judged_rad = message.judged_rad
        if not message.rotation_rad:
            return
        capacity = max(1, round(TRACE_S * message.rate_hz / message.step))
        if self.trace.capacity != capacity:
            self.trace = MotionTrace(capacity)
        rotation = np.asarray(message.rotation_rad)
        velocity = np.asarray(message.velocity_rad_s)
        samples = message.first_sample + message.step * np.arange(rotation.size, dtype=np.float64)
        self.trace.append(samples, rotation, velocity)
        self.rotation_rad, self.velocity_rad_s = float(rotation[-1]), float(velocity[-1])
        if self.state is not None and self.state.state in RECORDING:
            judged = rotation + (message.judged_rad - self.rotation_rad)
            self._peak_rad = max(self._peak_rad, float(np.nanmax(np.abs(judged), initial=0.0)))

    def _forget_data(self) -> None:
        if self.strips is not None:
            self.strips.clear()
        self.trace.clear()
        self._recent.clear()
        self._newest_sample = 0
        self.block_mean = None
        self.judged_rad = self.rotation_rad = self.velocity_rad_s = math.nan

    # -- reading ---------------------------------------------------------------------------------

    def age_s(self, kind: type[BaseModel]) -> float:
        """Seconds since the last message of that kind; infinite when none came."""
        return self.clock() - self._received.get(kind, -math.inf)

    def fresh(self, kind: type[BaseModel]) -> bool:
        """Whether a value from a message of that kind may be shown as live."""
        return self.age_s(kind) <= STALE_AFTER_S

    @property
    def what_is_live(self) -> tuple[bool, ...]:
        """Whether readings, rotation, health and recording are live: each change is drawn at once."""
        kinds = (BlockMessage, MotionMessage, HealthMessage)
        return (*(self.fresh(kind) for kind in kinds), self.recording_on_disk)

    @property
    def linked(self) -> bool:
        """Whether the acquisition is heard at all."""
        return min((self.age_s(kind) for kind in self._received), default=math.inf) <= SILENT_AFTER_S

    @property
    def current_state(self) -> State | None:
        """The state, or None when nothing has been heard for too long to know."""
        return self.state.state if self.state is not None and self.linked else None

    @property
    def judgement(self) -> Judgement:
        """What the recorder makes of the moment; empty when nothing has been heard for too long."""
        return self.state.judgement if self.state is not None and self.linked else Judgement()

    @property
    def judged_ratio(self) -> float:
        """|θ|/α as the recorder judges it; NaN when it is not live."""
        return abs(self.judged_rad) / self.alpha_rad if self.fresh(MotionMessage) else math.nan

    @property
    def live_judgement(self) -> Judgement:
        """The judgement with the ratio of this moment: the recorder repeats its own once a second."""
        ratio = self.judged_ratio
        return self.judgement.model_copy(update={"ratio": ratio if math.isfinite(ratio) else None})

    @property
    def data_missing(self) -> bool:
        """The clock should run, and no block has come for too long: the display is not live."""
        return self.current_state in RUNNING and not self.fresh(BlockMessage)

    def running_mean(self, name: str) -> tuple[Array, Array, Array]:
        """(impact, mean r after it, its standard error) of ``eav`` or ``crt``, as the acquisition told them.

        A window that came in mid-run knows them from then on.
        """
        means = self._running[name]
        values = np.array(list(means.values())).reshape(-1, 2)
        return np.array(list(means), dtype=np.float64), values[:, 0], values[:, 1]

    @property
    def sampling(self) -> bool:
        """Samples are coming in now."""
        return self.fresh(BlockMessage)

    @property
    def safe_s(self) -> float:
        """Seconds of this run that are known to be on disk."""
        if self.health is None or self.rate_hz <= 0:
            return 0.0
        return max(0.0, (self.health.acknowledged_sample - self._armed_sample) / self.rate_hz)

    @property
    def unsafe_s(self) -> float:
        """Seconds that were read and are not known to be on disk."""
        if self.health is None or self.rate_hz <= 0:
            return 0.0
        return max(0.0, (self.health.sample - self.health.acknowledged_sample) / self.rate_hz)

    @property
    def recording_on_disk(self) -> bool:
        """Samples are being acknowledged by the disk now: the only ground for a recording light."""
        health = self.health
        return (
            health is not None
            and self.fresh(HealthMessage)
            and health.recording
            and health.acknowledged_sample > 0
            and self.unsafe_s <= DISK_BEHIND_S
        )

    @property
    def sample_now(self) -> float:
        """The sample index of this instant, for a smooth time axis; stops soon after data stop."""
        age = min(self.age_s(MotionMessage), STALE_AFTER_S)
        last = self.trace.last_sample
        return last + age * self.rate_hz if math.isfinite(last) else math.nan

    @property
    def alpha_rad(self) -> float:
        """α of the specimen; NaN before the rig is known."""
        return self.rig.specimen.alpha0_rad if self.rig is not None else math.nan

    @property
    def peak_rotation_rad(self) -> float:
        """Largest |θ| since arming."""
        released_rad = abs(self.estimate.theta0_rad) if self.estimate is not None else 0.0
        return max(self._peak_rad, released_rad)

    @property
    def overturning_margin(self) -> float:
        """1 − |θ|/α now: 0 is the point of no return. NaN when θ is not live."""
        return 1.0 - self.judged_ratio

    @property
    def since_release_s(self) -> float:
        """Time since release on the sample clock; NaN before it."""
        if self.estimate is None or self.rate_hz <= 0:
            return math.nan
        end = self.sample_now if self._rest_sample is None else self._rest_sample
        return max(0.0, (end - self.estimate.release_sample) / self.rate_hz)

    def recent(self, duration_s: float) -> NDArray[np.float32] | None:
        """The last `duration_s` of every channel, (n_channels, n) SI, without a gap; None if there is less.

        `duration_s` at most `RECENT_S`.
        """
        wanted = round(duration_s * self.rate_hz)
        pieces: list[NDArray[np.float32]] = []
        expected_end = self._newest_sample
        have = 0
        for first, readings in reversed(self._recent):
            if first + readings.shape[1] != expected_end:
                break
            pieces.append(readings)
            have += readings.shape[1]
            expected_end = first
            if have >= wanted > 0:
                return np.concatenate(pieces[::-1], axis=1)[:, -wanted:]
        return None


def _begins(before: StateMessage | None, now: StateMessage) -> bool:
    """Whether a test is armed, or a release that nobody armed begins to be kept."""
    recorded = before is not None and before.state in RECORDING
    if now.state is State.ARMED:
        return before is None or not (recorded and before.armed)
    return before is not None and not recorded and now.state in RECORDING and not now.armed
