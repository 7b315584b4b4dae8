"""Where the simulated server behaves otherwise than NI's hardware; the page on it prints this."""

from __future__ import annotations

from typing import Final

LIMITS: Final = (
    (
        "attributes that only some devices have",
        "are refused (−200452) by what the product measures and how it converts; NI's metadata names "
        "no devices, so where neither tells anything every channel of the kind has the attribute",
    ),
    (
        "status attributes of reads (open channels, overcurrent, faults of excitation or supply …)",
        "tell that there is nothing; overloads are told where converters are delta-sigma",
    ),
    (
        "PFI terminals of a chassis",
        "every number is accepted, whatever sockets the chassis has",
    ),
    (
        "handshaking and burst timing",
        "are kept as settings; samples come at the rate of the task",
    ),
    (
        "change detection",
        "samples at the changes of lines of a device named with `--real`, and at edges that the "
        "control service gives to a line; on a simulated device, whose lines count, at 1000 Hz or the "
        "rate that was set",
    ),
    (
        "counter inputs with implicit timing",
        "hold one period after the other, but become available at 1000 Hz or the rate that was set",
    ),
    (
        "retriggering",
        "for analogue and digital inputs; outputs and counters keep the setting",
    ),
    (
        "pause trigger",
        "a digital level holds the sample clock (that of the edges which the control service gives; "
        "low at first), or an analogue level or window of a channel of the task",
    ),
    (
        "time start trigger, time of the first sample, time of the sync pulse",
        "starts at that time of the machine's clock; at once where it has passed",
    ),
    (
        "rosettes, temperatures, other quantities that are not proportional to a voltage",
        "show a sine in their own unit; a rosette does not compute them from its gauges",
    ),
    (
        "outputs without regeneration",
        "fill up (−200293, −200292), but do not stop where no new samples come: the last one stays",
    ),
    (
        "counter outputs with a buffer of pulses",
        "put out what was written before the start, again and again; a write while they run lets its "
        "last pulse go on",
    ),
    (
        "sensors' data sheets (TEDS)",
        "templates 25, 27, 30 to 33 and 36 to 38 are read; of strain gauges (35) a channel keeps the "
        "values of its call",
    ),
)
"""(What, what the server does with it.)"""
