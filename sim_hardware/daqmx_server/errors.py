"""Errors of the simulated NI-DAQmx driver: NI's codes, in NI's style of text."""

from __future__ import annotations

from enum import IntEnum
from typing import Final

from nidaqmx.error_codes import DAQmxErrors, DAQmxWarnings


class Code(IntEnum):
    """The codes that this server raises (NI's numbers, `nidaqmx.error_codes`)."""

    RESOURCE_RESERVED = -50103
    ABORTED = -88710
    INVALID_VALUE = -200077
    MIN_NOT_BELOW_MAX = -200082
    INVALID_TASK = -200088
    PHYSICAL_CHANNEL_UNKNOWN = -200170
    INVALID_DEVICE = -200220
    READ_BUFFER_TOO_SMALL = -200229
    TRIGGER_SOURCE_INVALID = -200265
    SAMPLES_NEVER_AVAILABLE = -200278
    SAMPLES_OVERWRITTEN = -200279
    RELATIVE_TO_REF_TRIG_NOT_DONE = -200281
    NO_REF_TRIGGER = -200282
    SAMPLES_NOT_YET_AVAILABLE = -200284
    REF_TRIGGER_WHEN_CONTINUOUS = -200358
    SAMPLE_RATE_TOO_HIGH = -200332
    DEVICE_ABSENT = -200324
    INVALID_CHANNEL_TYPE = -200430
    MEASUREMENT_TYPE_UNSUPPORTED = -200431
    ATTRIBUTE_UNSUPPORTED = -200452
    READ_NOT_STARTED = -200473
    TIMED_OUT = -200474
    TASK_NOT_RUNNING = -200475
    NO_INPUT_CHANNELS = -200460
    NEGATIVE_SAMPLE = -200277
    NO_CHANNELS = -200478
    TASK_RUNNING = -200479
    CHANNEL_ALREADY_IN_TASK = -200489
    CHANNEL_NOT_IN_TASK = -200486
    PROPERTY_WHILE_RUNNING = -200557
    NOT_DONE = -200560
    EVERY_N_ZERO = -200880
    EVERY_N_MULTIPLE = -200877
    EVERY_N_UNBUFFERED = -200848
    DONE_REGISTERED = -200950
    SIGNAL_REGISTERED = -200949
    EVERY_N_REGISTERED = -200966
    EVENT_WHILE_RUNNING = -200960
    DEVICE_LOST = -201003
    NETWORK_LOST = -201390
    SAMPLES_NOT_YET_WRITABLE = -200292
    DUPLICATE_TASK = -200089
    TASK_NOT_IN_MAX = -200485
    SCALAR_OF_MANY = -200523
    READ_TYPE_MISMATCH = -200525
    EVERY_N_NOT_FOR_INPUT = -200980
    SIGNAL_EVENT_UNSUPPORTED = -200987
    UNITS_NOT_CUSTOM = -200447
    SCALE_UNKNOWN = -200378
    SCALE_ZERO_SLOPE = -200409
    SCALE_PRE_SCALED_EQUAL = -200602
    SCALE_SCALED_EQUAL = -200603
    SCALE_NO_COEFFICIENTS = -200404
    SCALE_TABLE_LENGTHS = -200350
    NO_SYNC = -201426
    NO_DEVICE_CONTEXT = -201118
    SOURCE_TERMINAL_UNKNOWN = -89120
    DESTINATION_TERMINAL_UNKNOWN = -89121
    TRIGGER_ON_DEMAND = -200262
    EVERY_N_OUTPUT_REGISTERED = -200967
    EVERY_N_NOT_FOR_OUTPUT = -200981
    ATTRIBUTE_NOT_SUPPORTED = -200197
    GLOBAL_CHANNEL_UNKNOWN = -200882
    TIMESTAMP_NOT_ENABLED = -209842
    SCALE_ATTRIBUTE = -200601
    TEDS_NOT_DETECTED = -200709
    TEDS_DATA = -200826
    TEDS_NOT_CONFIGURABLE = -200791
    ARRAY_SIZES_DIFFER = -200672
    SHUNT_CALIBRATION = -201493
    NUM_LINES_MISMATCH = -200463
    WRITE_NUM_CHANS_MISMATCH = -200524
    GET_BEFORE_RESERVED = -200983
    TWO_PART_ORDER = -201194
    NOT_YET_WRITTEN = -200292
    NO_MORE_SPACE = -200293
    OUTPUT_UNDERFLOW = -200290
    NO_OUTPUT_CHANNELS = -200459
    NO_MINIMUM = -200694
    NO_MAXIMUM = -200695
    TEE_ROSETTE_GAUGES = -201446
    DELTA_ROSETTE_GAUGES = -201447
    ROSETTE_WITHOUT_QUANTITY = -201448
    RETRIGGER_INVALID = -201320
    LOG_UNBUFFERED = -201299
    NOT_WHILE_LOGGING = -201300
    READ_WHILE_LOGGING = -201301
    FIFO_OVERFLOW = -200361
    NETWORK_NOT_RESERVED = -201388
    NETWORK_RESERVED_BY_OTHER = -201420


