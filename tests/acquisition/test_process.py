"""The acquisition process from outside: started, commanded, killed, frozen, refused; simulated hardware."""

from __future__ import annotations

import json
import multiprocessing
import os
import random
import signal
import sys
import time
from collections.abc import Callable, Iterator
from multiprocessing.context import ForkServerContext, SpawnContext
from pathlib import Path

import grpc
import pytest
import session_pb2
import session_pb2_grpc

from daq_app.acquisition import AcquisitionClient, AcquisitionDied, AcquisitionProcess, read_session_file
from daq_app.acquisition.messages import HealthMessage, Message, State, StateMessage
from daq_app.acquisition.process import main, run_and_exit
from daq_app.acquisition.simulated import SimulatedServer
from daq_app.runfile import FolderLock, open_run, verify
from sim_hardware.control import SimControl

SPEED = 5
"""Slow enough that a busy machine keeps up: at this speed the buffer of 20 s lasts 4 s."""
RESTITUTION = 0.75
RATE_HZ = 4000


@pytest.fixture(scope="module")
def rig_file(configs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """FR1 with a wall that comes to rest soon."""
    text = (configs / "fr1.toml").read_text(encoding="utf-8")
    for old, new in (
        ("restitution = 0.895", f"restitution = {RESTITUTION}"),
        ("post_rest_s = 2.0", "post_rest_s = 0.5"),
    ):
        assert old in text
        text = text.replace(old, new)
    path = tmp_path_factory.mktemp("rig") / "quick.toml"
    path.write_text(text, encoding="utf-8")
    return path


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
        free_the_hardware(server)
        control.command("reset")
        yield control
        control.command("clear_faults")


def free_the_hardware(server: SimulatedServer) -> None:
    """Forget what killed sessions left on the server, as its operator would with a reset."""
    with grpc.insecure_channel(server.connection.removeprefix("grpc://")) as channel:
        session_pb2_grpc.SessionUtilitiesStub(channel).ResetServer(session_pb2.ResetServerRequest())


def _context() -> ForkServerContext | SpawnContext:
    """Processes that start quickly where the platform can fork from one that has loaded everything."""
    if sys.platform == "win32":
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(
        ["daq_app.acquisition.process", "daq_app.acquisition.session", "drivers.nidaqmx_driver"]
    )
    return context


class Running:
    """An acquisition process and a viewer that may command."""

    def __init__(self, rig: Path, out: Path, *options: str) -> None:
        self.out = out
        arguments = ["--rig", str(rig), "--out", str(out), "--speed", str(SPEED), *options]
        self.process = _context().Process(target=run_and_exit, args=(arguments,))
        self.process.start()
        deadline = time.monotonic() + 60
        session = None
        while session is None or session.pid != self.process.pid:
            assert self.process.exitcode is None, f"ended with {self.process.exitcode}"
            assert time.monotonic() < deadline
            self.process.join(0.02)
            session = read_session_file(out)
        self.client = AcquisitionClient(session.address, session.token, timeout_s=60.0)
        self.acknowledged = 0
        self.test_journal = ""

    def wait_for(self, right: Callable[[Message], bool], timeout_s: float = 200.0) -> Message:
        deadline = time.monotonic() + timeout_s
        while time.monotonic() < deadline:
            received = self.client.receive(0.2)
            if received is None:
                assert self.process.exitcode is None, f"ended with {self.process.exitcode}"
                continue
            message = received.message
            if isinstance(message, HealthMessage) and message.recording:
                self.acknowledged = max(self.acknowledged, message.acknowledged_sample)
            if right(message):
                return message
        raise AssertionError("not heard in time")

    def wait_for_state(self, *states: State) -> StateMessage:
        message = self.wait_for(lambda m: isinstance(m, StateMessage) and m.state in states)
        assert isinstance(message, StateMessage)
        return message

    def wait_for_safe(self, sample: int) -> None:
        """Until that sample is on disk."""
        self.wait_for(lambda m: self.acknowledged >= sample)

    def arm(self, test: str) -> None:
        self.wait_for_state(State.PREVIEWING)
        reply = self.client.request("arm", test=test, timeout_s=30.0)
        assert reply.ok, reply.text
        self.test_journal = str(reply.data["journal"])

    def kill(self) -> None:
        self.process.kill()
        self.process.join()
        self.client.close()

    def end(self) -> int:
        self.client.request("shutdown", force=1.0, timeout_s=30.0)
        return self.wait()

    def wait(self) -> int:
        self.process.join(200)
        self.client.close()
        code = self.process.exitcode
        if code is None:
            self.process.kill()
            raise AssertionError("the process does not end")
        return code


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


def whole_test(running: Running, wall: SimControl, test: str) -> StateMessage:
    running.wait_for_state(State.PREVIEWING)
    zeroed = running.client.request("tare", timeout_s=60.0)
    assert zeroed.ok, zeroed.text
    running.arm(test)
    wall.command("pull", duration_s=1.0)
    held = running.wait_for_state(State.HOLDING)
    # As in a lab: the wall hangs still for a while before it is let go.
    running.wait_for(lambda m: isinstance(m, HealthMessage) and m.sample >= held.sample + 3 * RATE_HZ)
    wall.command("release")
    return running.wait_for_state(State.SAVED, State.FAILED)


@pytest.mark.heavy
def test_killed_at_twenty_random_moments_every_run_is_recovered_by_the_next_start(
    start: Callable[..., Running], wall: SimControl, tmp_path: Path
) -> None:
    """From arming to finalising: at most the block that was being read is lost, and nothing needs a hand."""
    rng = random.Random(20)
    safe: dict[str, int] = {}
    for round_number in range(20):
        wall.command("reset")
        running = start()
        running.arm(f"FR1-L3-{round_number}")
        stem = Path(running.test_journal).stem
        moment = rng.choice(["armed", "pulled", "rocking", "finalising"])
        running.wait_for_safe(rng.randrange(400, 8000))
        if moment != "armed":
            wall.command("pull", duration_s=1.0)
            running.wait_for_safe(running.acknowledged + rng.randrange(0, 8000))
        if moment in ("rocking", "finalising"):
            running.wait_for_state(State.HOLDING)
            wall.command("release")
            running.wait_for_safe(running.acknowledged + rng.randrange(0, 12_000))
        if moment == "finalising" and running.process.exitcode is None:
            running.client.request("stop")
            running.process.join(rng.uniform(0.0, 0.5))
        safe[stem] = running.acknowledged
        running.kill()
    last = start()
    last.wait_for(lambda m: not list((tmp_path / "runs").glob("*.journal")), timeout_s=300.0)
    assert last.end() == 0
    for stem, acknowledged in safe.items():
        path = tmp_path / "runs" / f"{stem}.h5"
        assert path.exists(), (
            f"{stem} was not recovered; left: {sorted(p.name for p in path.parent.iterdir())}"
        )
        report = verify(path)
        assert report.ok, report.problems
        with open_run(path) as run:
            assert run.gaps == ()
            assert run.first_sample + run.n_samples >= acknowledged, "what was acknowledged is there"
    assert not list((tmp_path / "runs").glob("*.journal"))


def test_what_was_recovered_is_said_to_whoever_looks(start: Callable[..., Running]) -> None:
    first = start()
    first.arm("FR1-L3-1")
    first.wait_for_safe(4000)
    first.kill()
    second = start()
    second.wait_for_state(State.PREVIEWING)

    def told() -> list[str]:
        events = second.client.request("hello").data["events"]
        assert isinstance(events, list)
        return [event["text"] for event in events if event["kind"] == "recovered"]

    second.wait_for(lambda m: bool(told()))
    assert "Left by an earlier session" in told()[0] and "FR1-L3-1" in told()[0]
    assert second.end() == 0


def test_two_recorders_never_share_a_folder(
    start: Callable[..., Running], configs: Path, server: SimulatedServer, tmp_path: Path
) -> None:
    running = start()
    with pytest.raises(AcquisitionDied) as died:
        AcquisitionProcess(
            [
                "--rig",
                str(configs / "fr1.toml"),
                "--out",
                str(tmp_path / "runs"),
                "--connection",
                server.connection,
            ]
        )
    assert died.value.exit_code == 2
    assert "in use by another recorder" in died.value.said and str(running.process.pid) in died.value.said
    assert running.end() == 0


def test_hardware_that_another_recorder_holds(
    start: Callable[..., Running], configs: Path, server: SimulatedServer, tmp_path: Path
) -> None:
    running = start()
    running.wait_for_state(State.PREVIEWING)
    other = AcquisitionProcess(
        [
            *("--rig", str(configs / "fr1.toml"), "--out", str(tmp_path / "other"), "--test", "FR1-L3-1"),
            *("--connection", server.connection),
        ]
    )
    assert other.wait(60) == 3
    assert "reserved by another program" in other.said and "Close the other program" in other.said
    assert running.end() == 0


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ({"kind": "module_removed", "target": "cDAQ1Mod2"}, "cDAQ1Mod2"),
        ({"kind": "reserved", "target": "cDAQ1Mod1"}, "reserved by another program"),
    ],
)
def test_hardware_that_cannot_be_opened_is_told_and_the_process_waits(
    start: Callable[..., Running], wall: SimControl, fault: dict[str, str], words: str
) -> None:
    wall.command("fault", **fault)
    running = start()
    assert words in running.wait_for_state(State.FAILED).text
    wall.command("clear_faults")
    assert running.client.request("preview").ok
    running.wait_for_state(State.PREVIEWING)
    assert running.end() == 0


