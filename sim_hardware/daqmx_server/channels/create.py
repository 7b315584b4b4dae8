"""From NI's ``Create…Chan`` requests to channels."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from nidaqmx.constants import CurrentShuntResistorLocation, LineGrouping

from sim_hardware.daqmx_server.channels.analog_input import FROM_CUSTOM_SCALE, AnalogInput
from sim_hardware.daqmx_server.channels.kinds import KINDS, ChannelKind
from sim_hardware.daqmx_server.channels.measurements import measurements_of
from sim_hardware.daqmx_server.channels.rosette import rosette_channels
from sim_hardware.daqmx_server.channels.scale import CustomScale
from sim_hardware.daqmx_server.channels.teds import DataSheet
from sim_hardware.daqmx_server.channels.teds_templates import attributes_from
from sim_hardware.daqmx_server.channels.virtual import VirtualChannel
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.inventory.devices import Device, Inventory, channel_list


def create_channels(
    inventory: Inventory,
    scales: Mapping[str, CustomScale],
    rpc: str,
    fields: dict[str, Any],
    existing: set[str],
    data_sheets: Mapping[str, DataSheet],
) -> list[VirtualChannel]:
    """Channels of one request. Raises what NI-DAQmx raises for names and types that do not fit."""
    kind = KINDS[rpc]
    if kind.io in ("DI", "DO"):
        channels = _digital(inventory, kind, fields)
    else:
        channels = _single(inventory, scales, kind, fields)
        if kind.measurement == "ROSETTE_STRAIN_GAGE":
            gauges = [channel for channel in channels if isinstance(channel, AnalogInput)]
            channels = [*rosette_channels(gauges, fields, existing)]
        if kind.teds:
            _take_over(data_sheets, channels)
    names = set(existing)
    for channel in channels:
        if channel.name in names:
            raise DaqmxError(Code.CHANNEL_ALREADY_IN_TASK, f"Channel Name: {channel.name}")
        names.add(channel.name)
    return channels


def _single(
    inventory: Inventory, scales: Mapping[str, CustomScale], kind: ChannelKind, fields: dict[str, Any]
) -> list[VirtualChannel]:
    """One channel for each physical channel."""
    given = (
        fields.get("physical_channel") or fields.get("counter") or fields.get("voltage_physical_channel", "")
    )
    terminals = channel_list(str(given))
    if not terminals:
        raise DaqmxError(Code.PHYSICAL_CHANNEL_UNKNOWN, "Physical Channel Name: (none)")
    scale = _scale_of(scales, fields)
    located = [inventory.named_channel(terminal, kind.io) for terminal in terminals]
    names = _names(str(fields.get("name_to_assign_to_channel", "")), [physical for _, physical in located])
    out: list[VirtualChannel] = []
    for name, (device, physical) in zip(names, located, strict=True):
        attributes = {
            kind.attributes[key]: _plain(value) for key, value in fields.items() if key in kind.attributes
        }
        if kind.io != "AI":
            number = _number(physical)
            out.append(VirtualChannel(name, physical, device, number, kind, attributes, scale))
            continue
        _check_measurement(device, kind, physical)
        _choose_shunt(kind, attributes)
        _, number = inventory.physical_channel(physical)
        channel = AnalogInput(name, physical, device, number, kind, attributes, scale)
        out.append(channel)
    return out


def _take_over(data_sheets: Mapping[str, DataSheet], channels: list[VirtualChannel]) -> None:
    """Let each channel have what its sensor's data sheet says; −200709 where there is none."""
    for channel in channels:
        if channel.physical not in data_sheets:
            raise DaqmxError(Code.TEDS_NOT_DETECTED, f"Physical Channel Name: {channel.physical}")
        channel.attributes |= attributes_from(data_sheets[channel.physical])


def _plain(value: Any) -> Any:
    return value if isinstance(value, int | float | str | bool) else list(value)


