"""A whole test of a wall as readings, a driver that hands it out on demand, sessions on it; and processes."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from daq_app.acquisition.closing.finaliser import Finaliser
from daq_app.acquisition.messages.published import EventMessage, Message, Reply, State, StateMessage
from daq_app.acquisition.pipeline.reader import Patience
from daq_app.acquisition.process.simulated import SimulatedServer
from daq_app.acquisition.session.requests import answer
from daq_app.acquisition.session.session import Session, SessionSettings
from daq_app.acquisition.viewers.client import AcquisitionClient
from daq_app.acquisition.viewers.desk import Desk
from daq_app.config import Rig, Scaling, TaskPlan, load_rig, plan_tasks
from daq_app.rocking import RotationGeometry, free_rocking
from drivers import Block, DriverError, Opened
from sim_hardware.control import SimControl
from tests.support.recorder.process_bench import SPEED, Running, quick_rig
from tests.support.recorder.processes import free_the_hardware

RATE_HZ = 4000.0
UPRIGHT_S, PULL_S, HOLD_S = 4.0, 1.0, 6.0
RESTITUTION = 0.7
THETA0_SHARE = 0.35
TOKEN = "let me command"


@dataclass(frozen=True)
class WallTest:
    """Readings (n_channels, n) of upright, pull, hold, release, rocking, rest; and when they happen."""

    readings: NDArray[np.float64]
    release_sample: int
    rest_sample: int
    theta0_rad: float

    @property
    def n_samples(self) -> int:
        return int(self.readings.shape[1])


@pytest.fixture(scope="session")
def rig(configs: Path) -> Rig:
    loaded = load_rig(configs / "fr1.toml")
    quick = loaded.acquisition.model_copy(update={"post_rest_s": 0.5, "max_duration_s": 20.0})
    return loaded.model_copy(update={"acquisition": quick})


@pytest.fixture(scope="session")
def rig_text(configs: Path) -> str:
    return (configs / "fr1.toml").read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def plan(rig: Rig) -> TaskPlan:
    return plan_tasks(rig)


@pytest.fixture(scope="session")
def wall_test(rig: Rig) -> WallTest:
    specimen = rig.specimen
    theta0 = THETA0_SHARE * specimen.alpha0_rad
    motion = free_rocking(theta0, RESTITUTION, specimen.p_rad_s, specimen.alpha0_rad, smallest_peak_rad=1e-5)
    last_s = float(motion.impacts_s[-1])
    release_s = UPRIGHT_S + PULL_S + HOLD_S
    time_s = np.arange(int((release_s + last_s + 4.0) * RATE_HZ)) / RATE_HZ
    rotation = np.interp(time_s, [UPRIGHT_S, UPRIGHT_S + PULL_S], [0.0, theta0])
    after = time_s >= release_s
    since = time_s[after] - release_s
    rotation[after] = np.where(since < last_s, motion.at(np.minimum(since, last_s - 1e-9))[0], 0.0)
    si = np.random.default_rng(7).normal(size=(len(rig.channels), time_s.size))
    si *= np.array([channel.noise_si for channel in rig.channels])[:, None]
    wires = RotationGeometry.from_rig(rig).wires
    for name, shortening in zip(wires.ids, wires.shortening(rotation), strict=True):
        si[rig.channel_ids.index(name)] += shortening
    for row, channel in enumerate(rig.channels):
        if channel.family == "tiltmeter" and channel.axis == "x":
            si[row] += rotation
    readings = Scaling.of(rig.channels).to_readings(si)
    return WallTest(readings, round(release_s * RATE_HZ), round((release_s + last_s) * RATE_HZ), theta0)


class StageDriver:
    """A driver that plays a `WallTest` up to the sample that the test allows, and fails on cue."""

    def __init__(self, wall: WallTest) -> None:
        self._wall = wall
        self._changed = threading.Condition()
        self._allowed = 0
        self._next = 0
        self._cues: list[tuple[int, DriverError, int]] = []
        self._recovering: list[DriverError] = []
        self.plan: TaskPlan | None = None
        self.opened = 0
        self.closed = 0
        self.refuse_to_open: DriverError | None = None
        self.refuse_backup: DriverError | None = None
        self.backups: list[str] = []
        self.sizes: dict[int, int] = {}
        """How many samples each read brought, by its first."""

    def let(self, until: int) -> None:
        """Allow reading up to that sample."""
        with self._changed:
            self._allowed = max(self._allowed, until)
            self._changed.notify_all()

    def fail_at(self, sample: int, error: DriverError, *, lose: int = 0) -> None:
        """Raise `error` when reading reaches `sample`; `lose` samples are gone then."""
        self._cues.append((sample, error, lose))

    def fail_recovery(self, *errors: DriverError) -> None:
        """What the next recoveries raise."""
        self._recovering.extend(errors)

    def open(self, plan: TaskPlan) -> Opened:
        if self.refuse_to_open is not None:
            raise self.refuse_to_open
        self.plan = plan
        self.opened += 1
        return Opened(RATE_HZ, dict.fromkeys(plan.channel_ids, (-10.0, 10.0)), 80_000, (), "staged in a test")

    def start(self) -> None:
        self._next = 0

    def read(self, timeout_s: float, n_samples: int | None = None) -> Block:
        assert self.plan is not None
        if self._cues and self._next >= self._cues[0][0]:
            _, error, lose = self._cues.pop(0)
            self._next += lose
            raise error
        stop = self._next + (n_samples or self.plan.read_samples)
        with self._changed:
            if not self._changed.wait_for(lambda: self._allowed >= stop, timeout_s):
                raise DriverError("No samples", advice="Wait", retryable=True)
        readings = self._wall.readings[:, self._next : stop]
        block = Block(self._next, np.ascontiguousarray(readings), time.time_ns(), 0)
        self._next += block.n_samples
        self.sizes[block.first_sample] = block.n_samples
        if block.n_samples == 0:
            raise DriverError("The stage is empty", advice="End the test")
        return block

    def start_backup(self, stem: str) -> tuple[str, ...]:
        self.backups.append(stem)
        if self.refuse_backup is not None:
            raise self.refuse_backup
        return (f"{stem}.tdms",)

    def stop_backup(self) -> None:
        self.backups.append("stop")

    def recover(self) -> None:
        if self._recovering:
            raise self._recovering.pop(0)

    def stop(self) -> None:
        pass

    def close(self) -> None:
        self.closed += 1


@dataclass
class Live:
    """A session with its driver and one viewer that may command."""

    driver: StageDriver
    session: Session
    client: AcquisitionClient
    folder: Path
    heard: list[Message] = field(default_factory=list)

    def ask(self, name: str, **arguments: float | str) -> Reply:
        return self.client.request(name, timeout_s=60.0, **arguments)

    def wait_for(self, right: Callable[[Message], bool], timeout_s: float = 150.0) -> Message:
        """Listen until a message is the right one; all are kept in `heard`."""
        deadline = time.monotonic() + timeout_s
        while time.monotonic() < deadline:
            received = self.client.receive(0.5)
            if received is not None:
                self.heard.append(received.message)
                if right(received.message):
                    return received.message
        raise AssertionError(f"not heard within {timeout_s} s; last: {self.heard[-5:]}")

    def wait_for_state(self, *states: State) -> StateMessage:
        message = self.wait_for(lambda m: isinstance(m, StateMessage) and m.state in states)
        assert isinstance(message, StateMessage)
        return message

    def wait_for_event(self, kind: str, *, severity: str = "", **data: str) -> EventMessage:
        def right(message: Message) -> bool:
            return (
                isinstance(message, EventMessage)
                and message.kind == kind
                and severity in ("", message.severity)
                and all(message.data.get(key) == value for key, value in data.items())
            )

        message = self.wait_for(right)
        assert isinstance(message, EventMessage)
        return message

    def zero_and_arm(self, test: str = "FR1-L3-1", **plan: float) -> Path:
        """Take the zero upright, arm, and return the journal's path."""
        self.driver.let(3200)
        taken: list[Reply] = []
        asking = threading.Thread(target=lambda: taken.append(self._ask_apart("tare")))
        asking.start()
        while asking.is_alive():  # the zero needs samples from after the request
            self.driver.let(self.driver._allowed + 400)
            asking.join(0.02)
        assert taken[0].ok, taken[0].text
        reply = self.ask("arm", test=test, **plan)
        assert reply.ok, reply.text
        return Path(str(reply.data["journal"]))

    def _ask_apart(self, name: str) -> Reply:
        with AcquisitionClient(self.client._address, TOKEN, topics=()) as client:
            return client.request(name, timeout_s=60.0)


