"""Each fault the simulated hardware can be told to have, as the real nidaqmx client meets it."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import nidaqmx
import numpy as np
import pytest
from nidaqmx.constants import AcquisitionType, OverwriteMode, ReadRelativeTo
from nidaqmx.errors import DaqError, DaqReadError, RpcError
from nidaqmx.stream_readers import AnalogMultiChannelReader

from daq_app.config.errors import ConfigError
from sim_hardware.control import SimControlError
from sim_hardware.faults.model import KINDS, fault_from
from sim_hardware.faults.script import load_faults
from tests.support.server_support import Rig, TestSignals, continuous

RATE = 1000.0


def _running(rig: Rig, terminals: str = "cDAQ1Mod1/ai0:1", name: str = "wall") -> nidaqmx.Task:
    task = rig.task(name)
    task.ai_channels.add_ai_voltage_chan(terminals, min_val=-10, max_val=10)
    continuous(task, RATE)
    return task


def _truth(first: int, n: int, terminal: str = "x/ai0", rate: float = RATE) -> np.ndarray:
    return TestSignals().volts((terminal,), (first + np.arange(n)) / rate)[0]


def _read(task: nidaqmx.Task, n: int) -> np.ndarray:
    return np.array(task.read(n, timeout=30.0))


@pytest.mark.parametrize(
    ("kind", "parameters", "during"),
    [
        ("channel_stuck", {}, lambda truth, t: np.full_like(truth, truth[0])),
        ("channel_stuck", {"value_v": 2.5}, lambda truth, t: np.full_like(truth, 2.5)),
        ("channel_saturated", {"side": "low"}, lambda truth, t: np.full_like(truth, -10.0)),
        ("channel_swapped", {}, lambda truth, t: -truth),
        (
            "channel_hum",
            {"amplitude_v": 0.5, "frequency_hz": 60.0},
            lambda truth, t: truth + 0.5 * np.sin(2 * np.pi * 60.0 * t),
        ),
    ],
)
def test_a_broken_line_spoils_its_terminal_for_its_time(
    rig: Rig, kind: str, parameters: dict[str, float | str], during: Callable[..., np.ndarray]
) -> None:
    with _running(rig) as task:
        rig.control.command("fault", kind=kind, target="cDAQ1Mod1/ai0", at_s=0.2, for_s=0.3, **parameters)
        got = _read(task, 700)
    truth = _truth(0, 700)
    expected = truth.copy()
    expected[200:500] = during(truth[200:500], np.arange(300) / RATE)
    assert np.max(np.abs(got[0] - expected)) < 4e-4
    assert np.max(np.abs(got[1] - TestSignals().volts(("x/ai1",), np.arange(700) / RATE + 14e-6)[0])) < 4e-4


def test_an_open_line_drifts_to_the_rail(rig: Rig) -> None:
    with _running(rig) as task:
        rig.control.command("fault", kind="channel_open", target="cDAQ1Mod1/ai0", drift_s=0.1)
        got = _read(task, 1000)[0]
    assert np.all(got[700:] > 9.9)
    assert np.max(np.abs(np.diff(got[:50]))) < 0.3


def test_a_fault_of_now_leaves_the_past_alone(rig: Rig) -> None:
    """Samples taken but not yet read when the line breaks are still good; mending works from then on."""
    with _running(rig) as task:
        task.start()
        _read(task, 10)
        rig.skip(0.2)
        number = rig.control.command("fault", kind="channel_stuck", target="cDAQ1Mod1/ai0", value_v=3.0)[
            "number"
        ]
        rig.skip(0.1)
        rig.control.command("clear_faults", number=number)
        got = _read(task, 400)[0]
    stuck = np.isclose(got, 3.0, atol=1e-3)
    assert 95 <= stuck.sum() <= 105
    assert np.max(np.abs(got - _truth(10, 400))[~stuck]) < 4e-4


def test_buffer_overwritten(rig: Rig) -> None:
    """The reader was deaf: −200279, and with overwriting allowed exactly the stated samples are gone."""
    with _running(rig) as task:
        task.in_stream.input_buf_size = 3000
        task.in_stream.overwrite = OverwriteMode.OVERWRITE_UNREAD_SAMPLES
        _read(task, 100)
        rig.control.command("fault", kind="buffer_overwritten", lost_samples=250)
        with pytest.raises(DaqError) as caught:
            task.read(100)
        assert caught.value.error_code == -200279
        assert task.in_stream.total_samp_per_chan_acquired - 3000 - 100 == pytest.approx(250, abs=3)
        task.in_stream.relative_to = ReadRelativeTo.FIRST_SAMPLE
        task.in_stream.offset = 400
        assert np.max(np.abs(_read(task, 50)[0] - _truth(400, 50))) < 4e-4


def test_read_time_out(rig: Rig) -> None:
    """One read finds 30 samples only; the next goes on where it stopped."""
    with _running(rig) as task:
        first = _read(task, 100)
        rig.control.command("fault", kind="read_timeout", samples=30)
        data = np.full((2, 100), np.nan)
        with pytest.raises(DaqReadError) as caught:
            AnalogMultiChannelReader(task.in_stream).read_many_sample(data, 100, timeout=0.05)
        assert (caught.value.error_code, caught.value.samps_per_chan_read) == (-200284, 30)
        second = data.reshape(-1)[:60].reshape(2, 30)
        got = np.concatenate([first, second, _read(task, 100)], axis=1)
    assert np.max(np.abs(got[0] - _truth(0, 230))) < 4e-4


def test_module_pulled_out(rig: Rig) -> None:
    """−201003 until it is back and the task has been started again; the device list lacks it meanwhile."""
    with _running(rig) as task:
        _read(task, 100)
        rig.control.command("fault", kind="module_removed", target="cDAQ1Mod1")
        for call in (
            lambda: task.read(10),
            task.is_task_done,
            rig.system().devices["cDAQ1Mod1"].self_test_device,
        ):
            with pytest.raises(DaqError) as caught:
                call()
            assert caught.value.error_code == -201003
        assert "cDAQ1Mod1" not in [device.name for device in rig.system().devices]
        rig.control.command("clear_faults")
        assert "cDAQ1Mod1" in [device.name for device in rig.system().devices]
        with pytest.raises(DaqError):
            task.read(10)
        task.stop()
        assert _read(task, 10).shape == (2, 10)


@pytest.mark.parametrize("outage_s", [0.2, 2.0])
def test_chassis_off_the_network_for_a_while(rig: Rig, outage_s: float) -> None:
    """Shorter than the chassis tolerates: samples come late, none is lost."""
    with _running(rig) as task:
        task.start()
        rig.control.command(
            "fault", kind="chassis_offline", target="cDAQ1", at_s=0.1, for_s=outage_s, tolerance_s=3.0
        )
        with pytest.raises(DaqReadError) as caught:
            task.read(200, timeout=0.15)
        n = caught.value.samps_per_chan_read
        assert n == pytest.approx(101, abs=2)
        got = _read(task, 4000)
    assert np.max(np.abs(got[0] - _truth(n, 4000))) < 4e-4


def test_chassis_off_the_network_for_long(rig: Rig) -> None:
    """Longer than it tolerates: the connection is lost and the task with it; later all works again."""
    with _running(rig) as task:
        task.start()
        rig.control.command("fault", kind="chassis_offline", target="cDAQ1", at_s=0.1, for_s=20.0)
        with pytest.raises(DaqError) as caught:
            task.read(5000, timeout=10.0)
        assert caught.value.error_code == -201390
        assert [device.name for device in rig.system().devices] == ["PXI1Slot2", "PXI1Slot3"]
        rig.skip(21.0)
        task.stop()
        assert _read(task, 10).shape == (2, 10)


def test_wrong_device_in_the_slot(rig: Rig) -> None:
    rig.control.command("fault", kind="wrong_device", target="cDAQ1Mod2", product="NI 9234")
    device = rig.system().devices["cDAQ1Mod2"]
    assert device.product_type == "NI 9234"
    with rig.task() as task, pytest.raises(DaqError) as caught:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod2/ai20")
    assert caught.value.error_code == -200170
    rig.control.command("clear_faults")
    assert device.product_type == "NI 9205"


def test_device_reserved_by_another_program(rig: Rig) -> None:
    rig.control.command("fault", kind="reserved", target="cDAQ1Mod1", for_s=5.0)
    with _running(rig) as task:
        with pytest.raises(DaqError) as caught:
            task.start()
        assert caught.value.error_code == -50103
        rig.skip(5.0)
        task.start()


def test_clock_coerced_to_another_rate(rig: Rig) -> None:
    """The rate that reads back is the one that samples are taken at."""
    rig.control.command("fault", kind="clock_rate", target="cDAQ1", rate_hz=1250.0)
    with _running(rig) as task:
        assert task.timing.samp_clk_rate == 1250.0
        got = _read(task, 500)
    assert np.max(np.abs(got[0] - _truth(0, 500, rate=1250.0))) < 4e-4


def test_clock_50_ppm_off(rig: Rig) -> None:
    """Nothing tells: the rate reads back as asked, but after 20 s the samples are 1 ms early."""
    with _running(rig) as task:
        rig.control.command("fault", kind="clock_drift", target="cDAQ1", ppm=50.0)
        assert task.timing.samp_clk_rate == RATE
        got = _read(task, 20_000)[0]
    times = np.arange(20_000) / (RATE * (1 + 50e-6))
    assert np.max(np.abs(got - TestSignals().volts(("x/ai0",), times)[0])) < 4e-4
    assert times[-1] == pytest.approx(19.999 - 1e-3, abs=1e-4)


def test_stalled_device(rig: Rig) -> None:
    """No new samples for a second, then it goes on; the sample count knows nothing of the pause."""
    with _running(rig) as task:
        rig.control.command("fault", kind="stalled", target="cDAQ1Mod1", at_s=0.2, for_s=1.0)
        with pytest.raises(DaqReadError) as caught:
            task.read(500, timeout=0.6)
        n = caught.value.samps_per_chan_read
        assert n == pytest.approx(200, abs=2)
        got = _read(task, 300)[0]
    times = 1.2 + (n - 200 + np.arange(300)) / RATE
    assert np.max(np.abs(got - TestSignals().volts(("x/ai0",), times)[0])) < 4e-4


def test_fault_at_a_sample(rig: Rig) -> None:
    """Faults can be laid out before the acquisition by sample index."""
    rig.control.command("fault", kind="channel_saturated", target="cDAQ1Mod1/ai0", at_sample=123, for_s=0.05)
    assert rig.control.command("faults")["faults"][0]["start_s"] is None
    rig.skip(0.7)
    with _running(rig) as task:
        got = _read(task, 300)[0]
    assert np.flatnonzero(got > 9.9).tolist() == list(range(123, 173))


def test_reply_cut_short(rig: Rig) -> None:
    """Fewer values than stated leave the client's array as it was; a torn message is an RPC error."""
    with _running(rig) as task:
        _read(task, 100)
        rig.control.command("fault", kind="reply_cut_short", part="array")
        data = np.full((2, 100), np.nan)
        assert AnalogMultiChannelReader(task.in_stream).read_many_sample(data, 100) == 100
        assert np.isnan(data).sum() == 100
        rig.control.command("fault", kind="reply_cut_short", part="message")
        with pytest.raises(RpcError):
            task.read(100)
        assert np.max(np.abs(_read(task, 100)[0] - _truth(300, 100))) < 4e-4


