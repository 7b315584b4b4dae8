"""Rules of IEPE and native LVDT inputs, and how several faults of one file are listed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from daq_app.config import Problem

Tables = dict[str, Any]
Ask = Callable[[Tables], list[Problem]]


def channel(tables: Tables, channel_id: str) -> Tables:
    return next(c for c in tables["channels"] if c["id"] == channel_id)


@pytest.mark.parametrize(
    ("spoil", "key", "words"),
    [
        (lambda d: d["excitation"].update(value=0.004), "excitation", "0.002 A only"),
        (lambda d: d.update(terminal_config="DIFF"), "terminal_config", "cannot be DIFF"),
        (lambda d: d.update(input_range_v=[-10.0, 10.0]), "input_range_v", "beyond NI 9234"),
        (lambda d: d.update(sensitivity=600.0), "input_range_v", "beyond -5 to 5 V"),
    ],
)
def test_iepe_rules(
    fr1_iepe: Tables, problems: Ask, spoil: Callable[[Tables], object], key: str, words: str
) -> None:
    spoil(fr1_iepe["channel_defaults"]["accelerometer"])
    assert any(p.key.endswith(f".{key}") and words in p.wrong for p in problems(fr1_iepe))


@pytest.mark.parametrize(
    ("spoil", "key", "words"),
    [
        (lambda d: d["excitation"].update(frequency_hz=0.0), "excitation", "cannot excite an LVDT"),
        (lambda d: d.update(sensitivity_unit="V/mm"), "sensitivity_unit", "native LVDT module"),
        (lambda d: d.update(measurement="voltage"), "measurement", "cannot measure a voltage"),
        (lambda d: d.update(sensitivity=60.0), "input_range_v", "beyond -1 to 1 V"),
    ],
)
def test_native_lvdt_rules(
    fr1_pxie: Tables, problems: Ask, spoil: Callable[[Tables], object], key: str, words: str
) -> None:
    spoil(fr1_pxie["channel_defaults"]["lvdt"])
    assert any(p.key.endswith(f".{key}") and words in p.wrong for p in problems(fr1_pxie))


def test_pxi_slot_1_is_the_controllers(fr1_pxie: Tables, problems: Ask) -> None:
    fr1_pxie["hardware"]["chassis"][0]["modules"][0]["slot"] = 1
    assert any("controller" in p.right for p in problems(fr1_pxie))


def test_all_faults_are_listed_at_once(fr1: Tables, problems: Ask) -> None:
    """A key that cannot be read does not hide what is wrong elsewhere, hardware included."""
    channel(fr1, "LV-A01")["polarity"] = 0
    channel(fr1, "WP-1").pop("anchor_m")
    channel(fr1, "AC-1")["physical_channel"] = "cDAQ1Mod4/ai99"
    fr1["hardware"]["chassis"][0]["modules"][0]["product"] = "NI 9999"
    fr1["specimen"]["p_rad_s"] = 3.0
    fr1["hardware"]["connection"] = "usb"
    keys = {p.key for p in problems(fr1)}
    assert keys == {
        "channels[0] (LV-A01).polarity",
        "channels[24] (WP-1).anchor_m",
        "channels[29] (AC-1).physical_channel",
        "hardware.chassis[0] (cDAQ1).modules[0].product",
        "specimen.p_rad_s",
        "hardware.connection",
    }


def test_a_fault_of_the_defaults_is_reported_once(fr1: Tables, problems: Ask) -> None:
    defaults = fr1["channel_defaults"]["lvdt"]
    defaults["sensitivty"] = defaults.pop("sensitivity")
    (problem,) = problems(fr1)
    assert problem.key == "channel_defaults.lvdt (LV-A01, LV-A02 … LV-B12: 24 channels).sensitivty"
    assert problem.right == "Did you mean `sensitivity`?"


def test_a_fault_that_some_channels_share_is_reported_once(fr1: Tables, problems: Ask) -> None:
    for name in ("WP-1", "WP-2"):
        channel(fr1, name)["sensitivity_unit"] = "V/g"
    (problem,) = problems(fr1)
    assert problem.key == "channels (WP-1, WP-2: 2 channels).sensitivity_unit"


def test_a_channel_overrides_its_familys_defaults(fr1: Tables, problems: Ask) -> None:
    channel(fr1, "LV-A01").update(
        sensitivity=0.1, offset=0.0, excitation={"value": 12.0}, range_si=[-0.01, 0.08]
    )
    assert problems(fr1) == []
