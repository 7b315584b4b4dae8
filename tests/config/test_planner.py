"""Plans: order, clocks, times and notes."""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from typing import Any

import pytest
import tomli_w

from daq_app.config import PlanNote, TaskPlan, load_rig, parse_rig, plan_tasks

Tables = dict[str, Any]
TODAY = dt.date(2026, 6, 1)


def plan_of(tables: Tables, today: dt.date = TODAY) -> TaskPlan:
    return plan_tasks(parse_rig(tomli_w.dumps(tables)), today=today)


def notes_about(plan: TaskPlan, words: str) -> list[PlanNote]:
    return [note for note in plan.notes if words in note.text]


def test_every_channel_is_planned_once_with_its_rig_row(fr1_pxie: Tables) -> None:
    plan = plan_of(fr1_pxie)
    rows = sorted(p.rig_index for task in plan.tasks for p in task.channels)
    assert rows == list(range(41))
    for task in plan.tasks:
        for planned in task.channels:
            assert plan.channel_ids[planned.rig_index] == planned.channel.id


def test_a_module_is_in_one_task_and_its_channels_are_neighbours(fr1: Tables) -> None:
    fr1["channels"].reverse()
    (task,) = plan_of(fr1).tasks
    devices = [p.channel.physical_channel.split("/")[0] for p in task.channels]
    assert devices == sorted(devices)


def test_pxie_tasks_share_the_clock_of_the_lvdt_modules(fr1_pxie: Tables) -> None:
    master, slave = plan_of(fr1_pxie).tasks
    assert (master.role, slave.role) == ("master", "slave")
    assert {p.channel.family for p in master.channels} == {"lvdt"}
    assert master.clock_source == master.start_trigger_source == ""
    assert slave.clock_source == "/PXI1Slot2/ai/SampleClock"
    assert slave.start_trigger_source == "/PXI1Slot2/ai/StartTrigger"
    assert slave.rate_hz == master.rate_hz


def test_time_offsets_are_skew_less_delay(fr1_iepe: Tables) -> None:
    plan = plan_of(fr1_iepe)
    (task,) = plan.tasks
    times = {p.channel.id: p.time_offset_s for p in task.channels}
    assert times["LV-A01"] == 0.0
    assert times["LV-A12"] == pytest.approx(11 * 14e-6)
    assert times["AC-1"] == pytest.approx(-(40 + 5 / 512) / plan.rate_hz, abs=1e-5)


def test_blocks_and_buffers_follow_the_coerced_rate(fr1_iepe: Tables) -> None:
    plan = plan_of(fr1_iepe)
    assert plan.read_samples == 427
    assert plan.tasks[0].buffer_samples == 85334


def test_says_that_the_rate_is_coerced_and_by_what(fr1_iepe: Tables, fr1: Tables) -> None:
    (note,) = notes_about(plan_of(fr1_iepe), "4266.67")
    assert note.severity == "warning"
    assert "NI 9234" in note.text
    assert not notes_about(plan_of(fr1), "becomes")


def test_warns_of_a_crowded_multiplexer(fr1: Tables) -> None:
    """32 RSE channels on one module leave 3.8 µs to settle."""
    for index, channel in enumerate(fr1["channels"][:32]):
        channel["physical_channel"] = f"cDAQ1Mod1/ai{index}"
        channel["terminal_config"] = "RSE"
    fr1["channels"][37:] = [
        c | {"physical_channel": f"cDAQ1Mod2/ai{k}"} for k, c in enumerate(fr1["channels"][37:])
    ]
    notes = notes_about(plan_of(fr1), "settle")
    assert {note.where for note in notes} >= {"cDAQ1Mod1", "cDAQ1Mod2"}  # one padding for the whole task
    assert {note.severity for note in notes} == {"warning"}
    assert all("3.8 µs" in note.text for note in notes)


def test_warns_of_ghosting_sources(fr1: Tables) -> None:
    fr1["channels"][24]["source_impedance_ohm"] = 5000.0
    (note,) = notes_about(plan_of(fr1), "ghosting")
    assert (note.severity, note.where) == ("warning", "WP-1")


def test_certificates_are_judged_by_the_day(fr1: Tables) -> None:
    fr1["channels"][3]["certificate"]["due"] = dt.date(2026, 5, 31)
    fr1["channels"][5]["certificate"]["due"] = dt.date(2026, 6, 20)
    plan = plan_of(fr1)
    (overdue,) = notes_about(plan, "overdue")
    assert (overdue.severity, overdue.where) == ("warning", "LV-A04")
    (soon,) = notes_about(plan, "due soon")
    assert soon.where == "LV-A06"
    assert not notes_about(plan_of(fr1, dt.date(2026, 5, 1)), "overdue")


def test_notes_the_delay_the_coupling_and_the_timing_engines(fr1_iepe: Tables) -> None:
    plan = plan_of(fr1_iepe)
    assert len(notes_about(plan, "lags by 9.38 ms")) == 2
    assert notes_about(plan, "AC-coupled")
    assert notes_about(plan, "1 of 3 AI timing engines")


def test_warns_when_a_planned_level_would_clip(fr1: Tables) -> None:
    fr1["channel_defaults"]["lvdt"]["range_si"] = [-0.005, 0.050]
    (note,) = notes_about(plan_of(fr1), "clip")
    assert note.severity == "warning"
    assert "24 channels" in note.where
    assert "0.35" in note.text  # asin(0.050 / b) / α = 0.358


def test_network_synchronised_chassis_share_one_task(fr1: Tables) -> None:
    modules = fr1["hardware"]["chassis"][0]["modules"]
    fr1["hardware"]["chassis"] = [
        {"name": "cDAQ1", "product": "cDAQ-9189", "modules": modules[:2]},
        {"name": "cDAQ2", "product": "cDAQ-9185", "modules": modules[2:]},
    ]
    for channel in fr1["channels"]:
        for slot in (3, 4):
            channel["physical_channel"] = channel["physical_channel"].replace(
                f"cDAQ1Mod{slot}", f"cDAQ2Mod{slot}"
            )
    assert len(plan_of(fr1).tasks) == 1


def test_devices_may_have_names_of_their_own(fr1: Tables) -> None:
    fr1["hardware"]["chassis"][0]["modules"][3]["name"] = "Accelerometers"
    for channel in fr1["channels"]:
        channel["physical_channel"] = channel["physical_channel"].replace("cDAQ1Mod4", "Accelerometers")
    assert "Accelerometers/ai0" in {p.channel.physical_channel for p in plan_of(fr1).tasks[0].channels}


def test_a_plan_is_the_same_each_time(configs: Path) -> None:
    rig = load_rig(configs / "fr1.toml")
    assert plan_tasks(rig, today=TODAY) == plan_tasks(rig, today=TODAY)