_TEXT: Final[dict[int, str]] = {
    Code.RESOURCE_RESERVED: (
        "The specified resource is reserved. The operation could not be completed as specified."
    ),
    Code.ABORTED: ("The operation was aborted because the task was stopped, cleared or aborted."),
    Code.INVALID_VALUE: (
        "Requested value is not a supported value for this property. The property value may be "
        "invalid because it conflicts with another property."
    ),
    Code.MIN_NOT_BELOW_MAX: ("Specified minimum value is greater than or equal to the maximum value."),
    Code.INVALID_TASK: ("Task specified is invalid or does not exist."),
    Code.PHYSICAL_CHANNEL_UNKNOWN: (
        "Physical channel specified does not exist on this device.\n\n"
        "Refer to the documentation for channels available on this device."
    ),
    Code.INVALID_DEVICE: ("Device identifier is invalid."),
    Code.READ_BUFFER_TOO_SMALL: ("Buffer is too small to fit read data."),
    Code.TRIGGER_SOURCE_INVALID: (
        "Source of the trigger is invalid: it is neither a channel of the task nor a terminal of its devices."
    ),
    Code.SAMPLES_NEVER_AVAILABLE: (
        "Attempted to read a sample beyond the final sample acquired. The acquisition has stopped, "
        "therefore the sample specified by the combination of position and offset will never be "
        "available.\n\n"
        "Specify a position and offset which selects a sample up to, but not beyond, the final sample"
        " acquired."
    ),
    Code.SAMPLES_OVERWRITTEN: (
        "The application is not able to keep up with the hardware acquisition.\n"
        "Increasing the buffer size, reading the data more frequently, or specifying a fixed number "
        "of samples to read instead of reading all available samples might correct the problem."
    ),
    Code.RELATIVE_TO_REF_TRIG_NOT_DONE: (
        "Cannot read relative to the reference trigger until the acquisition is done."
    ),
    Code.NO_REF_TRIGGER: (
        "Attempted to read relative to the reference trigger although no reference trigger is configured."
    ),
    Code.SAMPLES_NOT_YET_AVAILABLE: (
        "Some or all of the samples requested have not yet been acquired.\n\n"
        "To wait for the samples to become available use a longer read timeout or read later in your "
        "program. To make the samples available sooner, increase the sample rate. If your task uses a "
        "start trigger, make sure that your start trigger is configured correctly. It is also possible "
        "that you configured the task for external timing, and no clock was supplied. If this is the "
        "case, supply an external clock."
    ),
    Code.REF_TRIGGER_WHEN_CONTINUOUS: (
        "Reference trigger is not supported when the sample mode is continuous."
    ),
    Code.SAMPLE_RATE_TOO_HIGH: (
        "Specified sample rate is higher than the fastest rate supported by the device."
    ),
    Code.DEVICE_ABSENT: ("Device is not available for routing, or it is absent or unavailable."),
    Code.INVALID_CHANNEL_TYPE: (
        "I/O type of the physical channel does not match the I/O type required for the virtual "
        "channel you are creating."
    ),
    Code.MEASUREMENT_TYPE_UNSUPPORTED: (
        "Selected physical channel does not support the measurement type required by the virtual "
        "channel you are creating.\n\n"
        "Create a channel of a measurement type that is supported by the selected physical channel."
    ),
    Code.ATTRIBUTE_UNSUPPORTED: (
        "Specified property is not supported by the device or is not applicable to the task."
    ),
    Code.READ_NOT_STARTED: (
        "Read cannot be performed when the auto start property is false and the task is not running "
        "or committed."
    ),
    Code.TIMED_OUT: ("Specified operation did not complete, because the specified timeout expired."),
    Code.TASK_NOT_RUNNING: ("Specified operation cannot be performed when the task is not running."),
    Code.NO_INPUT_CHANNELS: (
        "Read cannot be performed, because there are no channels in this task from which data can be read."
    ),
    Code.NEGATIVE_SAMPLE: ("Attempted to read a sample before the first sample acquired."),
    Code.NO_CHANNELS: ("Specified operation cannot be performed when there are no channels in the task."),
    Code.TASK_RUNNING: ("Specified operation cannot be performed while the task is running."),
    Code.CHANNEL_ALREADY_IN_TASK: (
        "Specified channel cannot be added to the task, because a channel with the same name is "
        "already in the task."
    ),
    Code.CHANNEL_NOT_IN_TASK: ("Specified channel does not exist in the task."),
    Code.PROPERTY_WHILE_RUNNING: (
        "Specified property cannot be set while the task is running.\n\n"
        "Set the property prior to starting the task, or stop the task prior to setting the property."
    ),
    Code.NOT_DONE: (
        "Wait Until Done did not indicate that the task was done within the specified timeout.\n\n"
        "Increase the timeout, check the program, and make sure the acquisition or generation is "
        "started."
    ),
    Code.EVERY_N_ZERO: ("Every N Samples Event interval must be greater than 0."),
    Code.EVERY_N_MULTIPLE: ("Buffer size must be an integer multiple of the Every N Samples Event interval."),
    Code.EVERY_N_UNBUFFERED: ("Every N Samples Event is not supported for non-buffered tasks."),
    Code.DONE_REGISTERED: ("A Done Event is already registered for this task."),
    Code.SIGNAL_REGISTERED: ("A Signal Event is already registered for this task."),
    Code.EVERY_N_REGISTERED: ("An Every N Samples Event is already registered for this task."),
    Code.EVENT_WHILE_RUNNING: ("DAQmx software event cannot be registered while the task is running."),
    Code.DEVICE_LOST: (
        "Device cannot be accessed.  Possible causes:\n\n"
        "Device is no longer present in the system.\n"
        "Device is not powered.\n"
        "Device is powered, but was temporarily without power.\n"
        "Device is damaged.\n\n"
        "Ensure the device is properly connected and powered. Turn the computer off and on again. If "
        "you suspect that the device is damaged, contact National Instruments at ni.com/support."
    ),
    Code.NETWORK_LOST: (
        "The connection to the network device was lost. Check that the device is powered and "
        "connected to the network."
    ),
    Code.DUPLICATE_TASK: ("Task name specified conflicts with an existing task name."),
    Code.TASK_NOT_IN_MAX: ("Specified task is not in the Data Neighborhood of NI MAX."),
    Code.UNITS_NOT_CUSTOM: (
        "A custom scale is given, but the units of the channel are not From Custom Scale."
    ),
    Code.SCALE_UNKNOWN: "Custom scale specified does not exist.",
    Code.SCALE_ZERO_SLOPE: "Slope of a linear scale cannot be zero.",
    Code.SCALE_PRE_SCALED_EQUAL: "Minimum and maximum of the pre-scaled values cannot be equal.",
    Code.SCALE_SCALED_EQUAL: "Minimum and maximum of the scaled values cannot be equal.",
    Code.SCALE_NO_COEFFICIENTS: "Coefficients of the polynomial scale are not specified.",
    Code.SCALE_ATTRIBUTE: "Specified property is not supported by custom scales of this type.",
    Code.READ_TYPE_MISMATCH: (
        "Read cannot be performed, because this read is for channels of another kind than some of the task."
    ),
    Code.FIFO_OVERFLOW: (
        "Onboard device memory overflow. Because of limits of the system or of its bus, the driver could not "
        "take the samples as fast as the device made them."
    ),
    Code.NETWORK_NOT_RESERVED: "The network device is not reserved by this host: reserve it first.",
    Code.NETWORK_RESERVED_BY_OTHER: (
        "The network device is reserved by another host: unreserve it there, or override the reservation."
    ),
    Code.RETRIGGER_INVALID: "Retriggering needs a finite number of samples.",
    Code.LOG_UNBUFFERED: "Logging needs a task with a sample clock.",
    Code.NOT_WHILE_LOGGING: "Specified property is not supported while logging is enabled.",
    Code.READ_WHILE_LOGGING: (
        "Samples cannot be read in the logging mode Log: they go to the file alone. Use Log and Read."
    ),
    Code.TEE_ROSETTE_GAUGES: "A tee rosette has two strain gauges: give two physical channels.",
    Code.DELTA_ROSETTE_GAUGES: (
        "A rectangular or delta rosette has three strain gauges: give three physical channels."
    ),
    Code.ROSETTE_WITHOUT_QUANTITY: "No quantity is asked for that the rosette is to measure.",
    Code.SCALE_TABLE_LENGTHS: "Table scale has different numbers of pre-scaled and scaled values.",
    Code.ATTRIBUTE_NOT_SUPPORTED: "Specified property is not supported by this device.",
    Code.GLOBAL_CHANNEL_UNKNOWN: "There is no global channel of that name in NI MAX.",
    Code.TIMESTAMP_NOT_ENABLED: "The time stamp of this event is not enabled in the task.",
    Code.SAMPLES_NOT_YET_WRITABLE: (
        "Some of the samples could not be written yet: the buffer and the memory of the device are full, and "
        "the generation has made no room within the time-out."
    ),
    Code.NO_MORE_SPACE: "There is no room for more samples behind the last one of the generation.",
    Code.TWO_PART_ORDER: (
        "Specified property tells which channels or devices are concerned: ask first whether any is, with "
        "the property that ends in Exist or Detected."
    ),
    Code.NO_MINIMUM: "The minimum of the channel is not set, and there is no default for it: set AI.Min.",
    Code.NO_MAXIMUM: "The maximum of the channel is not set, and there is no default for it: set AI.Max.",
    Code.TRIGGER_ON_DEMAND: "A trigger needs a sample clock: the sample timing of the task is On Demand.",
    Code.TEDS_DATA: "The electronic data sheet (TEDS) of the sensor is damaged, or is no data sheet.",
    Code.TEDS_NOT_DETECTED: "No TEDS sensor was detected on the physical channel.",
    Code.NUM_LINES_MISMATCH: (
        "Specified read or write operation failed, because the number of lines in the data for a channel "
        "does not match the number of lines in the channel."
    ),
    Code.WRITE_NUM_CHANS_MISMATCH: (
        "Write cannot be performed, because the number of channels in the data does not match the number "
        "of channels in the task."
    ),
    Code.NOT_YET_WRITTEN: "Some of the samples to generate have not been written yet.",
    Code.NO_SYNC: (
        "Devices of this task cannot be synchronized: they have no clock in common. Use devices of "
        "one chassis, or of chassis on one time-synchronized network."
    ),
}


def error_text(code: int) -> str:
    """NI's sentence for a code; for a code without one, its symbolic name; empty if unknown to NI."""
    if code in _TEXT:
        return _TEXT[code]
    for table in (DAQmxErrors, DAQmxWarnings):
        try:
            name: str = table(code).name
        except ValueError:
            continue
        return name.replace("_", " ").capitalize() + "."
    return ""


class DaqmxError(Exception):
    """An error of the driver.

    `details` are paragraphs such as ``Device Specified: cDAQ9Mod1`` that NI appends to its sentence.
    `samples_read` or `samples_written` is sent along where a read or a write failed half-way.
    """

    def __init__(
        self, code: int, *details: str, samples_read: int | None = None, samples_written: int | None = None
    ) -> None:
        self.code = int(code)
        self.details = details
        self.samples_read = samples_read
        self.samples_written = samples_written
        super().__init__(self.text())

    def text(self, task: str = "") -> str:
        """The extended error text as NI-DAQmx composes it."""
        parts = [error_text(self.code), *self.details]
        if task:
            parts.append(f"Task Name: {task}")
        parts.append(f"Status Code: {self.code}")
        return "\n\n".join(parts)
