"""Calls that configure clocks, triggers, buffers and exported signals of a task."""

from __future__ import annotations

from typing import Any, Final

from nidaqmx import constants
from nidaqmx._stubs import nidaqmx_pb2 as pb

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.inventory.devices import channel_list
from sim_hardware.daqmx_server.requests import fields_of
from sim_hardware.daqmx_server.services.attributes.groups import Handler
from sim_hardware.daqmx_server.services.attributes.timestamps import (
    Event,
    event_instant,
    is_stamped,
    timestamp,
)
from sim_hardware.daqmx_server.tasks.task import task_named
from sim_hardware.daqmx_server.timing import triggers

_COUNTS: Final = {"sample_mode": "SAMP_QUANT_SAMP_MODE", "samps_per_chan": "SAMP_QUANT_SAMP_PER_CHAN"}
_CLOCK: Final = {
    "source": "SAMP_CLK_SRC",
    "rate": "SAMP_CLK_RATE",
    "active_edge": "SAMP_CLK_ACTIVE_EDGE",
    "sample_clk_rate": "SAMP_CLK_RATE",
    "sample_clk_src": "SAMP_CLK_SRC",
    "sample_clk_active_edge": "SAMP_CLK_ACTIVE_EDGE",
    "rising_edge_chan": "CHANGE_DETECT_DI_RISING_EDGE_PHYSICAL_CHANS",
    "falling_edge_chan": "CHANGE_DETECT_DI_FALLING_EDGE_PHYSICAL_CHANS",
} | _COUNTS
_EXPORTED: Final = {
    "sample_clk_outp_term": "SAMP_CLK_OUTPUT_TERM",
    "sample_clk_pulse_polarity": "SAMP_CLK_PULSE_POLARITY",
    "ready_event_active_level": "RDY_FOR_XFER_EVENT_LVL_ACTIVE_LVL",
}
_TYPES: Final = {
    "CfgSampClkTiming": constants.SampleTimingType.SAMPLE_CLOCK,
    "CfgImplicitTiming": constants.SampleTimingType.IMPLICIT,
    "CfgHandshakingTiming": constants.SampleTimingType.HANDSHAKE,
    "CfgChangeDetectionTiming": constants.SampleTimingType.CHANGE_DETECTION,
    "CfgPipelinedSampClkTiming": constants.SampleTimingType.PIPELINED_SAMPLE_CLOCK,
    "CfgBurstHandshakingTimingImportClock": constants.SampleTimingType.BURST_HANDSHAKE,
    "CfgBurstHandshakingTimingExportClock": constants.SampleTimingType.BURST_HANDSHAKE,
}


def _timing_handler(rpc: str) -> Handler:
    reply = getattr(pb, f"{rpc}Response")

    def configure(bench: Bench, request: Any) -> Any:
        task = task_named(bench, request.task.name)
        task.configure()
        fields = fields_of(request)
        settings = task.timing.settings
        settings["SAMP_TIMING_TYPE"] = _TYPES[rpc].value
        settings.pop("SAMP_CLK_TIMEBASE_DIV", None)
        settings.update({_CLOCK[key]: value for key, value in fields.items() if key in _CLOCK})
        task.exported.update({_EXPORTED[key]: value for key, value in fields.items() if key in _EXPORTED})
        if "pause_when" in fields:
            task.trigger["DIG_LVL_PAUSE_TRIG_WHEN"] = fields["pause_when"]
        return reply()

    return configure


def input_buffer(bench: Bench, request: Any) -> Any:
    task = task_named(bench, request.task.name)
    task.configure()
    task.input_buffer = request.num_samps_per_chan
    return pb.CfgInputBufferResponse()


def output_buffer(bench: Bench, request: Any) -> Any:
    task = task_named(bench, request.task.name)
    task.configure()
    task.output_buffer = request.num_samps_per_chan
    return pb.CfgOutputBufferResponse()