def test_the_wrong_module_in_a_slot_is_told_and_nothing_is_armed(
    start: Callable[..., Running], wall: SimControl
) -> None:
    wall.command("fault", kind="wrong_device", target="cDAQ1Mod4", product="NI 9201")
    running = start()
    said = running.wait_for_state(State.FAILED).text
    assert "cDAQ1Mod4 is a NI 9201" in said and "put the right module into slot 4" in said
    assert not running.client.request("arm", test="FR1-L3-1").ok
    assert running.end() == 0


def test_a_server_that_dies_in_mid_run_costs_nothing_that_was_read(configs: Path, tmp_path: Path) -> None:
    with SimulatedServer(configs / "fr1.toml", ["--speed", "5", "--wall", "commanded"]) as own:
        running = Running(
            configs / "fr1.toml", tmp_path, "--connection", own.connection, "--reconnect-within", "0.5"
        )
        running.arm("FR1-L3-1")
        running.wait_for_safe(8000)
        own.process.kill()
        failed = running.wait_for_state(State.FAILED)
        assert "cannot be reached" in failed.text or "No answer" in failed.text
        assert verify(failed.run_path).ok
        with open_run(Path(failed.run_path)) as run:
            assert run.first_sample + run.n_samples >= running.acknowledged >= 8000
            assert run.gaps == ()
        assert running.end() == 0


