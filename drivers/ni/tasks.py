"""Makes NI tasks of planned ones, and reads back what the hardware made of them."""

from __future__ import annotations

import re
from pathlib import PurePath
from typing import Final

import nidaqmx
from nidaqmx import errors as ni_errors
from nidaqmx.constants import (
    AccelSensitivityUnits,
    AccelUnits,
    AcquisitionType,
    BridgeConfiguration,
    BridgeUnits,
    Coupling,
    CurrentUnits,
    ExcitationSource,
    LengthUnits,
    LoggingMode,
    LoggingOperation,
    LVDTSensitivityUnits,
    OverwriteMode,
    Signal,
    TaskMode,
    TemperatureUnits,
    TerminalConfiguration,
    ThermocoupleType,
    VoltageUnits,
)

from daq_app.config.planning.plan import PlannedTask
from daq_app.config.rig import Channel
from daq_app.config.units import G_M_S2
from drivers.ni.connection import Connection

NOT_WHILE_LOGGING: Final = -201300
"""NI-DAQmx's code for an attribute that excludes its own logging (ATTRIBUTE_NOT_SUPPORTED_WHEN_LOGGING in
`nidaqmx.error_codes`). No document of NI's that was found says which attributes: both answers must do."""
_DEFAULT_LVDT_EXCITATION_V = 3.0
_DEFAULT_LVDT_FREQUENCY_HZ = 2500.0
_BRIDGES = {
    "full": BridgeConfiguration.FULL_BRIDGE,
    "half": BridgeConfiguration.HALF_BRIDGE,
    "quarter": BridgeConfiguration.QUARTER_BRIDGE,
}
_DEFAULT_IEPE_CURRENT_A = 0.002
"""What the NI 9234 delivers; nidaqmx would ask for 4 mA, which that module refuses."""


def create_task(connection: Connection, planned: PlannedTask) -> nidaqmx.Task:
    """A committed task for `planned`. On failure the half-made task is closed again.

    Raises the nidaqmx client's errors (the caller translates them).
    """
    task = connection.new_task(planned.name)
    try:
        for item in planned.channels:
            _add_channel(task, item.channel)
        task.timing.cfg_samp_clk_timing(
            planned.requested_rate_hz,
            source=planned.clock_source,
            sample_mode=AcquisitionType.CONTINUOUS,
            samps_per_chan=planned.buffer_samples,
        )
        if planned.buffer_samples:
            task.in_stream.input_buf_size = planned.buffer_samples
        # A computer that was deaf for longer than the buffer must find the newest samples and know
        # how many it missed; with the default the device would stop, and the rest of the test be lost.
        # Set before the start: NI's help on the property OverWrite says "settable while task is running:
        # device-specific".
        task.in_stream.overwrite = OverwriteMode.OVERWRITE_UNREAD_SAMPLES
        if planned.start_trigger_source:
            task.triggers.start_trigger.cfg_dig_edge_start_trig(planned.start_trigger_source)
        if planned.exported_clock:
            task.export_signals.export_signal(Signal.SAMPLE_CLOCK, planned.exported_clock)
            task.export_signals.export_signal(Signal.START_TRIGGER, planned.exported_trigger)
    except BaseException:
        task.close()
        raise
    return task


def commit(task: nidaqmx.Task) -> None:
    """Verify, reserve and program the hardware, so that starting takes no time and cannot fail late.

    A driver that refuses to overwrite samples while it logs (−201300) must stop when its buffer is full; the
    tasks are then started again, with a gap.
    """
    try:
        _commit(task)
    except ni_errors.DaqError as error:
        if int(error.error_code) != NOT_WHILE_LOGGING:
            raise
        del task.in_stream.overwrite
        _commit(task)


def _commit(task: nidaqmx.Task) -> None:
    task.control(TaskMode.TASK_VERIFY)
    task.control(TaskMode.TASK_RESERVE)
    task.control(TaskMode.TASK_COMMIT)


def virtual_name(channel: Channel) -> str:
    """The channel's id in the letters that NI-DAQmx allows in names."""
    return re.sub(r"[^A-Za-z0-9_]", "_", channel.id)


def log_to_tdms(task: nidaqmx.Task, path: PurePath) -> None:
    """Let the NI driver itself write every sample it hands out to `path`, paused until a test is armed.

    The second recorder: it shares neither our process's writer nor our file format. With a device
    server the path is on the server's disk.
    """
    task.in_stream.configure_logging(
        path,
        logging_mode=LoggingMode.LOG_AND_READ,
        operation=LoggingOperation.CREATE_OR_REPLACE,
    )
    task.in_stream.logging_pause = True


def _add_channel(task: nidaqmx.Task, channel: Channel) -> None:
    add = {
        "voltage": _add_voltage,
        "iepe": _add_iepe,
        "lvdt_native": _add_lvdt,
        "current": _add_current,
        "bridge": _add_bridge,
        "thermocouple": _add_thermocouple,
    }[channel.measurement]
    add(task, channel)