@pytest.fixture(scope="session")
def finaliser() -> Iterator[Finaliser]:
    """One warm worker for all tests."""
    made = Finaliser()
    made.start()
    yield made
    made.close()


Lives = Callable[..., Live]


@pytest.fixture
def live(
    rig: Rig, rig_text: str, plan: TaskPlan, wall_test: WallTest, tmp_path: Path, finaliser: Finaliser
) -> Iterator[Lives]:
    """Make a session on a staged driver; ended with the test."""
    ends: list[Callable[[], None]] = []

    def make(folder: Path | None = None, refusal: DriverError | None = None, **settings: Any) -> Live:
        stage = StageDriver(wall_test)
        stage.refuse_to_open = refusal
        where = folder or tmp_path / "runs"
        where.mkdir(exist_ok=True)
        # The stage runs out of samples while a run is being saved: on a busy machine for longer than 30 s.
        patience = Patience(read_timeout_s=0.05, retry_pause_s=0.01, silence_limit_s=600.0)
        settings.setdefault("patience", patience)
        session: Session | None = None
        desk = Desk("tcp://127.0.0.1:0", lambda command: _handle(session, desk, command), TOKEN)
        session = Session(
            SessionSettings(rig, rig_text, plan, where, lambda: stage, **settings), desk.publisher, finaliser
        )
        serving = threading.Thread(target=lambda: desk.serve(session.tick, 0.05))
        serving.start()
        client = AcquisitionClient(desk.addresses.commands, TOKEN)
        session.start()

        def end() -> None:
            session.close()
            desk.stop()
            serving.join()
            client.close()
            desk.close()

        ends.append(end)
        made = Live(stage, session, client, where)
        made.wait_for_state(State.PREVIEWING, State.FAILED)
        return made

    yield make
    for end in ends:
        end()