_PATTERN: Final = {
    "trigger_source": "DIG_PATTERN_{}_TRIG_SRC",
    "trigger_pattern": "DIG_PATTERN_{}_TRIG_PATTERN",
    "trigger_when": "DIG_PATTERN_{}_TRIG_WHEN",
}
_MULTI_EDGE: Final = {
    "trigger_sources": "ANLG_MULTI_EDGE_{}_TRIG_SRCS",
    "trigger_slope_array": "ANLG_MULTI_EDGE_{}_TRIG_SLOPES",
    "trigger_level_array": "ANLG_MULTI_EDGE_{}_TRIG_LVLS",
}
_TRIGGER_FIELDS: Final[dict[str, tuple[int, dict[str, str]]]] = {
    "CfgDigEdge": (
        triggers.DIGITAL,
        {"trigger_source": "DIG_EDGE_{}_TRIG_SRC", "trigger_edge": "DIG_EDGE_{}_TRIG_EDGE"},
    ),
    "CfgAnlgEdge": (
        triggers.ANALOG,
        {
            "trigger_source": "ANLG_EDGE_{}_TRIG_SRC",
            "trigger_slope": "ANLG_EDGE_{}_TRIG_SLOPE",
            "trigger_level": "ANLG_EDGE_{}_TRIG_LVL",
        },
    ),
    "CfgAnlgWindow": (
        triggers.WINDOW,
        {
            "trigger_source": "ANLG_WIN_{}_TRIG_SRC",
            "trigger_when": "ANLG_WIN_{}_TRIG_WHEN",
            "window_top": "ANLG_WIN_{}_TRIG_TOP",
            "window_bottom": "ANLG_WIN_{}_TRIG_BTM",
        },
    ),
    "CfgDigPattern": (constants.TriggerType.DIGITAL_PATTERN.value, _PATTERN),
    "CfgAnlgMultiEdge": (constants.TriggerType.ANALOG_MULTI_EDGE.value, _MULTI_EDGE),
}


def _trigger_handler(rpc: str, which: str, kind: int, names: dict[str, str]) -> Handler:
    reply = getattr(pb, f"{rpc}Response")

    def configure(bench: Bench, request: Any) -> Any:
        task = task_named(bench, request.task.name)
        task.configure()
        fields = fields_of(request)
        task.trigger[f"{which}_TRIG_TYPE"] = kind
        for field, attribute in names.items():
            value = fields[field]
            task.trigger[attribute.format(which)] = (
                value if isinstance(value, str | int | float) else list(value)
            )
        if "pretrigger_samples" in fields:
            task.trigger["REF_TRIG_PRETRIG_SAMPLES"] = fields["pretrigger_samples"]
        return reply()

    return configure


def _disable_handler(which: str) -> Handler:
    reply = getattr(pb, f"Disable{which.capitalize()}TrigResponse")

    def disable(bench: Bench, request: Any) -> Any:
        task = task_named(bench, request.task.name)
        task.configure()
        task.trigger[f"{which}_TRIG_TYPE"] = triggers.NONE
        return reply()

    return disable


def time_start(bench: Bench, request: Any) -> Any:
    """CfgTimeStartTrig: the task starts at an instant of the wall clock."""
    task = task_named(bench, request.task.name)
    task.configure()
    task.trigger.update(
        START_TRIG_TYPE=constants.TriggerType.TIME.value,
        START_TRIG_TRIG_WHEN=request.when,
        START_TRIG_TIMESCALE=fields_of(request)["timescale"],
    )
    return pb.CfgTimeStartTrigResponse()


