"""The acquisition process from outside: killed, frozen, interrupted; every run is there."""

from __future__ import annotations

import os
import random
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from daq_app.acquisition import AcquisitionClient
from daq_app.acquisition.messages.published import State
from daq_app.acquisition.process.simulated import SimulatedServer
from daq_app.runfile import open_run, verify
from sim_hardware.control import SimControl
from tests.support.recorder.process_bench import RESTITUTION, SPEED, Running, whole_test


@pytest.mark.heavy
@pytest.mark.parametrize("seed", range(20, 24))
def test_killed_at_five_random_moments_every_run_is_recovered_by_the_next_start(
    start: Callable[..., Running], wall: SimControl, tmp_path: Path, seed: int
) -> None:
    """From arming to finalising: at most the block that was being read is lost, and nothing needs a hand."""
    rng = random.Random(seed)
    safe: dict[str, int] = {}
    for round_number in range(5):
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
            # The wall rests after 2.6 s, and a second later the recording ends by itself: the longest of
            # these moments lie about there, on one side or the other as busy as the machine is.
            running.wait_for_safe_or_over(running.acknowledged + rng.randrange(0, 12_000))
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


@pytest.mark.skipif(sys.platform == "win32", reason="there a program is ended, and not asked to end")
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
    while (left_s := begin + asleep_s - float(wall.command("bench")["time_s"])) > 0.0:
        time.sleep(left_s / SPEED)  # this is the fault itself
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
    # Nothing is acknowledged any more: who waits for a sample behind the end is told, and does not hang.
    running.wait_for_safe_or_over(saved.sample + 10**6)
    with pytest.raises(AssertionError, match=r"ended before sample \d+[^$]*said last:[^$]*at rest"):
        running.wait_for_safe(saved.sample + 10**6)
    with open_run(Path(saved.run_path)) as run:
        assert run.gaps == ()
        assert run.derived is not None
        results = run.derived.results
        assert results["quality"]["verdict"] == "good"
        for method in ("eav", "crt"):
            assert results["analysis"]["estimates"][method]["r"] == pytest.approx(RESTITUTION, abs=0.003)
            assert results["online"][f"{method}_mean"] == pytest.approx(RESTITUTION, abs=0.003)
    assert running.end() == 0
