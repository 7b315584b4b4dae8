"""Faults of the machine under the recording: killed, full, slow, read-only, deleted, asleep, no memory."""

from __future__ import annotations

import os
import shutil
import signal
import sys
import time
from pathlib import Path

import pytest

from daq_app.acquisition import AcquisitionDied, AcquisitionProcess
from daq_app.acquisition.messages.published import State
from daq_app.config import Rig
from daq_app.runfile import open_run
from sim_hardware.control import SimControl
from tests.support.recorder.fault_bench import SPEED, Acquisition, Row, Start, look_at
from tests.support.recorder.processes import free_the_hardware

pytestmark = pytest.mark.heavy

linux_only = pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="needs Linux's /proc")
posix_only = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such thing")


def test_no_room_before_arming(shared: Acquisition, row: Row) -> None:
    shared.arm()
    shared.stop()
    before = {path.name for path in shared.out.glob("FR1*")}
    shared.strike()
    shared.sabotage(free_bytes=500_000_000)
    began = time.monotonic()
    while (refused := shared.client.request("arm", test="FR1-L3-1")).ok:
        shared.stop()  # the order has not arrived yet
        before = {path.name for path in shared.out.glob("FR1*")}
        began = time.monotonic()
    shared.sabotage()
    assert "0.50 GB free" in refused.text and "Free space" in refused.text
    assert {path.name for path in shared.out.glob("FR1*")} == before
    told = type("Refusal", (), {"after_s": time.monotonic() - began, "text": refused.text})()
    row("disk full before arming", told, None)


@linux_only
def test_the_disk_is_full_in_mid_run(shared: Acquisition, rig: Rig, row: Row) -> None:
    """The kernel itself refuses every byte beyond the limit, as it does on a full disk."""
    import resource

    journal = shared.arm()
    assert shared.process.pid is not None
    limits = resource.prlimit(shared.process.pid, resource.RLIMIT_FSIZE)
    shared.strike()
    resource.prlimit(shared.process.pid, resource.RLIMIT_FSIZE, (journal.stat().st_size, limits[1]))
    told = shared.told("the disk is full")
    assert "Free space" in told.text
    shared.told("Nothing has reached the disk for a second")
    resource.prlimit(shared.process.pid, resource.RLIMIT_FSIZE, limits)
    shared.told("takes data again")
    shared.record(2000)
    facts = look_at(shared.stop().run_path, rig)
    assert facts.lost == 0, facts.account
    row("disk full in mid-run", told, facts)


def test_space_that_runs_out_is_told_before_it_is_gone(shared: Acquisition, rig: Rig, row: Row) -> None:
    shared.arm()
    shared.strike()
    shared.sabotage(free_bytes=100_000_000)
    told = shared.told("MB are free")
    shared.sabotage()
    facts = look_at(shared.stop().run_path, rig)
    assert facts.lost == 0, facts.account
    row("disk nearly full in mid-run", told, facts)


def test_a_flush_that_takes_two_seconds(shared: Acquisition, rig: Rig, row: Row) -> None:
    shared.arm()
    shared.strike()
    shared.sabotage(flush_s=2.0)
    told = shared.told("has not confirmed a write")
    shared.told("Nothing has reached the disk for a second")
    shared.sabotage()
    shared.record(8000)
    facts = look_at(shared.stop().run_path, rig)
    assert facts.lost == 0, facts.account
    row("disk slow: a flush takes 2 s", told, facts)


@linux_only
def test_the_file_system_becomes_read_only(shared: Acquisition, rig: Rig, row: Row) -> None:
    journal = shared.arm()
    shared.strike()
    shared.sabotage(read_only=str(shared.out))
    told = shared.told("Recording goes on in")
    assert str(shared.spare) in told.text
    shared.record(4000)
    saved = shared.stop()
    shared.sabotage()
    assert Path(saved.run_path).parent == shared.spare and Path(saved.run_path).stem == journal.stem
    facts = look_at(saved.run_path, rig)
    assert facts.lost == 0, facts.account
    with open_run(saved.run_path) as run:
        assert any(event.kind == "armed" for event in run.events), "one run, from the arming on"
    row("file system read-only", told, facts)


def test_the_clock_of_the_machine_is_set_back(shared: Acquisition, rig: Rig, row: Row) -> None:
    shared.arm()
    shared.strike()
    shared.sabotage(clock_s=-3600.0)
    told = shared.told("was set back by 36")
    shared.record(2000)
    facts = look_at(shared.stop().run_path, rig)
    assert facts.lost == 0 and any("set back" in text for text in facts.reasons)
    shared.sabotage()
    row("machine's clock set back by an hour", told, facts)