_SIGNALS: Final = {
    constants.Signal.SAMPLE_CLOCK.value: "SAMP_CLK",
    constants.Signal.START_TRIGGER.value: "START_TRIG",
    constants.Signal.REFERENCE_TRIGGER.value: "REF_TRIG",
    constants.Signal.AI_CONVERT_CLOCK.value: "AI_CONV_CLK",
    constants.Signal.TEN_MHZ_REF_CLOCK.value: "10_MHZ_REF_CLK",
    constants.Signal.TWENTY_MHZ_TIMEBASE_CLOCK.value: "20_MHZ_TIMEBASE",
    constants.Signal.COUNTER_OUTPUT_EVENT.value: "CTR_OUT_EVENT",
    constants.Signal.CHANGE_DETECTION_EVENT.value: "CHANGE_DETECT_EVENT",
    constants.Signal.ADVANCE_TRIGGER.value: "ADV_TRIG",
    constants.Signal.WATCHDOG_TIMER_EXPIRED_EVENT.value: "WATCHDOG_EXPIRED_EVENT",
}


def export_signal(bench: Bench, request: Any) -> Any:
    """The signal appears at the terminals of a list as well."""
    task = task_named(bench, request.task.name)
    task.configure()
    signal = fields_of(request)["signal_id"]
    if signal not in _SIGNALS:
        raise DaqmxError(Code.INVALID_VALUE, f"Property: DAQmx_ExportSignal\nRequested Value: {signal}")
    task.exported[f"{_SIGNALS[signal]}_OUTPUT_TERM"] = ", ".join(channel_list(request.output_terminal))
    return pb.ExportSignalResponse()


_EVENTS: Final[dict[int, Event]] = {
    constants.TimestampEvent.START_TRIGGER.value: "START_TRIG",
    constants.TimestampEvent.REFERENCE_TRIGGER.value: "REF_TRIG",
    constants.TimestampEvent.ARM_START_TRIGGER.value: "ARM_START_TRIG",
    constants.TimestampEvent.FIRST_SAMPLE.value: "FIRST_SAMP",
}


def wait_for_timestamp(bench: Bench, request: Any) -> Any:
    """UTC of an event; −209842 where its time stamp is not enabled, −200474 when it does not come in time."""
    task = task_named(bench, request.task.name)
    event = _EVENTS[fields_of(request)["timestamp_event"]]
    if not is_stamped(task, event):
        raise DaqmxError(Code.TIMESTAMP_NOT_ENABLED)
    waits_for_edge = task.trigger.get("ARM_START_TRIG_TYPE") == triggers.DIGITAL
    if event == "ARM_START_TRIG" and task.run and not waits_for_edge:
        return pb.WaitForValidTimestampResponse(timestamp=timestamp(bench.utc(task.armed_s)))
    deadline = bench.clock.deadline(request.timeout)
    while (instant := event_instant(task, event)) is None:
        if task.run is not None:
            task.run.look(bench.clock.now())
        elif not task.is_buffered:
            return pb.WaitForValidTimestampResponse(timestamp=timestamp(bench.utc(task.armed_s)))
        if event_instant(task, event) is None and not bench.clock.wait(bench.changed, None, deadline):
            raise DaqmxError(Code.TIMED_OUT)
    return pb.WaitForValidTimestampResponse(timestamp=timestamp(bench.utc(instant)))


def timing_handlers() -> dict[str, Handler]:
    """RPC name → handler."""
    out: dict[str, Handler] = {rpc: _timing_handler(rpc) for rpc in _TYPES}
    for prefix, (kind, names) in _TRIGGER_FIELDS.items():
        for which in ("Start", "Ref"):
            rpc = f"{prefix}{which}Trig"
            out[rpc] = _trigger_handler(rpc, which.upper(), kind, names)
    for which in ("START", "REF"):
        out[f"Disable{which.capitalize()}Trig"] = _disable_handler(which)
    return out | {
        "CfgInputBuffer": input_buffer,
        "CfgOutputBuffer": output_buffer,
        "CfgTimeStartTrig": time_start,
        "ExportSignal": export_signal,
        "WaitForValidTimestamp": wait_for_timestamp,
    }
