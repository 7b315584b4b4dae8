"""Sample clocks that start again, pause, or start at a time of day; samples that only a file sees."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import nidaqmx
import numpy as np
import pytest
from nidaqmx.constants import AcquisitionType, Level, LoggingMode, LoggingOperation, TriggerType
from nidaqmx.errors import DaqError
from nptdms import TdmsFile

from tests.support.server_support import Rig, TestSignals, continuous

RATE = 1000.0
PFI = "/cDAQ1/PFI0"


def _voltage(rig: Rig, samples: int = 100, mode: AcquisitionType = AcquisitionType.FINITE) -> nidaqmx.Task:
    task = rig.task()
    task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
    task.timing.cfg_samp_clk_timing(RATE, sample_mode=mode, samps_per_chan=samples)
    return task


def _wall(first_s: float, n: int) -> np.ndarray:
    return TestSignals().volts(("x/ai0",), first_s + np.arange(n) / RATE)[0]


def _edge(rig: Rig, rising: bool = True) -> float:
    """An edge now; its instant."""
    with rig.bench.changed:
        now = rig.bench.clock.now()
        rig.bench.digital_edge(PFI, now, rising)
    return now


def _is_near(got: object, first_s: float, n: int) -> bool:
    return bool(np.max(np.abs(np.array(got) - _wall(first_s, n))) < 3e-4)


def test_a_retriggered_task_takes_its_samples_anew_at_each_trigger(rig: Rig) -> None:
    with _voltage(rig) as task:
        task.triggers.start_trigger.cfg_dig_edge_start_trig(PFI)
        task.triggers.start_trigger.retriggerable = True
        task.start()
        for pause_s in (0.3, 0.71):
            rig.skip(pause_s)
            trigger_s = _edge(rig)
            assert _is_near(task.read(100), trigger_s, 100)
        assert not task.is_task_done()


def test_a_trigger_during_the_samples_of_the_one_before_is_not_heard(rig: Rig) -> None:
    with _voltage(rig) as task:
        task.triggers.start_trigger.cfg_dig_edge_start_trig(PFI)
        task.triggers.start_trigger.retriggerable = True
        task.start()
        _edge(rig)
        rig.skip(0.05)
        _edge(rig)
        rig.skip(0.5)
        task.read(100)
        with pytest.raises(DaqError) as error:
            task.read(100, timeout=0.5)
    assert error.value.error_code == -200284


def test_an_analogue_trigger_fires_once_a_period(rig: Rig) -> None:
    """The signal of 5 Hz crosses its level each 0.2 s; ten samples are taken each time."""
    with _voltage(rig, 10) as task:
        trigger = task.triggers.start_trigger
        trigger.cfg_anlg_edge_start_trig("cDAQ1Mod1/ai0", trigger_level=0.5)
        trigger.retriggerable = True
        bursts = np.reshape(task.read(30), (3, 10))
    assert np.all(bursts[:, 0] >= 0.5 - 1e-3)
    assert np.max(np.abs(bursts - bursts[0])) < 1e-3


def test_retriggering_an_endless_task_is_refused(rig: Rig) -> None:
    with _voltage(rig, mode=AcquisitionType.CONTINUOUS) as task:
        task.triggers.start_trigger.cfg_dig_edge_start_trig(PFI)
        task.triggers.start_trigger.retriggerable = True
        with pytest.raises(DaqError) as error:
            task.start()
    assert error.value.error_code == -201320


def _pause_while(task: nidaqmx.Task, level: Level) -> None:
    pause = task.triggers.pause_trigger
    pause.trig_type = TriggerType.DIGITAL_LEVEL
    pause.dig_lvl_src = PFI
    pause.dig_lvl_when = level


def test_no_sample_is_taken_while_the_pause_trigger_has_its_level(rig: Rig) -> None:
    with _voltage(rig, 10_000, AcquisitionType.CONTINUOUS) as task:
        _pause_while(task, Level.HIGH)
        task.start()
        rig.skip(0.0995)
        _edge(rig, rising=True)
        rig.skip(0.25)
        assert task.in_stream.total_samp_per_chan_acquired == 100
        ended_s = _edge(rig, rising=False)
        after = task.read(200)[100:]
    assert _is_near(after, ended_s + 0.5e-3, 100)


def test_a_task_that_starts_paused_takes_its_first_sample_when_the_level_has_gone(rig: Rig) -> None:
    with _voltage(rig) as task:
        _pause_while(task, Level.LOW)
        task.start()
        rig.skip(0.4)
        assert task.in_stream.total_samp_per_chan_acquired == 0
        begun_s = _edge(rig)
        assert _is_near(task.read(100), begun_s, 100)


def test_a_task_starts_at_a_time_of_day(rig: Rig) -> None:
    with _voltage(rig) as task:
        with rig.bench.changed:
            when = rig.bench.utc(rig.bench.clock.now() + 1.25)
        task.triggers.start_trigger.cfg_time_start_trig(when)
        task.timing.first_samp_timestamp_enable = True
        task.start()
        assert _is_near(task.read(100), 1.25, 100)
        stamp = task.timing.first_samp_timestamp_val
    assert abs((stamp.replace(tzinfo=dt.UTC) - when).total_seconds()) < 1e-6


def _log(task: nidaqmx.Task, file: Path, mode: LoggingMode) -> None:
    task.in_stream.configure_logging(file, mode, "g", LoggingOperation.CREATE_OR_REPLACE)


def _logged(file: Path) -> np.ndarray:
    with TdmsFile.open(file) as tdms:
        return np.asarray(tdms["g"].channels()[0][:])


def _log_in_files_of_100(rig: Rig, folder: Path, *, read: int) -> None:
    """Five reads of so many samples of a continuous task that logs and reads."""
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        continuous(task, RATE)
        _log(task, folder / "a.tdms", LoggingMode.LOG_AND_READ)
        task.in_stream.logging_samps_per_file = 100
        for _ in range(5):
            task.read(read)


def test_in_the_mode_log_the_samples_go_to_the_file_alone(rig: Rig, tmp_path: Path) -> None:
    with _voltage(rig, 500) as task:
        _log(task, tmp_path / "a.tdms", LoggingMode.LOG)
        task.start()
        with pytest.raises(DaqError) as error:
            task.read(10)
        task.wait_until_done()
        task.stop()
    assert error.value.error_code == -201301
    assert _is_near(_logged(tmp_path / "a.tdms"), 0.0, 500)


def test_a_file_of_so_many_samples_is_followed_by_another(rig: Rig, tmp_path: Path) -> None:
    _log_in_files_of_100(rig, tmp_path, read=50)
    names = ["a.tdms", "a_0001.tdms", "a_0002.tdms"]
    files = [_logged(tmp_path / name) for name in names]
    assert sorted(path.name for path in tmp_path.glob("*.tdms")) == names
    assert [len(values) for values in files] == [100, 100, 50]
    assert _is_near(np.concatenate(files), 0.0, 250)


def test_a_file_tells_when_its_first_sample_was_taken(rig: Rig, tmp_path: Path) -> None:
    """Whatever the reads: each file's offset is the one of the sample that it begins with."""
    _log_in_files_of_100(rig, tmp_path, read=30)
    told = []
    for name in ("a.tdms", "a_0001.tdms"):
        with TdmsFile.open(tmp_path / name) as tdms:
            told.append(tdms["g"].channels()[0].properties)
    assert [one["wf_start_offset"] for one in told] == pytest.approx([0.0, 100 / RATE])
    assert [one["wf_increment"] for one in told] == [1.0 / RATE] * 2
    assert told[0]["wf_start_time"] == told[1]["wf_start_time"]