def _handle(session: Session | None, desk: Desk, command: Any) -> Any:
    if command.name == "hello":
        return Reply(ok=True, data={"publisher": desk.addresses.publisher})
    assert session is not None
    return answer(session, command)


# -- processes -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def rig_file(configs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """FR1 with a wall that comes to rest soon."""
    return quick_rig(configs, tmp_path_factory.mktemp("rig"))


@pytest.fixture(scope="module")
def server(rig_file: Path) -> Iterator[SimulatedServer]:
    """One simulated chassis with a wall that does what it is told."""
    options = ["--speed", str(SPEED), "--wall", "commanded", "--theta0-over-alpha", "0.35"]
    with SimulatedServer(rig_file, options) as started:
        assert started.connection
        yield started


@pytest.fixture
def wall(server: SimulatedServer) -> Iterator[SimControl]:
    """The simulated wall, upright and whole."""
    with SimControl(server.connection) as control:
        control.command("clear_faults")
        free_the_hardware(server.connection)
        control.command("reset")
        yield control
        control.command("clear_faults")


@pytest.fixture
def start(
    rig_file: Path, tmp_path: Path, server: SimulatedServer, wall: SimControl
) -> Iterator[Callable[..., Running]]:
    made: list[Running] = []

    def make(*options: str) -> Running:
        made.append(Running(rig_file, tmp_path / "runs", "--connection", server.connection, *options))
        return made[-1]

    yield make
    for one in made:
        if one.process.exitcode is None:
            one.kill()
