"""NI's read calls of counter inputs and of power channels: one number, or two that belong together."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from nidaqmx._stubs import nidaqmx_pb2 as pb
from nidaqmx.constants import FillMode
from numpy.typing import NDArray

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.channels.virtual import VirtualChannel
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.requests import fields_of
from sim_hardware.daqmx_server.services.attributes.groups import Handler
from sim_hardware.daqmx_server.services.reads.digital_reads import chosen_channels
from sim_hardware.daqmx_server.tasks.reading import Reading, read
from sim_hardware.daqmx_server.tasks.samplers import pulses_at
from sim_hardware.daqmx_server.tasks.task import Task, task_named
from sim_hardware.daqmx_server.timing.counting import TIMEBASE_HZ

Numbers = NDArray[np.float64] | float
Pair = Callable[[Task, VirtualChannel, Reading], tuple[Numbers, Numbers]]
_VOLT_CODES: Final = 4096
_AMPERE_CODES: Final = 8192


def _single_handler(rpc: str, integer: bool) -> Handler:
    reply = getattr(pb, f"{rpc}Response")

    def handler(bench: Bench, request: Any) -> Any:
        fields = fields_of(request)
        task = task_named(bench, request.task.name)
        got = read(task, fields["num_samps_per_chan"], fields["timeout"], fields["array_size_in_samps"])
        values = got.codes.T if fields.get("fill_mode") == FillMode.GROUP_BY_SCAN_NUMBER.value else got.codes
        flat = values.ravel()
        numbers = flat.astype(np.uint32).tolist() if integer else flat.astype(float).tolist()
        return reply(read_array=numbers, status=got.status, samps_per_chan_read=got.count)

    return handler


def _scalar_handler(rpc: str, integer: bool) -> Handler:
    reply = getattr(pb, f"{rpc}Response")

    def handler(bench: Bench, request: Any) -> Any:
        got = read(task_named(bench, request.task.name), 1, request.timeout)
        value = float(got.codes[0, 0])
        return reply(value=int(value) if integer else value, status=got.status)

    return handler


def _pulse(task: Task, channel: VirtualChannel, reading: Reading) -> tuple[Numbers, Numbers]:
    """Low and high time of what reaches the counter, s, of each sample."""
    pulses = pulses_at(task, channel)
    if pulses is None:
        return 0.5e-3, 0.5e-3
    index = np.arange(reading.position, reading.position + reading.count)
    times = None if task.run is None else task.run.times
    instants = np.full(reading.count, reading.first_time_s) if times is None else times.at(index)
    return pulses.measured(index, instants, task.armed_s, task.timing.is_implicit)


def _frequency(task: Task, channel: VirtualChannel, reading: Reading) -> tuple[Numbers, Numbers]:
    low_s, high_s = _pulse(task, channel, reading)
    return 1.0 / (low_s + high_s), high_s / (low_s + high_s)


def _time(task: Task, channel: VirtualChannel, reading: Reading) -> tuple[Numbers, Numbers]:
    low_s, high_s = _pulse(task, channel, reading)
    return high_s, low_s


def _ticks(task: Task, channel: VirtualChannel, reading: Reading) -> tuple[Numbers, Numbers]:
    low_s, high_s = _pulse(task, channel, reading)
    return np.rint(high_s * TIMEBASE_HZ), np.rint(low_s * TIMEBASE_HZ)


def _power(task: Task, channel: VirtualChannel, reading: Reading) -> tuple[float, float]:
    attributes = channel.attributes
    if not attributes.get("PWR_OUTPUT_ENABLE", False):
        return math.nan, math.nan
    return float(attributes["PWR_VOLTAGE_SETPOINT"]), float(attributes["PWR_CURRENT_SETPOINT"])


def _power_codes(task: Task, channel: VirtualChannel, reading: Reading) -> tuple[float, float]:
    """Codes of a power channel; 0 while its output is off."""
    volts, amperes = _power(task, channel, reading)
    if math.isnan(volts):
        return 0, 0
    return int(volts * _VOLT_CODES), int(amperes * _AMPERE_CODES)


_PAIRS: Final[dict[str, tuple[Pair, str, str, bool]]] = {
    "ReadCtrFreq": (_frequency, "frequency", "duty_cycle", False),
    "ReadCtrTime": (_time, "high_time", "low_time", False),
    "ReadCtrTicks": (_ticks, "high_ticks", "low_ticks", True),
    "ReadPowerF64": (_power, "voltage", "current", False),
    "ReadPowerBinaryI16": (_power_codes, "voltage", "current", True),
}
"""RPC → the two numbers, the names of their fields, whether they are integers."""


def _pair_handler(rpc: str) -> Handler:
    pair, first, second, integer = _PAIRS[rpc]
    reply = getattr(pb, f"{rpc}Response")

    def handler(bench: Bench, request: Any) -> Any:
        fields = fields_of(request)
        task = task_named(bench, request.task.name)
        if rpc.startswith("ReadPower") and any(c.measurement != "POWER" for c in task.channels):
            raise DaqmxError(Code.READ_TYPE_MISMATCH, samples_read=0)
        got = read(task, fields["num_samps_per_chan"], fields["timeout"], fields["array_size_in_samps"])
        both = [pair(task, channel, got) for channel in chosen_channels(task, got)]
        by_scan = fields.get("fill_mode") == FillMode.GROUP_BY_SCAN_NUMBER.value

        def column(index: int) -> list[Any]:
            values: NDArray[Any] = np.array([np.broadcast_to(numbers[index], got.count) for numbers in both])
            flat = (values.T if by_scan else values).ravel()
            return list((flat.astype(int) if integer else flat.astype(float)).tolist())

        arrays = {f"read_array_{first}": column(0), f"read_array_{second}": column(1)}
        return reply(status=got.status, samps_per_chan_read=got.count, **arrays)

    return handler


def _pair_scalar_handler(rpc: str) -> Handler:
    pair, first, second, integer = _PAIRS[_PAIR_SCALARS[rpc]]
    reply = getattr(pb, f"{rpc}Response")

    def handler(bench: Bench, request: Any) -> Any:
        task = task_named(bench, request.task.name)
        got = read(task, 1, request.timeout)
        numbers = (float(np.ravel(value)[0]) for value in pair(task, chosen_channels(task, got)[0], got))
        one, two = (int(number) if integer else number for number in numbers)
        return reply(status=got.status, **{first: one, second: two})

    return handler


_PAIR_SCALARS: Final = {
    "ReadCtrFreqScalar": "ReadCtrFreq",
    "ReadCtrTimeScalar": "ReadCtrTime",
    "ReadCtrTicksScalar": "ReadCtrTicks",
    "ReadPowerScalarF64": "ReadPowerF64",
}


def counter_read_handlers() -> dict[str, Handler]:
    """RPC name → handler."""
    out = {rpc: _pair_handler(rpc) for rpc in _PAIRS}
    for rpc in ("ReadCounterF64", "ReadCounterF64Ex", "ReadCounterU32", "ReadCounterU32Ex"):
        out[rpc] = _single_handler(rpc, "U32" in rpc)
    for rpc in ("ReadCounterScalarF64", "ReadCounterScalarU32"):
        out[rpc] = _scalar_handler(rpc, "U32" in rpc)
    return out | {rpc: _pair_scalar_handler(rpc) for rpc in _PAIR_SCALARS}
