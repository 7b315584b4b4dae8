"""Every fault of the simulated device server through the real nidaqmx client: what it costs, what is told."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from nptdms import TdmsFile

from daq_app.acquisition.messages.published import HealthMessage, State
from daq_app.acquisition.process.simulated import SimulatedServer
from daq_app.config import Rig
from daq_app.runfile import open_run
from sim_hardware.control import SimControl
from tests.support.recorder.fault_bench import RATE_HZ, SPEED, Acquisition, Row, Standing, Start, look_at

pytestmark = pytest.mark.heavy


@dataclass
class Drifting:
    """A device whose clock is 50 ppm fast, watched since the first test of this module."""

    lab: Acquisition
    since_s: float


@pytest.fixture(scope="module", autouse=True)
def drifting(rig_file: Path, rig: Rig, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Drifting]:
    """The slowest of all faults to see: it runs beside the others, at real time."""
    out = tmp_path_factory.mktemp("drifting") / "runs"
    with SimulatedServer(rig_file, ["--wall", "marked"]) as own:
        with SimControl(own.connection) as control:
            control.command("fault", kind="clock_drift", target="cDAQ1", ppm=50.0)
        lab = Acquisition(rig_file, rig, out, own.connection)
        lab.state(State.PREVIEWING)
        yield Drifting(lab, time.monotonic())
        lab.kill()


def test_samples_overwritten(shared: Acquisition, bench: SimControl, rig: Rig, row: Row) -> None:
    shared.arm()
    shared.strike()
    bench.command("fault", kind="buffer_overwritten", lost_samples=1000.0)
    told = shared.told("overwrote samples")
    shared.told("samples lost from")
    shared.record(2000)
    facts = look_at(shared.stop().run_path, rig)
    # The thousand, and the twentieth of the buffer that is given up so that the rest can be fetched in peace.
    assert 1000 <= facts.lost <= 1000 + 80_000 // 20 + 4000
    assert facts.verdict == "bad" and f"{facts.lost} samples are missing" in facts.reasons[0]
    row("samples overwritten (−200279)", told, facts)


def test_a_read_times_out(shared: Acquisition, bench: SimControl, rig: Rig, row: Row) -> None:
    shared.arm()
    shared.strike()
    bench.command("fault", kind="read_timeout", samples=123.0)
    told = shared.told("No new samples arrived in time")
    assert "tried again" in told.text
    shared.record(2000)
    facts = look_at(shared.stop().run_path, rig)
    assert facts.lost == 0, facts.account
    row("a read times out (−200284)", told, facts)


@pytest.mark.parametrize("part", ["array", "message"])
def test_a_reply_cut_short(shared: Acquisition, bench: SimControl, rig: Rig, row: Row, part: str) -> None:
    shared.arm()
    shared.strike()
    bench.command("fault", kind="reply_cut_short", part=part)
    told = shared.told("cut short", "could not be understood", "could not be used")
    assert "asked" in told.text
    shared.record(2000)
    facts = look_at(shared.stop().run_path, rig)
    assert facts.lost == 0, facts.account
    row(f"a reply cut short ({part})", told, facts)


def test_replies_out_of_order(shared: Acquisition, bench: SimControl, rig: Rig, row: Row) -> None:
    shared.arm()
    shared.strike()
    bench.command("fault", kind="reply_out_of_order")
    told = shared.told("The device stands at sample")
    shared.record(4000)
    facts = look_at(shared.stop().run_path, rig)
    assert facts.lost == 0, facts.account
    row("replies out of order", told, facts)


def test_a_server_that_freezes(shared: Acquisition, bench: SimControl, rig: Rig, row: Row) -> None:
    shared.arm()
    shared.strike()
    bench.command("fault", kind="server_frozen", for_s=2.7)
    told = shared.told("No samples for a second", "does not answer")
    shared.told("Reading goes on", "Samples arrive again")
    shared.record(2000)
    facts = look_at(shared.stop().run_path, rig)
    assert facts.lost == 0, "2.7 s (11 s of the device) lie within its buffer of 20 s"
    row("server frozen for 2.7 s", told, facts)


def test_a_stalled_device(shared: Acquisition, bench: SimControl, rig: Rig, row: Row) -> None:
    """No sample is lost, for none was taken; but the times after it are wrong, and the verdict says so."""
    shared.arm()
    shared.record(10_000)  # the clock is known after a second
    shared.strike()
    bench.command("fault", kind="stalled", target="cDAQ1", for_s=1.6 * SPEED)
    told = shared.told("No samples for a second", "No new samples arrived in time")
    shared.told("The sample clock stood still")
    shared.record(2000)
    facts = look_at(shared.stop().run_path, rig)
    assert facts.lost == 0, facts.account
    assert facts.verdict == "bad" and any("every later time is too small" in text for text in facts.reasons)
    row(f"stalled device, {1.6 * SPEED:g} s without samples", told, facts)


@pytest.mark.parametrize("for_s", [0.2, 2.0, 20.0])
def test_the_chassis_off_the_network(
    shared: Acquisition, bench: SimControl, rig: Rig, row: Row, for_s: float
) -> None:
    shared.arm()
    shared.strike()
    bench.command("fault", kind="chassis_offline", target="cDAQ1", for_s=for_s)
    fault = f"chassis off the network for {for_s:g} s"
    if for_s < 1.0:
        shared.record(4000)
        facts = look_at(shared.stop().run_path, rig)
        assert facts.lost == 0, facts.account
        row(fault, None, facts, "nothing: the samples come 0.2 s later")
        return
    told = shared.told("does not answer any more")
    again = shared.told("started again")
    shared.told("samples lost from")
    shared.record(2000)
    facts = look_at(shared.stop().run_path, rig)
    # What was sampled before the outage had been read; the gap is as long as the outage, and a little …
    assert (for_s - 1.5) * RATE_HZ < facts.lost < (for_s + 8.0) * RATE_HZ, facts.account
    # … and no longer than until sampling began again (the device's clock runs faster than ours).
    assert facts.lost < (again.after_s * SPEED + 1.0) * RATE_HZ, facts.account
    assert facts.verdict == "bad"
    row(fault, told, facts)


def test_a_module_pulled_out_and_put_back(shared: Acquisition, bench: SimControl, rig: Rig, row: Row) -> None:
    shared.arm()
    shared.strike()
    bench.command("fault", kind="module_removed", target="cDAQ1Mod2", for_s=4.0)
    told = shared.told("does not answer any more")
    assert "module's seat" in told.text and "cDAQ1Mod2" in told.text
    shared.told("started again")
    shared.record(2000)
    facts = look_at(shared.stop().run_path, rig)
    assert facts.lost > 0 and facts.verdict == "bad"
    with open_run(shared.out / f"{shared.state(State.SAVED).run_path.rsplit('/')[-1]}") as run:
        assert "started again" in run.gaps[0].reason and "known to" in run.gaps[0].reason
    row("module pulled out, put back after 4 s", told, facts)


@pytest.fixture
def free_chassis(standing: Standing) -> None:
    """The fault must not meet the standing acquisition."""
    standing.end()


def test_a_module_that_stays_away_ends_the_run_in_good_order(
    start: Start, bench: SimControl, rig: Rig, row: Row
) -> None:
    lab = start("--reconnect-within", "1")
    lab.arm()
    lab.strike()
    bench.command("fault", kind="module_removed", target="cDAQ1Mod2")
    told = lab.told("does not answer any more")
    failed = lab.state(State.FAILED)
    assert "No answer for 1 s" in failed.text
    facts = look_at(failed.run_path, rig)
    assert facts.lost == 0 and facts.verdict == "bad" and "the acquisition failed" in " ".join(facts.reasons)
    assert not lab.client.request("arm", test="FR1-L3-2").ok
    bench.command("clear_faults")
    lab.arm("FR1-L3-2")
    assert look_at(lab.stop().run_path, rig).lost == 0
    row("module pulled out for good", told, facts)


@pytest.mark.parametrize("comes_back", [False, True])
def test_the_server_is_killed(start: Start, rig: Rig, rig_file: Path, row: Row, comes_back: bool) -> None:
    options = ["--speed", str(SPEED), "--wall", "marked"]
    with SimulatedServer(rig_file, options) as own:
        port = own.connection.rpartition(":")[2]
        lab = start("--reconnect-within", "60" if comes_back else "1", connection=own.connection)
        lab.arm()
        before = lab.safe_sample
        lab.strike()
        own.process.kill()
        told = lab.told("cannot be reached")
        assert "Check that it runs" in told.text
        if not comes_back:
            failed = lab.state(State.FAILED)
            facts = look_at(failed.run_path, rig)
            assert facts.lost == 0 and facts.end >= before and facts.verdict == "bad"
            row("server killed", told, facts)
            return
        with SimulatedServer(rig_file, [*options, "--port", port]) as again:
            assert again.connection == own.connection
            lab.told("started again")
            lab.record(2000)
            facts = look_at(lab.stop().run_path, rig, one_device=False)
            assert facts.lost > 0 and facts.verdict == "bad"
            row("server killed and started again", told, facts)
            assert lab.end() == 0


@pytest.mark.usefixtures("free_chassis")
def test_the_second_recorder_keeps_the_same_samples_by_itself(
    start: Start, bench: SimControl, rig: Rig, tmp_path: Path
) -> None:
    """DAQmx's own TDMS files (LOG_AND_READ), through a device that had to be started again meanwhile."""
    (tmp_path / "tdms").mkdir()
    lab = start("--backup", str(tmp_path / "tdms"))
    lab.arm()
    lab.told_in_all("The NI driver records as well")
    bench.command("fault", kind="module_removed", target="cDAQ1Mod2", for_s=1.0)
    lab.told_in_all("started again")
    lab.told_in_all("samples lost from")
    lab.record(4000)
    saved = lab.stop()
    assert look_at(saved.run_path, rig).lost > 0
    assert lab.end() == 0, "the NI driver's files are whole once it has closed them"
    first, second = sorted((tmp_path / "tdms").glob("FR1-*.tdms"), key=lambda path: len(path.name))
    assert "-from-" in second.name
    with open_run(saved.run_path) as run, TdmsFile.open(first) as before, TdmsFile.open(second) as after:
        name = run.channel_ids[0]
        readings = run.readings([name])[0]
        gap = run.gaps[0]
        kept = before.groups()[0].channels()[0][:]
        start_at = gap.first_sample - run.first_sample - kept.size
        assert start_at >= 0 and kept.size > 800
        assert np.array_equal(kept, readings[start_at : start_at + kept.size])
        kept = after.groups()[0].channels()[0][:]
        rest = readings[gap.end - run.first_sample :]
        assert kept.size > 3000 and abs(kept.size - rest.size) < 4000
        n = min(kept.size, rest.size)
        assert np.array_equal(kept[:n], rest[:n])


