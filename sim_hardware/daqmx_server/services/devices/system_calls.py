"""Calls about devices rather than tasks: calibration, power-up states, routes, network reservation."""

from __future__ import annotations

from typing import Any, Final

from nidaqmx import constants
from nidaqmx._stubs import nidaqmx_pb2 as pb

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.errors import Code, DaqmxError, error_text
from sim_hardware.daqmx_server.inventory.devices import Device, channel_list
from sim_hardware.daqmx_server.inventory.terminals import full_name
from sim_hardware.daqmx_server.requests import fields_of
from sim_hardware.daqmx_server.services.attributes.groups import Handler, unsupported
from sim_hardware.daqmx_server.tasks.task import tasks_of

_CALIBRATED: Final = {"year": 2020, "month": 1, "day": 2, "hour": 3, "minute": 4}
"""When every simulated device was calibrated last."""


def _device(bench: Bench, name: str) -> Device:
    device = bench.inventory.device(name)
    bench.check_access(device)
    return device


def device_handler(rpc: str) -> Handler:
    """Calls that only need the device to be there; a reset aborts its tasks, a calibration has a date."""
    reply = getattr(pb, f"{rpc}Response")

    def call(bench: Bench, request: Any) -> Any:
        device = _device(bench, request.device_name)
        if rpc == "ResetDevice":
            for task in tasks_of(bench):
                if device.name in (*task.devices, *task.hosts):
                    task.abort()
        if rpc == "SelfCal":
            bench.self_calibrated[device.name] = bench.utc(bench.clock.now())
        return reply()

    return call


def _calibration_date(rpc: str) -> Handler:
    reply = getattr(pb, f"{rpc}Response")

    def call(bench: Bench, request: Any) -> Any:
        device = _device(bench, request.device_name)
        done = bench.self_calibrated.get(device.name) if rpc == "GetSelfCalLastDateAndTime" else None
        if done is None:
            return reply(**_CALIBRATED)
        names = ("year", "month", "day", "hour", "minute")
        return reply(**{name: getattr(done, name) for name in names})

    return call


def supports_calibration(bench: Bench, request: Any) -> Any:
    _device(bench, request.device_name)
    return pb.DeviceSupportsCalResponse(cal_supported=True)


def connect_terminals(bench: Bench, request: Any) -> Any:
    """A route between two terminals: edges at the first appear at the second."""
    source, destination = _route(bench, request)
    bench.routes[destination] = source
    return pb.ConnectTermsResponse()


def disconnect_terminals(bench: Bench, request: Any) -> Any:
    _, destination = _route(bench, request)
    bench.routes.pop(destination, None)
    return pb.DisconnectTermsResponse()


def tristate_terminal(bench: Bench, request: Any) -> Any:
    """The terminal is driven by nobody."""
    bench.routes.pop(_terminal(bench, request.output_terminal, Code.DESTINATION_TERMINAL_UNKNOWN), None)
    return pb.TristateOutputTermResponse()


def _route(bench: Bench, request: Any) -> tuple[str, str]:
    source = _terminal(bench, request.source_terminal, Code.SOURCE_TERMINAL_UNKNOWN)
    return source, _terminal(bench, request.destination_terminal, Code.DESTINATION_TERMINAL_UNKNOWN)


def _terminal(bench: Bench, name: str, wrong: Code) -> str:
    owner = name.strip("/").partition("/")[0]
    known = {device.name.lower(): device for device in bench.inventory.devices.values()}
    if owner.lower() not in known:
        raise DaqmxError(wrong, f"Requested Value: {name}")
    return full_name(bench.inventory, known[owner.lower()], name, wrong)


_FIRST_LINE: Final = constants.PowerUpStates.LOW.value


def digital_power_up(bench: Bench, request: Any) -> Any:
    device = _device(bench, request.device_name)
    states = [bench.power_up.get(name, _FIRST_LINE) for name in _lines(bench, device, request.channel_name)]
    return pb.GetDigitalPowerUpStatesResponse(power_up_states=states)


def set_digital_power_up(bench: Bench, request: Any) -> Any:
    device = _device(bench, request.device_name)
    for entry in request.power_up_states:
        for line in _lines(bench, device, [entry.channel_names]):
            bench.power_up[line] = entry.state
    return pb.SetDigitalPowerUpStatesResponse()


_HIGH_IMPEDANCE: Final = constants.PowerUpChannelType.CHANNEL_HIGH_IMPEDANCE.value


def analog_power_up(bench: Bench, request: Any) -> Any:
    """Value and kind of each analogue output when the device is switched on; high impedance by default."""
    states: list[float] = []
    kinds: list[int] = []
    for name in channel_list(request.channel_names):
        _, channel = bench.inventory.named_channel(name, "AO")
        value, kind = bench.analog_power_up.get(channel, (0.0, _HIGH_IMPEDANCE))
        states.append(value)
        kinds.append(kind)
    return pb.GetAnalogPowerUpStatesWithOutputTypeResponse(
        state_array=states, channel_type_array=kinds, channel_type_array_raw=kinds
    )


