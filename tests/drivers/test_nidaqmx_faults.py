"""What the nidaqmx driver does when hardware, server or network fail: kept samples, clear words, no lies."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import grpc
import numpy as np
import pytest
from nidaqmx.errors import RpcError

from daq_app.config import PlannedChannel
from daq_app.config.planning.plan import PlannedTask, TaskPlan
from drivers import Driver, DriverError, open_driver
from drivers.ni.error_advice import BY_CODE, BY_GRPC_STATUS, advice_for, translate
from tests.support.driver_reads import assert_true_samples, lost, read_through, started

Laboratories = Callable[..., Any]


def test_a_device_that_is_missing_is_named_with_those_that_are_there(laboratory: Laboratories) -> None:
    lab = laboratory()
    lab.break_something("module_removed", "cDAQ1Mod3")
    driver = open_driver(lab.connection)
    with pytest.raises(DriverError) as caught:
        driver.open(lab.plan)
        driver.start()
        driver.read(1.0)
    assert "cDAQ1Mod3" in str(caught.value)
    assert caught.value.code in (-200220, -201003, -200324)
    driver.close()
    assert lab.open_tasks == 0


def test_a_device_that_another_program_holds(laboratory: Laboratories) -> None:
    lab = laboratory()
    lab.break_something("reserved", "cDAQ1Mod2")
    driver = open_driver(lab.connection)
    with pytest.raises(DriverError) as caught:
        driver.open(lab.plan)
    assert caught.value.code == -50103
    assert "reserved" in str(caught.value)
    assert "Close the other program" in caught.value.advice
    assert lab.open_tasks == 0, "a failed open must leave nothing reserved"
    lab.mend()
    driver.open(lab.plan)  # the same driver can try again
    driver.close()


def test_two_drivers_cannot_share_the_hardware_and_do_not_attach_to_each_other(
    laboratory: Laboratories,
) -> None:
    lab = laboratory()
    first = started(lab)
    second = open_driver(lab.connection)
    with pytest.raises(DriverError) as caught:
        second.open(lab.plan)
    assert caught.value.code == -50103
    assert first.read(1.0).first_sample == 0
    first.close()
    second.close()


def test_overwritten_samples_are_a_gap_of_the_right_length(laboratory: Laboratories) -> None:
    lab = laboratory()
    driver = started(lab)
    blocks, _ = read_through(driver, lab, 2000)
    lab.let_time_pass(lab.rig.acquisition.buffer_s + 3.0)
    more, errors = read_through(driver, lab, 2000 + 4000 * 30)
    assert [error.code for error in errors] == [-200279]
    assert errors[0].recoverable
    # 3 s were overwritten; a margin of the buffer is given up so that the rest can be fetched in peace.
    assert 3 * 4000 <= lost(blocks + more) <= 3 * 4000 + lab.plan.tasks[0].buffer_samples // 20 + 1000
    driver.close()


def test_a_computer_too_slow_for_the_margin_gives_up_more_and_reads_on(laboratory: Laboratories) -> None:
    """Were the margin always the same, a recovery that takes longer than it would be followed by another."""
    lab = laboratory()
    driver = started(lab)
    blocks, _ = read_through(driver, lab, 2000)
    lab.let_time_pass(lab.rig.acquisition.buffer_s + 3.0)
    for _ in range(4):
        assert "overwritten" in driver.recover()
        lab.let_time_pass(2.5)
        try:
            blocks.append(driver.read(1.0))
            break
        except DriverError as error:
            assert error.code == -200279
    after = blocks[-1]
    assert lost(blocks) <= (3.0 + 4 * 2.5 + 0.5 * lab.rig.acquisition.buffer_s) * 4000
    more, errors = read_through(driver, lab, after.first_sample + 18 * 4000)
    assert not errors and more[0].first_sample == after.first_sample + after.n_samples
    # Once reading goes on, a loss costs no more than the small margin again.
    lab.let_time_pass(lab.rig.acquisition.buffer_s + 3.0)
    driver.recover()
    end = more[-1].first_sample + more[-1].n_samples
    assert 3.0 * 4000 <= driver.read(1.0).first_sample - end <= (3.0 + 2.0) * 4000
    driver.close()


def test_samples_overwritten_while_the_way_was_cut_are_told_as_such(laboratory: Laboratories) -> None:
    """The first error after a sleep is often a call that took too long; the loss has another cause."""
    lab = laboratory()
    driver = started(lab)
    block = driver.read(1.0)
    assert driver.recover() == ""
    after = driver.read(1.0)
    assert after.first_sample == block.first_sample + block.n_samples
    lab.let_time_pass(lab.rig.acquisition.buffer_s + 3.0)
    assert "20 s: older samples had been overwritten" in driver.recover()
    assert lost([after, driver.read(1.0)]) >= after.first_sample + 3 * 4000
    driver.close()


def test_a_long_deafness_within_the_buffer_costs_nothing_and_is_caught_up_in_large_reads(
    laboratory: Laboratories,
) -> None:
    lab = laboratory()
    driver = started(lab)
    read_through(driver, lab, 2000)
    lab.let_time_pass(15.0)
    blocks, errors = read_through(driver, lab, 2000 + 15 * 4000)
    assert not errors
    assert max(block.n_samples for block in blocks) > lab.plan.read_samples
    assert blocks[-1].backlog_samples < 2 * lab.plan.read_samples * 10
    driver.close()


@pytest.mark.parametrize("part", ["array", "message"])
def test_a_reply_cut_short_is_read_again_and_never_passed_on(laboratory: Laboratories, part: str) -> None:
    lab = laboratory()
    driver = started(lab)
    before, _ = read_through(driver, lab, 2000)
    lab.break_something("reply_cut_short", part=part)
    after, errors = read_through(driver, lab, 6000)
    assert len(errors) == 1
    assert errors[0].recoverable
    assert lost(before + after) == 0
    driver.close()


def test_replies_out_of_order_are_noticed_and_read_again(laboratory: Laboratories) -> None:
    lab = laboratory()
    driver = started(lab)
    before, _ = read_through(driver, lab, 2000)
    lab.break_something("reply_out_of_order")
    after, errors = read_through(driver, lab, 8000)
    assert errors
    assert lost(before + after) == 0
    driver.close()


def test_a_read_that_times_out_hands_over_what_had_come(laboratory: Laboratories) -> None:
    lab = laboratory()
    driver = started(lab)
    driver.read(1.0)
    lab.break_something("read_timeout", samples=123.0)
    with pytest.raises(DriverError) as caught:
        driver.read(1.0)
    assert caught.value.code == -200284
    assert caught.value.retryable
    assert caught.value.partial is not None
    assert caught.value.partial.n_samples == 123
    assert_true_samples(lab, caught.value.partial)
    assert_true_samples(lab, driver.read(1.0))
    driver.close()


def test_a_short_read_of_one_of_two_tasks_keeps_the_rows_together(laboratory: Laboratories) -> None:
    lab = laboratory("fr1-pxie")
    driver = started(lab)
    driver.read(1.0)
    slave = next(task.name for task in lab.plan.tasks if task.role == "slave")
    name = next(name for name in lab.bench.tasks if name.endswith(slave))
    lab.break_something("read_timeout", name, samples=50.0)
    with pytest.raises(DriverError) as caught:
        driver.read(1.0)
    assert caught.value.retryable
    assert caught.value.partial is not None and caught.value.partial.n_samples == 50
    block = driver.read(1.0)
    assert block.first_sample == lab.plan.read_samples + 50
    row = next(item.rig_index for task in lab.plan.tasks if task.role == "slave" for item in task.channels)
    expected = 0.01 * (row + 1) + 0.01 * (block.first_sample + np.arange(block.n_samples)) / block_rate(lab)
    assert np.abs(block.readings[row] - expected).max() < 1e-3
    driver.close()


def block_rate(lab: Any) -> float:
    return float(lab.plan.rate_hz)


def test_a_server_that_is_gone_is_told_and_can_be_tried_again(laboratory: Laboratories) -> None:
    lab = laboratory()
    driver = started(lab)
    driver.read(1.0)
    lab.stop()
    with pytest.raises(DriverError) as caught:
        driver.read(1.0)
    assert caught.value.recoverable
    assert "cannot be reached" in str(caught.value)
    with pytest.raises(DriverError) as again:
        driver.recover()
    assert again.value.recoverable
    driver.close()  # must not hang


@pytest.mark.parametrize("rig", ["fr1", "fr1-pxie"])
def test_a_server_that_forgot_the_tasks_gets_them_again_and_the_gap_has_its_length(
    laboratory: Laboratories, rig: str
) -> None:
    lab = laboratory(rig)
    driver = started(lab)
    for _ in range(30):
        last = driver.read(1.0)
    with lab.bench.changed:
        lab.bench.reset()
    with pytest.raises(DriverError) as caught:
        driver.read(1.0)
    assert caught.value.recoverable
    assert "started again" in caught.value.advice
    assert "length of the gap" in driver.recover()
    after = driver.read(1.0)
    assert after.first_sample >= last.first_sample + last.n_samples
    assert driver.read(1.0).first_sample == after.first_sample + after.n_samples
    driver.close()
    assert lab.open_tasks == 0


def test_after_an_onboard_overflow_the_tasks_are_started_again_and_the_gap_is_told(
    laboratory: Laboratories,
) -> None:
    lab = laboratory()
    driver = started(lab)
    for _ in range(30):
        last = driver.read(1.0)
    lab.break_something("onboard_overflow", "cDAQ1", for_s=0.05)
    with pytest.raises(DriverError, match="its own memory ran over") as caught:
        driver.read(1.0)
    assert (caught.value.code, caught.value.recoverable) == (-200361, True)
    with lab.bench.changed:
        lab.bench.clock.skip(0.1)

    assert "length of the gap" in driver.recover()
    after = driver.read(1.0)
    assert after.first_sample >= last.first_sample + last.n_samples
    assert driver.read(1.0).first_sample == after.first_sample + after.n_samples
    driver.close()


@pytest.mark.parametrize(("fault", "code"), [("network_unreserved", -201388), ("network_reserved", -201420)])
def test_a_chassis_that_is_not_reserved_for_us_is_told_with_the_command_that_reserves_it(
    laboratory: Laboratories, fault: str, code: int
) -> None:
    lab = laboratory()
    lab.break_something(fault, "cDAQ1")
    driver = open_driver(lab.connection)
    with pytest.raises(DriverError) as caught:
        driver.open(lab.plan)
    assert caught.value.code == code
    assert "daq-app rig reserve" in caught.value.advice
    driver.close()


def test_a_device_that_comes_back_at_another_rate_is_no_continuation(laboratory: Laboratories) -> None:
    lab = laboratory()
    driver = started(lab)
    driver.read(1.0)
    with lab.bench.changed:
        lab.bench.reset()
    lab.break_something("clock_rate", "cDAQ1", rate_hz=5000.0)
    with pytest.raises(DriverError, match="came back with 5000 Hz") as caught:
        driver.recover()
    assert not caught.value.recoverable
    driver.close()


def test_without_ni_daqmx_the_local_connection_says_what_to_install(laboratory: Laboratories) -> None:
    lab = laboratory()
    driver = open_driver("local")
    with pytest.raises(DriverError) as caught:
        driver.open(lab.plan)
    assert "not installed" in str(caught.value)
    assert "--connection simulated" in caught.value.advice


@pytest.mark.parametrize(
    "connection", ["", "usb", "grpc://", "grpc://host", "grpc://host:99999", "grpc://a b:1", "http://x:1"]
)
def test_a_connection_that_is_none(connection: str) -> None:
    with pytest.raises(DriverError, match="no way to the hardware"):
        open_driver(connection)


def test_plain_text_beyond_this_machine_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DAQ_APP_ALLOW_PLAIN_GRPC", raising=False)
    with pytest.raises(DriverError, match="without encryption"):
        open_driver("grpc://192.0.2.7:31763")
    monkeypatch.setenv("DAQ_APP_ALLOW_PLAIN_GRPC", "1")
    open_driver("grpc://192.0.2.7:31763").close()


def test_replies_above_four_megabytes_arrive(laboratory: Laboratories) -> None:
    lab = laboratory()
    big = TaskPlan(lab.plan.tasks, lab.plan.rate_hz, lab.plan.channel_ids, read_samples=16_000)
    driver = open_driver(lab.connection)
    driver.open(big)
    driver.start()
    block = driver.read(10.0)
    assert block.readings.nbytes > 4 * 2**20
    assert_true_samples(lab, block)
    driver.close()


def test_tasks_that_a_killed_session_left_on_the_server_are_cleared_by_the_next(
    laboratory: Laboratories, tmp_path: Path
) -> None:
    lab = laboratory()
    ledger = tmp_path / "open-tasks.json"
    killed = open_driver(lab.connection, ledger=ledger)
    killed.open(lab.plan)
    killed.start()
    assert ledger.exists()
    stranger = open_driver(lab.connection, ledger=tmp_path / "of somebody else.json")
    with pytest.raises(DriverError, match="reserved"):
        stranger.open(lab.plan)
    following = started_with(lab, ledger)
    assert following.read(1.0).first_sample == 0
    following.close()
    assert not ledger.exists()
    for rubbish in ("", "{}", "[1]", '{"target": 1, "tasks": 2}'):
        ledger.write_text(rubbish)
        started_with(lab, ledger).close()


def started_with(lab: Any, ledger: Path) -> Driver:
    driver = open_driver(lab.connection, ledger=ledger)
    driver.open(lab.plan)
    driver.start()
    return driver


def test_a_channel_that_the_module_lacks_is_told_as_such(laboratory: Laboratories) -> None:
    lab = laboratory()
    first = lab.plan.tasks[0].channels[0]
    wrong = first.channel.model_copy(update={"physical_channel": "cDAQ1Mod1/ai99"})
    channels = (PlannedChannel(wrong, 0, 0.0, 0.0), *lab.plan.tasks[0].channels[1:])
    task = PlannedTask("broken", channels, 4000.0, 4000.0, "master", buffer_samples=80_000)
    driver = open_driver(lab.connection)
    with pytest.raises(DriverError) as caught:
        driver.open(TaskPlan((task,), 4000.0, lab.plan.channel_ids, 400))
    assert caught.value.code == -200170
    assert "does not exist" in str(caught.value)
    assert lab.open_tasks == 0
    driver.close()


def test_every_error_the_operator_will_meet_has_its_sentence() -> None:
    listed = [-200279, -200284, -200220, -50103, -200170, -200431, -200077, -201003]
    for code in listed:
        assert code in BY_CODE
    for advice in [*BY_CODE.values(), *BY_GRPC_STATUS.values(), advice_for(-88900), advice_for(-1)]:
        assert advice.what[0].isupper() and not advice.what.endswith(".")
        assert advice.do[0].isupper() and not advice.do.endswith(".")
    assert advice_for(-88705).recoverable
    assert "UNAVAILABLE" in BY_GRPC_STATUS


@pytest.mark.parametrize("status", list(grpc.StatusCode), ids=lambda status: status.name)
def test_no_word_of_the_transport_reaches_the_operator(status: grpc.StatusCode) -> None:
    said = str(translate(RpcError(status, "Deadline Exceeded"), doing="reading"))
    assert "while reading" in said and status.name not in said and "Deadline Exceeded (" not in said