@posix_only
@pytest.mark.parametrize("asleep_s", [2.0, 12.0])
def test_the_machine_is_asleep(shared: Acquisition, rig: Rig, row: Row, asleep_s: float) -> None:
    shared.arm()
    assert shared.process.pid is not None
    os.kill(shared.process.pid, signal.SIGSTOP)
    time.sleep(asleep_s)  # this is the fault itself
    os.kill(shared.process.pid, signal.SIGCONT)
    shared.strike()
    told = shared.told("stood still for")
    within_buffer = asleep_s * SPEED < 20.0
    if not within_buffer:
        shared.told("samples lost from")
    shared.record(8000)
    facts = look_at(shared.stop().run_path, rig)
    if within_buffer:
        assert facts.lost == 0, facts.account
    else:
        assert (asleep_s * SPEED - 20.0) * 4000 <= facts.lost <= (asleep_s * SPEED - 20.0 + 20.0) * 4000
    row(f"machine asleep for {asleep_s * SPEED:g} s of a 20 s buffer", told, facts)


def test_memory_that_runs_short(shared: Acquisition, rig: Rig, row: Row) -> None:
    shared.arm()
    shared.strike()
    shared.sabotage(memory_bytes=200 * 2**20)
    told = shared.told("MB of memory are left")
    assert "Close other programs" in told.text
    shared.sabotage(no_memory=True)
    shared.told("The memory of this computer is full")
    shared.sabotage()
    shared.told("Samples are written again")
    shared.record(2000)
    facts = look_at(shared.stop().run_path, rig)
    assert facts.lost == 0, facts.account
    row("memory short, then full", told, facts)


# -- with processes of their own -----------------------------------------------------------------------


def test_the_acquisition_is_killed(start: Start, bench: SimControl, rig: Rig, row: Row) -> None:
    first = start()
    journal = first.arm()
    safe = first.record(6000)
    first.kill()
    second = start()
    second.strike()
    second._mark = 0
    told = second.told("An earlier session was cut off")
    told.after_s = max(0.0, told.after_s)
    second.told("Left by an earlier session")
    facts = look_at(journal.with_suffix(".h5"), rig)
    assert facts.lost == 0 and facts.end >= safe, "what was acknowledged is there"
    assert facts.verdict == "bad" and "it was cut off" in " ".join(facts.reasons)
    row("acquisition killed (kill −9)", told, facts)
    second.arm("FR1-L3-2")
    second.stop()
    assert second.end() == 0


@posix_only
def test_the_folder_is_deleted_under_the_run(start: Start, rig: Rig, row: Row) -> None:
    lab = start()
    journal = lab.arm()
    lab.strike()
    shutil.rmtree(lab.out)
    told = lab.told("was deleted or moved")
    assert "Recording goes on in" in told.text
    lab.record(4000)
    saved = lab.stop()
    assert Path(saved.run_path) == lab.spare / f"{journal.stem}.h5"
    facts = look_at(saved.run_path, rig)
    assert facts.lost == 0, facts.account
    row("folder deleted under the run", told, facts)
    assert lab.end() == 0


def second_recorder(
    rig_file: Path, out: Path, connection: str
) -> tuple[AcquisitionProcess | None, str, float]:
    """Try to start another one; it may refuse."""
    began = time.monotonic()
    arguments = [
        *("--rig", str(rig_file), "--out", str(out), "--connection", connection, "--speed", str(SPEED)),
        *("--test", "FR1-L3-1"),
    ]
    try:
        process = AcquisitionProcess(arguments)
    except AcquisitionDied as died:
        return None, died.said, time.monotonic() - began
    assert process.wait(60.0) == 3
    return process, process.said, time.monotonic() - began


@pytest.mark.parametrize("same", ["folder", "hardware"])
def test_a_second_acquisition(start: Start, rig: Rig, rig_file: Path, row: Row, same: str) -> None:
    lab = start()
    lab.arm()
    out = lab.out if same == "folder" else lab.out.with_name("other")
    _, said, _ = second_recorder(rig_file, out, lab.connection)
    assert ("in use by another recorder" if same == "folder" else "Close the other program") in said
    lab.record(2000)
    facts = look_at(lab.stop().run_path, rig)
    assert facts.lost == 0, "the first one does not notice"
    assert not list(lab.out.with_name("other").glob("FR1*"))
    row(f"two acquisitions on the same {same}", None, facts, said.strip().splitlines()[-1])
    assert lab.end() == 0
    free_the_hardware(lab.connection)
    assert lab.state(*State)