def test_a_clock_that_is_50_ppm_off(drifting: Drifting, rig: Rig, row: Row) -> None:
    """Too little for any test to suffer from; seen after a minute or so, and said in every run after."""
    lab = drifting.lab
    lab._struck_s = drifting.since_s
    lab._mark = 0
    told = lab.told("runs fast by at least")
    lab.arm()
    lab.record(24_000)  # more than the 20 000 in which such a clock gains a sample
    facts = look_at(lab.stop().run_path, rig, clock_ppm=50.0)
    assert facts.lost == 0, facts.account
    said = next(text for text in facts.reasons if "runs fast by at least" in text)
    assert 20 <= float(said.partition("at least ")[2].partition(" ppm")[0]) <= 50, said
    row("sample clock 50 ppm fast", told, facts)


# -- before anything is armed ------------------------------------------------------------------------


def refused(lab: Acquisition, row: Row, fault: str, *words: str) -> None:
    told = lab.told(*words)
    lab.state(State.FAILED)
    assert not lab.client.request("arm", test="FR1-L3-1").ok
    assert not list(lab.out.glob("*.journal")) and not list(lab.out.glob("*.h5"))
    row(fault, told, None)


def prepared(start: Start, bench: SimControl, **fault: str | float) -> Acquisition:
    """An acquisition that meets the fault when it begins to sample again."""
    bench.command("fault", **fault)
    lab = start()
    lab.state(State.FAILED)
    lab.strike()
    assert lab.client.request("preview").ok
    return lab