def _number(physical: str) -> int:
    digits = "".join(character for character in physical.rpartition("/")[2] if character.isdigit())
    return int(digits or 0)


def _check_measurement(device: Device, kind: ChannelKind, physical: str) -> None:
    assert device.product is not None
    if kind.measurement not in measurements_of(device.product):
        raise DaqmxError(
            Code.MEASUREMENT_TYPE_UNSUPPORTED,
            f"Property: DAQmx_AI_MeasType\nRequested Value: {kind.measurement}",
            f"Physical Channel Name: {physical}",
        )


def _choose_shunt(kind: ChannelKind, attributes: dict[str, Any]) -> None:
    """ "Let the driver choose" means the shunt of a multimeter, and an external one everywhere else."""
    if attributes.get("AI_CURRENT_SHUNT_LOC") == CurrentShuntResistorLocation.LET_DRIVER_CHOOSE.value:
        own = kind.measurement == "CURRENT_ACRMS"
        chosen = CurrentShuntResistorLocation.INTERNAL if own else CurrentShuntResistorLocation.EXTERNAL
        attributes["AI_CURRENT_SHUNT_LOC"] = chosen.value


def _digital(inventory: Inventory, kind: ChannelKind, fields: dict[str, Any]) -> list[VirtualChannel]:
    """One channel for each line, or one for all of them."""
    groups: list[tuple[Device, str, list[str]]] = []
    for text in channel_list(str(fields["lines"])):
        device, lines = inventory.digital_lines(text)
        if device.product is not None and not (
            device.product.ports.input if kind.io == "DI" else device.product.ports.output
        ):
            raise DaqmxError(Code.INVALID_CHANNEL_TYPE, f"Physical Channel Name: {text}")
        whole = lines[0].rpartition("/")[0] if "line" not in text.rpartition("/")[2].lower() else lines[0]
        groups.append((device, whole, lines))
    if not groups:
        raise DaqmxError(Code.PHYSICAL_CHANNEL_UNKNOWN, "Physical Channel Name: (none)")
    device = groups[0][0]
    if fields["line_grouping"] == LineGrouping.CHAN_FOR_ALL_LINES.value:
        physical = [", ".join(name for _, name, _ in groups)]
        shown = [groups[0][1] + ("..." if len(groups) > 1 else "")]
        lines_of = [tuple(line for _, _, lines in groups for line in lines)]
        columns_of = [tuple(line for _, _, lines in groups for line in reversed(lines))]
    else:
        lines_of = [(line,) for _, _, lines in groups for line in lines]
        columns_of = lines_of
        physical = [lines[0] for lines in lines_of]
        shown = physical
    names = _names(str(fields["name_to_assign_to_lines"]), shown)
    return [
        VirtualChannel(name, place, device, 0, kind, lines=lines, columns=columns)
        for name, place, lines, columns in zip(names, physical, lines_of, columns_of, strict=True)
    ]


def _scale_of(scales: Mapping[str, CustomScale], fields: dict[str, Any]) -> CustomScale | None:
    """The custom scale a call asks for: −200447 if its units do not say so, −200378 if it is unknown."""
    name = fields.get("custom_scale_name", "")
    if fields.get("units") != FROM_CUSTOM_SCALE:
        if name:
            raise DaqmxError(Code.UNITS_NOT_CUSTOM, f"Custom Scale Name: {name}")
        return None
    if name not in scales:
        raise DaqmxError(Code.SCALE_UNKNOWN, f"Custom Scale Name: {name}")
    return scales[name]


def _names(assigned: str, physical: list[str]) -> list[str]:
    """Names as NI gives them: a list is taken one by one, one name for several gets numbers."""
    names = channel_list(assigned)
    if not names:
        return physical
    if len(names) == len(physical):
        return names
    if len(physical) == 1:
        return [assigned]
    return [f"{names[0]}{i}" for i in range(len(physical))]