def set_analog_power_up(bench: Bench, request: Any) -> Any:
    """−200077 for a value beyond the range of the output; then nothing is set."""
    given = zip(
        channel_list(request.channel_names), request.state_array, request.channel_type_array, strict=True
    )
    wanted: dict[str, tuple[float, int]] = {}
    for name, value, kind in given:
        device, channel = bench.inventory.named_channel(name, "AO")
        assert device.product is not None
        outputs = device.product.outputs
        widest = max((high for _, high in outputs.ranges_v or outputs.ranges_a), default=0.0)
        if abs(value) > widest:
            raise DaqmxError(
                Code.INVALID_VALUE,
                f"Requested Value: {value}\nMaximum Value: {widest}",
                f"Channel: {channel}",
            )
        wanted[channel] = (float(value), int(kind))
    bench.analog_power_up |= wanted
    return pb.SetAnalogPowerUpStatesWithOutputTypeResponse()


def pulls(bench: Bench, request: Any) -> Any:
    device = _device(bench, request.device_name)
    down = constants.ResistorState.PULL_DOWN.value
    states = [bench.power_up.get(f"pull {x}", down) for x in _lines(bench, device, request.channel_name)]
    return pb.GetDigitalPullUpPullDownStatesResponse(
        pull_up_pull_down_states=states, pull_up_pull_down_states_raw=states
    )


def set_pulls(bench: Bench, request: Any) -> Any:
    device = _device(bench, request.device_name)
    for entry in request.pull_up_pull_down_states:
        for line in _lines(bench, device, [entry.channel_names]):
            bench.power_up[f"pull {line}"] = entry.state
    return pb.SetDigitalPullUpPullDownStatesResponse()


def _lines(bench: Bench, device: Device, names: Any) -> list[str]:
    wanted = [line for text in names for line in channel_list(text)]
    if not wanted:
        return list(device.lines)
    return [line for name in wanted for line in bench.inventory.digital_lines(name)[1]]


def logic_family(bench: Bench, request: Any) -> Any:
    device = _device(bench, request.device_name)
    family = bench.power_up.get(f"family {device.name}", constants.LogicFamily.FIVE_V.value)
    return pb.GetDigitalLogicFamilyPowerUpStateResponse(logic_family=family, logic_family_raw=family)


def set_logic_family(bench: Bench, request: Any) -> Any:
    device = _device(bench, request.device_name)
    bench.power_up[f"family {device.name}"] = fields_of(request)["logic_family"]
    return pb.SetDigitalLogicFamilyPowerUpStateResponse()


def reserve_network(bench: Bench, request: Any) -> Any:
    """Reserve a network chassis; −201420 where somebody else has it and no override is asked for."""
    device = _network_chassis(bench, request.device_name)
    if bench.faults.active("network_reserved", device.name) and not request.override_reservation:
        raise DaqmxError(Code.NETWORK_RESERVED_BY_OTHER, f"Device Specified: {device.name}")
    bench.take_over(device.name)
    return pb.ReserveNetworkDeviceResponse()


def unreserve_network(bench: Bench, request: Any) -> Any:
    _network_chassis(bench, request.device_name)  # a simulated chassis can be used without a reservation
    return pb.UnreserveNetworkDeviceResponse()


def _network_chassis(bench: Bench, name: str) -> Device:
    device = bench.inventory.device(name)
    if device.bus is not constants.BusType.TCPIP:
        raise unsupported("Dev_TCPIP", f"Device Specified: {device.name}")
    return device


def error_string(bench: Bench, request: Any) -> Any:
    return pb.GetErrorStringResponse(error_string=error_text(request.error_code))


def no_sync_ports(rpc: str) -> Handler:
    """Chassis of the bench share one clock: no sync port is configured, none is disconnected."""
    reply = getattr(pb, f"{rpc}Response")
    return lambda bench, request: reply()


def system_handlers() -> dict[str, Handler]:
    """RPC name → handler."""
    out: dict[str, Handler] = {
        rpc: device_handler(rpc)
        for rpc in ("ResetDevice", "SelfTestDevice", "SelfCal", "RestoreLastExtCalConst")
    }
    for rpc in ("GetSelfCalLastDateAndTime", "GetExtCalLastDateAndTime"):
        out[rpc] = _calibration_date(rpc)
    for rpc in (
        "AddCDAQSyncConnection",
        "RemoveCDAQSyncConnection",
        "AutoConfigureCDAQSyncConnections",
        "GetAutoConfiguredCDAQSyncConnections",
        "AreConfiguredCDAQSyncPortsDisconnected",
        "GetDisconnectedCDAQSyncPorts",
    ):
        out[rpc] = no_sync_ports(rpc)
    return out | {
        "DeviceSupportsCal": supports_calibration,
        "ConnectTerms": connect_terminals,
        "DisconnectTerms": disconnect_terminals,
        "TristateOutputTerm": tristate_terminal,
        "GetDigitalPowerUpStates": digital_power_up,
        "SetDigitalPowerUpStates": set_digital_power_up,
        "GetAnalogPowerUpStatesWithOutputType": analog_power_up,
        "SetAnalogPowerUpStatesWithOutputType": set_analog_power_up,
        "GetDigitalPullUpPullDownStates": pulls,
        "SetDigitalPullUpPullDownStates": set_pulls,
        "GetDigitalLogicFamilyPowerUpState": logic_family,
        "SetDigitalLogicFamilyPowerUpState": set_logic_family,
        "ReserveNetworkDevice": reserve_network,
        "UnreserveNetworkDevice": unreserve_network,
        "GetErrorString": error_string,
    }