def test_a_second_task_appends_to_a_file_in_a_group_of_its_own(rig: Rig, tmp_path: Path) -> None:
    for _ in range(2):
        with _voltage(rig) as task:
            task.in_stream.configure_logging(
                tmp_path / "a.tdms", LoggingMode.LOG_AND_READ, "g", LoggingOperation.OPEN_OR_CREATE
            )
            task.read(100)
    with TdmsFile.open(tmp_path / "a.tdms") as tdms:
        assert {group.name: len(group.channels()[0]) for group in tdms.groups()} == {"g": 100, "g #1": 100}


def test_what_is_logged_after_a_pause_has_a_group_and_an_offset_of_its_own(rig: Rig, tmp_path: Path) -> None:
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        continuous(task, RATE)
        _log(task, tmp_path / "a.tdms", LoggingMode.LOG_AND_READ)
        for paused in (False, True, False, False):
            task.in_stream.logging_pause = paused
            task.read(50)
    with TdmsFile.open(tmp_path / "a.tdms") as tdms:
        (first,), (second,) = (tdms[name].channels() for name in ("g", "g #1"))
        assert (len(first), len(second)) == (50, 100)
        assert second.properties["wf_start_offset"] == pytest.approx(100 / RATE)
        assert _is_near(np.asarray(second[:]), 100 / RATE, 100)


def test_a_task_without_a_clock_cannot_log(rig: Rig, tmp_path: Path) -> None:
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        _log(task, tmp_path / "a.tdms", LoggingMode.LOG_AND_READ)
        with pytest.raises(DaqError) as error:
            task.start()
    assert error.value.error_code == -201299
