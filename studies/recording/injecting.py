"""Faults of the simulated devices at random, and which of them explains a gap."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from daq_app.runfile import Gap

_CHASSIS: Final = "cDAQ1"
_SLACK: Final = 8_000
"""Samples: a fault is told to the device some time after the last health message."""
_LOSING: Final = (
    *("buffer_overwritten", "chassis_offline", "module_removed"),
    *("process stopped", "network cut", "server_frozen"),
)
"""Faults after which samples may be missing: the device overwrites what nobody reads in time."""
_SHORTEST_STALL_S: Final = 0.08
"""Of this computer: what lasts less than the 0.05 s of the recorder's clock watch is told as drift."""


@dataclass(slots=True)
class Injected:
    """One fault and what came of it."""

    kind: str
    at_s: float
    arguments: dict[str, float | str]
    sample: int = 0
    """Read when it was injected."""
    heard: list[tuple[float, str, str]] = field(default_factory=list)
    """Seconds after the fault, severity, text."""


def choose_fault(rng: random.Random, speed: float) -> tuple[str, dict[str, float | str], float]:
    """(kind, arguments for the simulated device, how long it lasts in seconds of ours)."""
    kind = rng.choice(
        (
            *("read_timeout", "buffer_overwritten", "reply_cut_short", "reply_out_of_order"),
            *("chassis_offline", "stalled", "server_frozen", "module_removed", "process stopped"),
        )
    )
    bench_s = {
        "chassis_offline": rng.choice((0.2, 0.2, 2.0, 2.0, 20.0)),
        "stalled": rng.uniform(0.3, 3.0) * max(1.0, speed * _SHORTEST_STALL_S / 0.3),
        "module_removed": rng.uniform(1.0, 3.0),
    }.get(kind, 0.0)
    ours_s = {
        "server_frozen": rng.uniform(0.3, 4.0),
        "process stopped": rng.choice((0.5, 3.0, 3.0, 25.0)),
    }.get(kind, bench_s / speed)
    arguments: dict[str, float | str] = {}
    if kind == "read_timeout":
        arguments = {"samples": float(rng.randrange(0, 400)), "count": float(rng.randint(1, 3))}
    elif kind == "buffer_overwritten":
        arguments = {"lost_samples": float(rng.randrange(1, 20_000))}
    elif kind == "reply_cut_short":
        arguments = {"part": rng.choice(("array", "message"))}
    elif kind in ("chassis_offline", "stalled"):
        arguments = {"target": _CHASSIS, "for_s": bench_s}
    elif kind == "module_removed":
        arguments = {"target": f"{_CHASSIS}Mod{rng.randint(1, 4)}", "for_s": bench_s}
    elif kind == "server_frozen":
        arguments = {"for_s": ours_s}
    return kind, arguments, ours_s


def unexplained_gaps(faults: Sequence[Injected], gaps: Sequence[Gap], asleep: Sequence[int]) -> int:
    """Gaps without a fault (or a standstill of the machine) that can have made them."""
    count = 0
    for gap in gaps:
        before = [fault for fault in faults if fault.sample <= gap.end + _SLACK]
        last = before[-1] if before else None
        by_fault = last is not None and last.kind in _LOSING and gap.first_sample >= last.sample - _SLACK
        count += not (by_fault or any(abs(sample - gap.first_sample) < 30 * _SLACK for sample in asleep))
    return count