def test_replies_out_of_order(rig: Rig) -> None:
    """The second block comes before the first; the device's position gives it away."""
    with _running(rig) as task:
        _read(task, 100)
        rig.control.command("fault", kind="reply_out_of_order")
        positions, blocks = [], []
        for _ in range(3):
            blocks.append(_read(task, 100)[0])
            positions.append(task.in_stream.curr_read_pos)
    for block, first in zip(blocks, (200, 100, 300), strict=True):
        assert np.max(np.abs(block - _truth(first, 100))) < 4e-4
    assert positions == [300, 200, 400]


def test_a_client_that_notices_exchanged_replies_can_seek(rig: Rig) -> None:
    with _running(rig) as task:
        _read(task, 100)
        rig.control.command("fault", kind="reply_out_of_order")
        _read(task, 100)
        assert task.in_stream.curr_read_pos == 300
        task.in_stream.relative_to = ReadRelativeTo.FIRST_SAMPLE
        task.in_stream.offset = 100
        blocks = [_read(task, 100)[0]]
        task.in_stream.relative_to = ReadRelativeTo.CURRENT_READ_POSITION
        task.in_stream.offset = 0
        blocks.append(_read(task, 100)[0])
    assert np.max(np.abs(np.concatenate(blocks) - _truth(100, 200))) < 4e-4