def test_an_interrupt_stops_the_test_keeps_it_and_ends(start: Callable[..., Running]) -> None:
    running = start()
    running.arm("FR1-L3-1")
    running.wait_for_safe(4000)
    assert running.process.pid is not None
    os.kill(running.process.pid, signal.SIGTERM)
    assert running.wait() == 130
    (path,) = running.out.glob("*.h5")
    assert verify(path).ok
    assert not (running.out / ".acquisition.json").exists()


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="this system cannot stop and continue a process")
def test_a_machine_that_slept_finds_its_samples_in_the_buffer_or_says_what_it_lost(
    start: Callable[..., Running], wall: SimControl
) -> None:
    running = start()
    running.arm("FR1-L3-1")
    running.wait_for_safe(4000)
    assert running.process.pid is not None
    asleep_s = 30.0  # more than the device's buffer of 20 s
    os.kill(running.process.pid, signal.SIGSTOP)
    begin = float(wall.command("bench")["time_s"])
    while float(wall.command("bench")["time_s"]) < begin + asleep_s:
        pass
    os.kill(running.process.pid, signal.SIGCONT)
    running.wait_for_safe(running.acknowledged + round(asleep_s + 5.0) * 4000)
    running.client.request("stop")
    saved = running.wait_for_state(State.SAVED, State.FAILED)
    report = verify(saved.run_path)
    assert report.ok
    with open_run(Path(saved.run_path)) as run:
        gap = run.gaps[0]
        # The device kept its last 20 s; a margin of a twentieth is given up to fetch the rest in peace.
        assert 8 * 4000 < gap.n_samples < 20 * 4000
        assert "overwr" in gap.reason
        assert report.lost_samples == sum(one.n_samples for one in run.gaps)
    assert running.end() == 0


def test_a_killed_viewer_costs_no_sample(start: Callable[..., Running], wall: SimControl) -> None:
    running = start()
    with AcquisitionClient(running.client._address) as other:
        other.receive(1.0)
        saved = whole_test(running, wall, "FR1-L3-1")
    with open_run(Path(saved.run_path)) as run:
        assert run.gaps == ()
        assert run.derived is not None
        results = run.derived.results
        assert results["quality"]["verdict"] == "good"
        for method in ("eav", "crt"):
            assert results["analysis"]["estimates"][method]["r"] == pytest.approx(RESTITUTION, abs=0.003)
            assert results["online"][f"{method}_mean"] == pytest.approx(RESTITUTION, abs=0.003)
    assert running.end() == 0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--rig", "nowhere.toml"], "nowhere.toml"),
        (["--connection", "usb"], "no way to the hardware"),
        (["--connection", "replay:nowhere.h5"], "nowhere.h5"),
        (["--bind", "tcp://0.0.0.0:0"], "keys"),
        (["--bind", "tcp://127.0.0.1:70000"], "Cannot listen"),
        (["--out", "{file}"], "Choose a folder"),
    ],
)
def test_bad_options_end_with_one_paragraph_and_no_traceback(
    configs: Path, tmp_path: Path, options: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("no folder")
    given = ["--rig", str(configs / "fr1.toml"), "--connection", "grpc://127.0.0.1:1", "--out", str(tmp_path)]
    code = main([*given, *(option.format(file=tmp_path / "file") for option in options)])
    assert code in (2, 3)
    said = capsys.readouterr().err
    assert words in said and len(said.strip().splitlines()) == 1


def test_the_session_file_is_for_its_owner_only(start: Callable[..., Running]) -> None:
    running = start()
    path = running.out / ".acquisition.json"
    if sys.platform != "win32":
        assert path.stat().st_mode & 0o077 == 0
    assert json.loads(path.read_text(encoding="utf-8"))["token"]
    assert running.end() == 0
    with FolderLock(running.out):
        pass
