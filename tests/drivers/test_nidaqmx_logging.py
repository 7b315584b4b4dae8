"""NI-DAQmx as the second recorder: what it writes, and reading where logging forbids attributes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from nptdms import TdmsFile

from drivers import Driver, DriverError, open_driver
from sim_hardware.daqmx_server.services.attributes.tasks import READ
from tests.support.driver_reads import lost, read_through, started

Laboratories = Callable[..., Any]


def test_the_native_second_recorder_writes_only_while_asked(laboratory: Laboratories, tmp_path: Path) -> None:
    lab = laboratory()
    driver = open_driver(lab.connection, backup_folder=tmp_path)
    driver.open(lab.plan)
    driver.start()
    driver.read(1.0)
    (path,) = driver.start_backup("FR1-L3-2")
    first = driver.read(1.0)
    second = driver.read(1.0)
    driver.stop_backup()
    driver.read(1.0)
    driver.close()
    with TdmsFile.open(path) as file:
        (group,) = file.groups()
        kept = group.channels()[0][:]
    expected = np.concatenate([first.readings[0], second.readings[0]])
    assert np.allclose(kept, expected, atol=1e-9)


def logging_driver(lab: Any, folder: Path) -> Driver:
    """A driver with the second recorder, over an NI-DAQmx that is strict about attributes while it logs."""
    lab.break_something("strict_logging", "cDAQ1")
    driver = open_driver(lab.connection, backup_folder=folder)
    driver.open(lab.plan)
    driver.start()
    return driver


def test_where_logging_excludes_seeking_a_reply_cut_short_is_a_gap(
    laboratory: Laboratories, tmp_path: Path
) -> None:
    lab = laboratory()
    driver = logging_driver(lab, tmp_path)
    lab.break_something("reply_cut_short")

    blocks, errors = read_through(driver, lab, 8000)

    assert len(errors) == 1
    assert lost(blocks) == lab.plan.read_samples
    driver.close()


def test_a_device_that_cannot_seek_while_it_runs_is_read_on_with_a_gap(
    laboratory: Laboratories, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(READ, "_while_running", frozenset())  # the server refuses with −200557
    lab = laboratory()
    driver = started(lab)
    lab.break_something("reply_cut_short")

    blocks, errors = read_through(driver, lab, 8000)

    assert len(errors) == 1
    assert lost(blocks) == lab.plan.read_samples
    driver.close()


def test_where_logging_excludes_overwriting_a_full_buffer_means_a_new_start(
    laboratory: Laboratories, tmp_path: Path
) -> None:
    lab = laboratory()
    driver = logging_driver(lab, tmp_path)
    for _ in range(30):
        last = driver.read(1.0)
    with lab.bench.changed:
        lab.bench.clock.skip(60.0)
    with pytest.raises(DriverError) as caught:
        driver.read(1.0)
    assert (caught.value.code, caught.value.recoverable) == (-200279, True)

    assert "started again" in driver.recover()
    assert driver.read(1.0).first_sample >= last.first_sample + last.n_samples
    driver.close()