def test_frozen_server_answers_nothing_but_the_control_service(rig: Rig) -> None:
    with _running(rig) as task, ThreadPoolExecutor(1) as pool:
        _read(task, 10)
        number = rig.control.command("fault", kind="server_frozen")["number"]
        waiting = pool.submit(task.read, 10)
        with pytest.raises(TimeoutError):
            waiting.result(timeout=0.2)
        rig.control.command("clear_faults", number=number)
        assert len(waiting.result(timeout=10)[0]) == 10
        rig.control.command("fault", kind="server_frozen", for_s=0.2)
        before = time.monotonic()
        task.read(10)
        assert time.monotonic() - before >= 0.2


def test_killed_server(start_rig: Callable[..., Rig]) -> None:
    """The fault ends the server by itself, also when no client calls."""
    rig = start_rig()
    with _running(rig) as task:
        _read(task, 10)
        rig.control.command("fault", kind="server_killed")
        assert rig.killed.wait(10)


def test_what_is_no_fault(rig: Rig, tmp_path: Path) -> None:
    """Bad descriptions are refused in words, from the command and from a script."""
    for arguments, words in (
        ({"kind": "gremlin"}, "there are: channel_stuck"),
        ({"kind": "stalled"}, "target is missing"),
        ({"kind": "clock_rate", "target": "cDAQ1"}, "rate_hz is missing"),
        ({"kind": "stalled", "target": "cDAQ1", "pace": 3}, "unknown pace"),
        ({"kind": "stalled", "target": "cDAQ1", "at_s": "soon"}, "at_s is a number"),
        ({"kind": "channel_saturated", "target": "cDAQ1Mod1/ai0", "side": "left"}, "high or low"),
    ):
        with pytest.raises(SimControlError, match=words):
            rig.control.command("fault", **arguments)
    with pytest.raises(SimControlError, match="no fault 77"):
        rig.control.command("clear_faults", number=77)
    script = tmp_path / "faults.toml"
    script.write_text('[[fault]]\nkind = "gremlin"\n[[fault]]\nkind = "stalled"\n')
    with pytest.raises(ConfigError) as caught:
        load_faults(script)
    assert len(caught.value.problems) == 2
    script.write_text("[[fault]\n")
    with pytest.raises(ConfigError, match="cannot be read"):
        load_faults(script)


