"""Each way to spoil a rig file gives a problem that names the key and what would be right."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from typing import Any

import pytest

from daq_app.config import Problem

Tables = dict[str, Any]
Ask = Callable[[Tables], list[Problem]]


def lvdt(tables: Tables) -> Tables:
    return tables["channel_defaults"]["lvdt"]  # type: ignore[no-any-return]


def channel(tables: Tables, channel_id: str) -> Tables:
    return next(c for c in tables["channels"] if c["id"] == channel_id)


def modules(tables: Tables) -> list[Tables]:
    return tables["hardware"]["chassis"][0]["modules"]  # type: ignore[no-any-return]


def _move_to_slow(tables: Tables, product: str) -> None:
    modules(tables)[3]["product"] = product


def _second_chassis(tables: Tables, product: str) -> None:
    tables["hardware"]["chassis"].append(
        {"name": "Other1", "product": product, "modules": [{"slot": 2, "product": "NI 9205"}]}
    )
    channel(tables, "TL-2Y")["physical_channel"] = "Other1Mod2/ai0"


def _drop(tables: Tables, channel_id: str) -> None:
    tables["channels"].remove(channel(tables, channel_id))


Fault = tuple[str, Callable[[Tables], object], str, str, str]
FAULTS: list[Fault] = [
    # name, how to spoil, key path, words of what is wrong, words of what is right
    (
        "unknown key in a channel",
        lambda t: channel(t, "LV-A04").update(polarty=1),
        "channels[3] (LV-A04).polarty",
        "no key",
        "Did you mean `polarity`",
    ),
    (
        "unknown table",
        lambda t: t.update(acquisitoin={}),
        "acquisitoin",
        "no key",
        "Did you mean `acquisition`",
    ),
    (
        "unknown family of defaults",
        lambda t: t["channel_defaults"].update(lvtd={}),
        "channel_defaults.lvtd",
        "no sensor family",
        "Did you mean `lvdt`",
    ),
    (
        "two sensors on one terminal",
        lambda t: channel(t, "LV-A04").update(physical_channel="cDAQ1Mod1/ai2"),
        "channels[3] (LV-A04).physical_channel",
        "already used by channels[2] (LV-A03)",
        "terminals of its own",
    ),
    (
        "the other leg of a differential pair",
        lambda t: channel(t, "AC-8").update(
            physical_channel="cDAQ1Mod4/ai8", terminal_config="RSE", position_m=[0.3, 0.0, 0.1]
        ),
        "channels[36] (AC-8).physical_channel",
        "uses terminal ai8, which channels[29] (AC-1) has",
        "also takes ai(n+8)",
    ),
    (
        "terminal that the module lacks",
        lambda t: channel(t, "WP-1").update(physical_channel="cDAQ1Mod3/ai40"),
        "channels[24] (WP-1).physical_channel",
        "NI 9205 has no ai40",
        "ai0 to ai31",
    ),
    (
        "device that is not there",
        lambda t: channel(t, "WP-1").update(physical_channel="cDAQ1Mod7/ai0"),
        "channels[24] (WP-1).physical_channel",
        "no device `cDAQ1Mod7`",
        "cDAQ1Mod3",
    ),
    (
        "terminal configuration that the terminal lacks",
        lambda t: channel(t, "WP-1").update(physical_channel="cDAQ1Mod3/ai9"),
        "channels[24] (WP-1).terminal_config",
        "ai9 of NI 9205 cannot be DIFF",
        "DIFF exists on ai0-7, ai16-23",
    ),
    (
        "range beyond the module",
        lambda t: channel(t, "WP-1").update(input_range_v=[-12.0, 12.0]),
        "channels[24] (WP-1).input_range_v",
        "-12 to 12 V is beyond NI 9205",
        "-10 to 10",
    ),
    (
        "sensor output beyond the input range",
        lambda t: channel(t, "WP-1").update(input_range_v=[-5.0, 5.0]),
        "channels[24] (WP-1).input_range_v",
        "0.5 to 9.5 V, beyond -5 to 5 V",
        "Widen input_range_v",
    ),
    (
        "millimetres where metres belong",
        lambda t: lvdt(t).update(range_si=[-10.0, 85.0]),
        "channel_defaults.lvdt (LV-A01, LV-A02 … LV-B12: 24 channels).input_range_v",
        "beyond -10 to 10 V",
        "range_si (m)",
    ),
    (
        "empty range",
        lambda t: channel(t, "WP-1").update(range_si=[0.3, -0.3]),
        "channels[24] (WP-1).range_si",
        "empty",
        "smaller value first",
    ),
    (
        "40 channels",
        lambda t: _drop(t, "WP-3"),
        "channels",
        "4 wire channels are listed, and 5 are expected (40 of 41",
        "Add the missing",
    ),
    (
        "duplicate id",
        lambda t: channel(t, "WP-2").update(id="wp-1"),
        "channels[25] (wp-1).id",
        "is the id of channels[24] already",
        "id of its own",
    ),
    (
        "wire without anchor",
        lambda t: channel(t, "WP-2").pop("anchor_m"),
        "channels[25] (WP-2).anchor_m",
        "needs its anchor",
        "anchor_m = [x, y, z]",
    ),
    (
        "wire anchored at its own end",
        lambda t: channel(t, "WP-2").update(anchor_m=channel(t, "WP-2")["position_m"]),
        "channels[25] (WP-2).anchor_m",
        "0 m long",
        "fixed end",
    ),
    (
        "anchor of an LVDT",
        lambda t: channel(t, "LV-A01").update(anchor_m=[1.0, 0.0, 0.0]),
        "channels[0] (LV-A01).anchor_m",
        "an LVDT has no anchor",
        "Remove it",
    ),
    (
        "unit of another family",
        lambda t: t["channel_defaults"]["tiltmeter"].update(sensitivity_unit="V/g"),
        "channel_defaults.tiltmeter (TL-1X, TL-1Y … TL-2Y: 4 channels).sensitivity_unit",
        "no sensitivity unit for a tiltmeter",
        "V/deg",
    ),
    (
        "misspelt unit",
        lambda t: channel(t, "WP-1").update(sensitivity_unit="mV/m m"),
        "channels[24] (WP-1).sensitivity_unit",
        "no sensitivity unit",
        "Did you mean `mV/mm`",
    ),
    (
        "sensor far outside the wall",
        lambda t: channel(t, "WP-1").update(position_m=[325.4, 0.0, 0.9]),
        "channels[24] (WP-1).position_m",
        "outside the wall",
        "metres",
    ),
    (
        "axis of an LVDT",
        lambda t: lvdt(t).pop("axis"),
        "channel_defaults.lvdt (LV-A01, LV-A02 … LV-B12: 24 channels).axis",
        "measures along z",
        'axis = "z"',
    ),
    (
        "certificate due before it was made",
        lambda t: channel(t, "AC-1")["certificate"].update(due=dt.date(2020, 1, 1)),
        "channels[29] (AC-1).certificate",
        "before it was calibrated",
        "two dates",
    ),
    (
        "p that does not follow",
        lambda t: t["specimen"].update(p_rad_s=2.25),
        "specimen.p_rad_s",
        "= 2.204 rad/s",
        "mistyped",
    ),
    (
        "inertia about the centre of mass",
        lambda t: t["specimen"].update(rotational_inertia_kg_m2=3945.0, p_rad_s=4.45),
        "specimen.rotational_inertia_kg_m2",
        "smaller than mass",
        "about the base corner",
    ),
    (
        "unknown module",
        lambda t: modules(t)[2].update(product="NI 92055"),
        "hardware.chassis[0] (cDAQ1).modules[2].product",
        "not in the hardware catalogue",
        "Did you mean NI 9205",
    ),
    (
        "unknown chassis",
        lambda t: t["hardware"]["chassis"][0].update(product="cDAQ-9187"),
        "hardware.chassis[0] (cDAQ1).product",
        "not in the hardware catalogue",
        "Did you mean cDAQ-91",
    ),
    (
        "two modules in one slot",
        lambda t: modules(t)[2].update(slot=1, name="Third"),
        "hardware.chassis[0] (cDAQ1).modules[2].slot",
        "slot 1 holds two modules",
        "slot it sits in",
    ),
    (
        "slot that the chassis lacks",
        lambda t: modules(t)[3].update(slot=9),
        "hardware.chassis[0] (cDAQ1).modules[3].slot",
        "cDAQ-9178 has no module slot 9",
        "1 to 8",
    ),
    (
        "PXIe card in a cDAQ chassis",
        lambda t: modules(t)[3].update(product="PXIe-6345"),
        "hardware.chassis[0] (cDAQ1).modules[3].product",
        "does not fit",
        "PXIe chassis",
    ),
    (
        "device name that NI would refuse",
        lambda t: modules(t)[3].update(name="my module"),
        "hardware.chassis[0] (cDAQ1).modules[3].name",
        "no device name",
        "NI MAX",
    ),
    (
        "connection",
        lambda t: t["hardware"].update(connection="grpc://daq"),
        "hardware.connection",
        "no connection",
        "grpc://HOST:PORT",
    ),
    (
        "slow module",
        lambda t: _move_to_slow(t, "NI 9209"),
        "hardware.chassis[0] (cDAQ1).modules[3]",
        "at most 500 samples a second",
        "faster module",
    ),
    (
        "too many conversions",
        lambda t: t["acquisition"].update(rate_hz=21000.0),
        "hardware.chassis[0] (cDAQ1).modules[0]",
        "12 channels at 21000 Hz are 252 kS/s",
        "at most 11 of its channels",
    ),
    (
        "two chassis without a common clock",
        lambda t: _second_chassis(t, "cDAQ-9174"),
        "channels[40] (TL-2Y).physical_channel",
        "`Other1` and `cDAQ1` have no common sample clock",
        "one chassis",
    ),
    (
        "IEPE sensor on a module without IEPE",
        lambda t: t["channel_defaults"]["accelerometer"].update(
            measurement="iepe", input_range_v=[-10.0, 10.0]
        ),
        "channels (AC-1, AC-2 … AC-8: 8 channels).measurement",
        "NI 9205 cannot measure an IEPE sensor",
        "a voltage",
    ),
    (
        "IEPE wire",
        lambda t: channel(t, "WP-1").update(measurement="iepe"),
        "channels[24] (WP-1).measurement",
        "a wire potentiometer cannot be measured as `iepe`",
        "accelerometer",
    ),
    (
        "supply that the module does not give",
        lambda t: channel(t, "WP-1").update(excitation={"kind": "internal_voltage", "value": 10.0}),
        "channels[24] (WP-1).excitation",
        "does not supply",
        "external_voltage",
    ),
    (
        "number in quotes",
        lambda t: channel(t, "WP-1").update(sensitivity="10"),
        "channels[24] (WP-1).sensitivity",
        "'10' is not allowed here",
        "a number",
    ),
    (
        "infinite number",
        lambda t: channel(t, "WP-1").update(noise_si=float("inf")),
        "channels[24] (WP-1).noise_si",
        "inf is not allowed here",
        "finite",
    ),
    (
        "polarity",
        lambda t: channel(t, "WP-1").update(polarity=2),
        "channels[24] (WP-1).polarity",
        "2 is not allowed here",
        "1 or -1",
    ),
    (
        "physical channel that is none",
        lambda t: channel(t, "WP-1").update(physical_channel="cDAQ1Mod3"),
        "channels[24] (WP-1).physical_channel",
        "'cDAQ1Mod3' is not allowed here",
        "/ai",
    ),
    (
        "assumed key that is none",
        lambda t: t["specimen"].update(assumed=["lenght_m"]),
        "specimen",
        "lenght_m",
        "",
    ),
    ("missing table", lambda t: t.pop("specimen"), "specimen", "missing", "Add `specimen"),
    ("channels that are no list", lambda t: t.update(channels={}), "channels", "not allowed", "list"),
    (
        "negative rate",
        lambda t: t["acquisition"].update(rate_hz=-1.0),
        "acquisition.rate_hz",
        "-1.0 is not allowed",
        "greater than 0",
    ),
]


@pytest.mark.parametrize("fault", FAULTS, ids=[fault[0].replace(" ", "-") for fault in FAULTS])
def test_fault_is_named_with_its_place_and_remedy(fr1: Tables, problems: Ask, fault: Fault) -> None:
    _, spoil, key, wrong, right = fault
    spoil(fr1)
    found = problems(fr1)
    matching = [p for p in found if p.key == key and wrong in p.wrong and right in p.right]
    assert matching, "\n".join(map(str, found)) or "nothing was reported"
    assert matching[0].file == "rig.toml"