@pytest.mark.usefixtures("free_chassis")
def test_the_wrong_device_in_a_slot(start: Start, bench: SimControl, row: Row) -> None:
    lab = prepared(start, bench, kind="wrong_device", target="cDAQ1Mod4", product="NI 9201")
    refused(lab, row, "wrong device in a slot", "put the right module into slot 4")


@pytest.mark.usefixtures("free_chassis")
def test_a_terminal_that_another_task_has_reserved(start: Start, bench: SimControl, row: Row) -> None:
    lab = prepared(start, bench, kind="reserved", target="cDAQ1Mod1")
    refused(lab, row, "terminal reserved by another task", "Close the other program")
    bench.command("clear_faults")
    lab.arm()
    lab.stop()


@pytest.mark.usefixtures("free_chassis")
def test_a_clock_that_is_coerced_to_another_rate(start: Start, bench: SimControl, rig: Rig, row: Row) -> None:
    bench.command("fault", kind="clock_rate", target="cDAQ1", rate_hz=5000.0)
    lab = start()
    lab.mark()
    lab._struck_s = time.monotonic()
    lab.arm()
    lab.heard.wait(lambda m: isinstance(m, HealthMessage) and m.recording, 0, "recording")
    facts = look_at(lab.stop().run_path, None)
    assert any("5000 Hz where 4000 Hz were planned" in text for text in facts.reasons)
    path = next(lab.out.glob("*.h5"))
    with open_run(path) as run:
        assert run.rate_hz == 5000.0, "every time axis uses the rate that was read back"
    lab._mark = 0
    told = lab.told("5000 Hz where 4000 Hz were planned")
    opened = lab.heard.wait(lambda m: getattr(m, "text", "").startswith("Sampling at"), 0, "sampling")[0]
    told.after_s = max(0.0, told.after_s + lab._struck_s - opened)
    row("clock coerced to 5000 Hz", told, facts)