def test_scripts_in_toml_and_json_say_the_same(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(
        '[[fault]]\nkind = "stalled"\ntarget = "cDAQ1"\nat_s = 2\nfor_s = 0.5\n'
        '[[fault]]\nkind = "clock_drift"\ntarget = "cDAQ1"\nppm = -20\n'
    )
    (tmp_path / "b.json").write_text(
        json.dumps(
            [
                {"kind": "stalled", "target": "cDAQ1", "at_s": 2, "for_s": 0.5},
                {"kind": "clock_drift", "target": "cDAQ1", "ppm": -20},
            ]
        )
    )
    assert load_faults(tmp_path / "a.toml") == load_faults(tmp_path / "b.json")


def test_every_kind_can_be_described_with_its_defaults() -> None:
    needed = {"clock_rate": {"rate_hz": 1000}, "wrong_device": {"product": "NI 9234"}}
    for kind in KINDS:
        fault = fault_from({"kind": kind, "target": "cDAQ1"} | needed.get(kind, {}))
        assert set(fault.parameters) == set(KINDS[kind].parameters)


def test_finite_task_survives_faults_of_the_clock(rig: Rig) -> None:
    """A stall delays the end of a finite acquisition by its length."""
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        task.timing.cfg_samp_clk_timing(RATE, sample_mode=AcquisitionType.FINITE, samps_per_chan=100)
        rig.control.command("fault", kind="stalled", target="cDAQ1", at_s=0.05, for_s=0.5)
        task.start()
        task.wait_until_done(timeout=2.0)
        assert rig.control.command("bench")["time_s"] == pytest.approx(0.599, abs=0.01)
