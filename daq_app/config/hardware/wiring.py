"""Checks of each channel against the module that it is wired to."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from daq_app.config.errors import Problem
from daq_app.config.hardware import catalogue
from daq_app.config.hardware.inventory import Device
from daq_app.config.rig import Channel
from daq_app.config.validation import nearest

MAX_SOURCE_IMPEDANCE_OHM = 1e3
"""Above this a multiplexed converter shows part of the previous channel (ghosting; NI on settling time)."""

_MEASURES = {
    "voltage": "a voltage",
    "iepe": "an IEPE sensor",
    "lvdt_native": "an LVDT directly",
    "current": "a current",
    "bridge": "a bridge",
    "thermocouple": "a thermocouple",
}


def channel_key(index: int, channel: Channel, key: str = "") -> str:
    """``channels[3] (LV-A04).key``."""
    return f"channels[{index}] ({channel.id})" + (f".{key}" if key else "")


def terminal_of(channel: Channel) -> tuple[str, int]:
    """Device name and ai number of a channel."""
    device, ai = channel.physical_channel.split("/ai")
    return device, int(ai)


def wiring_problems(
    channels: Mapping[int, Channel], devices: Mapping[str, Device | None], file: str
) -> list[Problem]:
    """Problems of all channels (rig index → channel) with their modules and with each other.

    A device that is None is reported elsewhere: its channels are only compared with each other.
    """
    problems: list[Problem] = []
    for index, channel in channels.items():
        name, ai = terminal_of(channel)
        device = devices.get(name)
        key = channel_key(index, channel, "physical_channel")
        if device is None:
            if name in devices:
                continue
            near = nearest(name, devices)
            hint = f"Did you mean `{near[0]}`? " if near else ""
            known = f"{hint}Devices of this rig: {', '.join(devices) or 'none'}"
            problems.append(Problem(file, key, f"there is no device `{name}` in [hardware]", known))
        elif ai >= device.product.n_ai:
            wrong = f"{device.product.name} has no ai{ai}"
            problems.append(Problem(file, key, wrong, f"Its inputs are ai0 to ai{device.product.n_ai - 1}"))
        else:
            problems += _channel_problems(index, channel, device, ai, file)
    problems += list(_shared_terminals(channels, devices, file))
    return problems


def _channel_problems(index: int, channel: Channel, device: Device, ai: int, file: str) -> Iterator[Problem]:
    product = device.product
    if channel.measurement not in product.measurements:
        able = [_MEASURES[name] for name in _MEASURES if name in product.measurements]
        wrong = f"{product.name} cannot measure {_MEASURES[channel.measurement]}"
        right = f"It measures {' or '.join(able)}" if able else "Use another module"
        yield Problem(file, channel_key(index, channel, "measurement"), wrong, right)
        return
    config = channel.terminal_config
    if ai not in product.terminals.get(config, frozenset()):
        options = [name for name, terminals in product.terminals.items() if ai in terminals]
        wrong = f"ai{ai} of {product.name} cannot be {config}"
        right = f"ai{ai} can be {', '.join(options)}"
        if config in product.terminals:
            right += f"; {config} exists on {_span(product.terminals[config])}"
        yield Problem(file, channel_key(index, channel, "terminal_config"), wrong, right)
    low, high = channel.input_range_v
    if low < high and channel.measurement != "thermocouple":
        try:
            catalogue.coerce_range(product, low, high, channel.measurement)
        except ValueError:
            unit = {"current": "A", "bridge": "V/V"}.get(channel.measurement, "V")
            spans = product.ranges.get(channel.measurement, product.ranges_v)
            ranges = ", ".join(f"{a:g} to {b:g}" for a, b in spans)
            wrong = f"{low:g} to {high:g} {unit} is beyond {product.name}"
            yield Problem(
                file, channel_key(index, channel, "input_range_v"), wrong, f"Its ranges are {ranges} {unit}"
            )
    yield from _excitation_problems(index, channel, device, file)


def _excitation_problems(index: int, channel: Channel, device: Device, file: str) -> Iterator[Problem]:
    product = device.product
    excitation = channel.excitation
    key = channel_key(index, channel, "excitation")
    if channel.measurement == "iepe":
        currents = ", ".join(f"{value:g} A" for value in product.iepe_currents_a)
        if excitation.kind != "internal_current" or not any(
            abs(excitation.value - value) < 1e-6 for value in product.iepe_currents_a
        ):
            wrong = f"{product.name} supplies IEPE sensors with {currents} only"
            right = (
                f'Write excitation = {{ kind = "internal_current", value = {product.iepe_currents_a[0]:g} }}'
            )
            yield Problem(file, key, wrong, right)
    elif channel.measurement == "lvdt_native":
        (v_low, v_high), (f_low, f_high) = product.excitation_v, product.excitation_hz
        if (
            excitation.kind != "internal_voltage"
            or not v_low <= excitation.value <= v_high
            or not f_low <= excitation.frequency_hz <= f_high
        ):
            wrong = f"{product.name} cannot excite an LVDT with {excitation.kind}, {excitation.value:g} V, "
            wrong += f"{excitation.frequency_hz:g} Hz"
            right = f'kind = "internal_voltage", value = {v_low:g} to {v_high:g} V rms, '
            right += f"frequency_hz = {f_low:g} to {f_high:g}"
            yield Problem(file, key, wrong, right)
    elif channel.measurement == "bridge":
        v_low, v_high = product.excitation_v
        internal = excitation.kind == "internal_voltage"
        if not excitation.value or (internal and v_high and not v_low <= excitation.value <= v_high):
            wrong = f"a bridge needs its excitation, and has {excitation.kind}, {excitation.value:g} V"
            range_v = f"{v_low:g} to {v_high:g}" if v_high else "the volts of its excitation"
            right = f'Write excitation = {{ kind = "internal_voltage", value = … }} with {range_v}'
            yield Problem(file, key, wrong, right)
    elif excitation.kind in ("internal_voltage", "internal_current"):
        wrong = f"{product.name} does not supply voltage sensors"
        yield Problem(file, key, wrong, 'Use kind = "external_voltage" with the supply\'s volts, or "none"')


def _shared_terminals(
    channels: Mapping[int, Channel], devices: Mapping[str, Device | None], file: str
) -> Iterator[Problem]:
    taken: dict[tuple[str, int], tuple[int, Channel]] = {}
    for index, channel in channels.items():
        name, ai = terminal_of(channel)
        device = devices.get(name)
        screws = [ai]
        if device and channel.terminal_config == "DIFF" and "RSE" in device.product.terminals:
            screws.append(ai + 8)  # the negative leg of a DIFF pair on a multiplexed module
        for screw in screws:
            other = taken.setdefault((name, screw), (index, channel))
            if other[0] == index:
                continue
            wrong = f"`{channel.physical_channel}` is already used by {channel_key(*other)}"
            if screw != ai or terminal_of(other[1])[1] != ai:
                owner = channel_key(*other)
                wrong = f"{channel.terminal_config} on ai{ai} uses terminal ai{screw}, which {owner} has"
            yield Problem(
                file,
                channel_key(index, channel, "physical_channel"),
                wrong,
                "Wire each sensor to terminals of its own; a DIFF input ai(n) also takes ai(n+8)",
            )
            break


def _span(numbers: frozenset[int]) -> str:
    """``ai0-7, ai16-23``."""
    spans: list[list[int]] = []
    for number in sorted(numbers):
        if spans and spans[-1][1] == number - 1:
            spans[-1][1] = number
        else:
            spans.append([number, number])
    return ", ".join(f"ai{a}-{b}" if b > a else f"ai{a}" for a, b in spans)
