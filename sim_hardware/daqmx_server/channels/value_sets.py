"""Values of attributes that take a part of an enum only.

The client has one enum where NI's C header has several (``TriggerType4`` … ``TriggerType10``); the service's
definition lists the values of each part, and NI's header says which attribute takes which.
"""

from __future__ import annotations

import re
from functools import cache
from typing import Final

from nidaqmx._stubs import nidaqmx_pb2

_ENUMS: Final = {
    "Chan": "CHANNEL",
    "Timing": "TIMING",
    "Trig": "TRIGGER",
    "ExportedSignal": "EXPORTSIGNAL",
    "Write": "WRITE",
}
"""Group of attributes → start of the names in the service's definition."""
_PARTS: Final[dict[str, tuple[tuple[str, str], ...]]] = {
    "Chan": (
        (r"AI_TERM_CFG", "INPUT_TERM_CFG"),
        (r"AO_TERM_CFG", "OUTPUT_TERM_CFG"),
        (r"CI_.*_TERM_CFG", "INPUT_TERM_CFG2"),
        (r"C[IO]_OUTPUT_STATE|CO_PULSE_IDLE_STATE|CI_COUNT_EDGES_GATE_WHEN", "LEVEL1"),
        (r"AI_FREQ_UNITS", "FREQUENCY_UNITS"),
        (r"C[IO]_PULSE_FREQ_UNITS", "FREQUENCY_UNITS2"),
        (r"C[IO]_PULSE_TIME_UNITS", "TIME_UNITS2"),
        (r"CI_TIMESTAMP_UNITS", "TIME_UNITS"),
        (r"AI_RVDT_UNITS", "ANGLE_UNITS1"),
        (r"AI_(LVDT|EDDY_CURRENT_PROX_PROBE)_UNITS", "LENGTH_UNITS2"),
        (r"AO_VOLTAGE_UNITS", "VOLTAGE_UNITS2"),
        (r"AI_CURRENT_SHUNT_LOC", "CURRENT_SHUNT_RESISTOR_LOCATION1"),
        (r"AI_CHAN_CAL_SCALE_TYPE", "SCALE_TYPE3"),
        (r"AI_THRMCPL_SCALE_TYPE", "SCALE_TYPE2"),
        (r"AI_BRIDGE_SCALE_TYPE", "SCALE_TYPE4"),
        (r"(AI|AO|CI)_FILTER_DELAY_UNITS", "DIGITAL_WIDTH_UNITS4"),
        (r"AI_DIG_FLTR_RESPONSE", "FILTER_RESPONSE"),
        (r"(AI|CI)_FILTER_RESPONSE", "FILTER_RESPONSE1"),
    ),
    "Timing": (
        (r".*_TIMESCALE", "TIMESCALE2"),
        (r"DELAY_FROM_SAMP_CLK_DELAY_UNITS", "DIGITAL_WIDTH_UNITS2"),
    ),
    "Trig": (
        (r"START_TRIG_TYPE", "TRIGGER_TYPE10"),
        (r"REF_TRIG_TYPE", "TRIGGER_TYPE8"),
        (r"PAUSE_TRIG_TYPE", "TRIGGER_TYPE6"),
        (r"ARM_START_TRIG_TYPE", "TRIGGER_TYPE4"),
        (r"ADV_TRIG_TYPE", "TRIGGER_TYPE5"),
        (r"HSHK_TRIG_TYPE", "TRIGGER_TYPE9"),
        (r".*_COUPLINGS?", "COUPLING2"),
        (r".*_TIMESCALE", "TIMESCALE2"),
        (r"DIG_LVL_PAUSE_TRIG_WHEN|INTERLOCKED_HSHK_TRIG_ASSERTED_LVL", "LEVEL1"),
    ),
    "ExportedSignal": (
        (r"ADV_TRIG_PULSE_WIDTH_UNITS", "DIGITAL_WIDTH_UNITS3"),
        (r"CTR_OUT_EVENT_OUTPUT_BEHAVIOR", "EXPORT_ACTIONS2"),
        (r"SAMP_CLK_OUTPUT_BEHAVIOR", "EXPORT_ACTIONS3"),
        (r"HSHK_EVENT_OUTPUT_BEHAVIOR", "EXPORT_ACTIONS5"),
        (r".*_(INITIAL|IDLE)_STATE|.*_INTERLOCKED_ASSERTED_LVL", "LEVEL1"),
    ),
    "Write": ((r"WAIT_MODE", "WAIT_MODE2"),),
}
"""Group → (attribute, part of its enum)."""


@cache
def part_of(group: str, name: str) -> frozenset[int] | None:
    """The values that an attribute takes of its enum; None where it takes them all."""
    for pattern, part in _PARTS.get(group, ()):
        if re.fullmatch(pattern, name):
            return _values(_ENUMS[group], part)
    return None


def _values(group: str, part: str) -> frozenset[int]:
    wanted = f"{group}_INT32_{part}_"
    enums = nidaqmx_pb2.DESCRIPTOR.enum_types_by_name
    (enum,) = (e for e in enums.values() if e.name.upper() == f"{group}INT32ATTRIBUTEVALUES")
    values = [value.number for value in enum.values if value.name.startswith(wanted)]
    assert values, f"the service's definition has no {wanted}"
    return frozenset(values)