def _add_voltage(task: nidaqmx.Task, channel: Channel) -> None:
    low, high = channel.input_range_v
    task.ai_channels.add_ai_voltage_chan(
        channel.physical_channel,
        name_to_assign_to_channel=virtual_name(channel),
        terminal_config=TerminalConfiguration[channel.terminal_config],
        min_val=low,
        max_val=high,
        units=VoltageUnits.VOLTS,
    )


def _add_current(task: nidaqmx.Task, channel: Channel) -> None:
    low, high = channel.input_range_v
    task.ai_channels.add_ai_current_chan(
        channel.physical_channel,
        name_to_assign_to_channel=virtual_name(channel),
        terminal_config=TerminalConfiguration[channel.terminal_config],
        min_val=low,
        max_val=high,
        units=CurrentUnits.AMPS,
    )


def _add_bridge(task: nidaqmx.Task, channel: Channel) -> None:
    low, high = channel.input_range_v
    internal = channel.excitation.kind == "internal_voltage"
    task.ai_channels.add_ai_bridge_chan(
        channel.physical_channel,
        name_to_assign_to_channel=virtual_name(channel),
        min_val=low,
        max_val=high,
        units=BridgeUnits.VOLTS_PER_VOLT,
        bridge_config=_BRIDGES[channel.bridge],
        voltage_excit_source=ExcitationSource.INTERNAL if internal else ExcitationSource.EXTERNAL,
        voltage_excit_val=channel.excitation.value,
        nominal_bridge_resistance=channel.bridge_ohm,
    )


def _add_thermocouple(task: nidaqmx.Task, channel: Channel) -> None:
    low, high = channel.range_si
    task.ai_channels.add_ai_thrmcpl_chan(
        channel.physical_channel,
        name_to_assign_to_channel=virtual_name(channel),
        min_val=low,
        max_val=high,
        units=TemperatureUnits.DEG_C,
        thermocouple_type=ThermocoupleType[channel.thermocouple],
    )


def _add_iepe(task: nidaqmx.Task, channel: Channel) -> None:
    low, high = (volts / channel.sensitivity_v_per_si for volts in channel.input_range_v)
    created = task.ai_channels.add_ai_accel_chan(
        channel.physical_channel,
        name_to_assign_to_channel=virtual_name(channel),
        terminal_config=TerminalConfiguration[channel.terminal_config],
        min_val=low,
        max_val=high,
        units=AccelUnits.METERS_PER_SECOND_SQUARED,
        sensitivity=channel.sensitivity_v_per_si * G_M_S2 * 1e3,
        sensitivity_units=AccelSensitivityUnits.MILLIVOLTS_PER_G,
        current_excit_source=ExcitationSource.INTERNAL,
        current_excit_val=channel.excitation.value or _DEFAULT_IEPE_CURRENT_A,
    )
    created.ai_coupling = Coupling.AC


def _add_lvdt(task: nidaqmx.Task, channel: Channel) -> None:
    low, high = channel.range_si
    task.ai_channels.add_ai_pos_lvdt_chan(
        channel.physical_channel,
        name_to_assign_to_channel=virtual_name(channel),
        min_val=low,
        max_val=high,
        units=LengthUnits.METERS,
        sensitivity=_lvdt_sensitivity_v_per_v_per_m(channel),
        # V/V/m and mV/V/mm are the same number.
        sensitivity_units=LVDTSensitivityUnits.MILLIVOLTS_PER_VOLT_PER_MILLIMETER,
        voltage_excit_source=ExcitationSource.INTERNAL,
        voltage_excit_val=_lvdt_excitation_v(channel),
        voltage_excit_freq=channel.excitation.frequency_hz or _DEFAULT_LVDT_FREQUENCY_HZ,
    )


def _lvdt_excitation_v(channel: Channel) -> float:
    return channel.excitation.value or _DEFAULT_LVDT_EXCITATION_V


def _lvdt_sensitivity_v_per_v_per_m(channel: Channel) -> float:
    if channel.sensitivity_unit == "mV/V/mm":
        return channel.sensitivity_v_per_si
    return channel.sensitivity_v_per_si / _lvdt_excitation_v(channel)


def read_ranges(task: nidaqmx.Task, planned: PlannedTask) -> dict[str, tuple[float, float]]:
    """Channel id → the module's input range, in the unit of the reading."""
    ranges = {}
    for item, created in zip(planned.channels, task.ai_channels, strict=True):
        if item.channel.measurement == "thermocouple":  # its range is told in volts, its reading in °C
            ranges[item.channel.id] = item.channel.range_si
            continue
        volts = (float(created.ai_rng_low), float(created.ai_rng_high))
        per_reading = _volts_per_reading(item.channel)
        ranges[item.channel.id] = (volts[0] / per_reading, volts[1] / per_reading)
    return ranges


def _volts_per_reading(channel: Channel) -> float:
    if channel.measurement == "iepe":
        return channel.sensitivity_v_per_si
    if channel.measurement == "lvdt_native":
        return _lvdt_sensitivity_v_per_v_per_m(channel) * _lvdt_excitation_v(channel)
    return 1.0
