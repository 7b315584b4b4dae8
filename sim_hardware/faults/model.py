"""What a fault is: kind, place, time, and its own parameters, checked when it is described."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal

Place = Literal["terminal", "device", "host", "task", "server"]


@dataclass(frozen=True, slots=True)
class ClockChange:
    """Between `start_s` and `end_s` a sample clock runs at `factor` times its rate (0: it stands)."""

    start_s: float
    end_s: float
    factor: float


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of fault: where it sits, its parameters with their defaults, and what it does."""

    place: Place
    does: str
    parameters: Mapping[str, float | str | None] = field(default_factory=dict)
    """Parameter → default; None is "must be given"."""


KINDS: Final[dict[str, Kind]] = {
    "channel_stuck": Kind("terminal", "the voltage stays as it was", {"value_v": math.nan}),
    "channel_saturated": Kind("terminal", "the voltage sits at a rail", {"side": "high"}),
    "channel_open": Kind(
        "terminal", "a wire is off: drift to a rail and mains pick-up", {"drift_s": 0.5, "hum_v": 0.05}
    ),
    "channel_hum": Kind("terminal", "mains hum is added", {"amplitude_v": 0.2, "frequency_hz": 50.0}),
    "channel_swapped": Kind("terminal", "the two wires are swapped", {}),
    "clock_rate": Kind("host", "the sample clock is coerced to another rate", {"rate_hz": None}),
    "clock_drift": Kind("host", "the sample clock runs off its rate", {"ppm": 50.0}),
    "stalled": Kind("host", "no new samples are taken", {}),
    "module_removed": Kind("device", "the module is out of its slot", {}),
    "chassis_offline": Kind("host", "the chassis is off the network", {"tolerance_s": 1.0}),
    "onboard_overflow": Kind("host", "its memory ran over before the network took the samples", {}),
    "network_unreserved": Kind("host", "no computer has reserved the chassis", {}),
    "network_reserved": Kind("host", "another computer has reserved the chassis", {}),
    "strict_logging": Kind("host", "the driver refuses overwriting and seeking while it logs", {}),
    "wrong_device": Kind("device", "another product is in the slot", {"product": None}),
    "reserved": Kind("device", "another program holds the device", {}),
    "buffer_overwritten": Kind("task", "the computer was deaf too long", {"lost_samples": 1000.0}),
    "read_timeout": Kind("task", "a read finds only some samples", {"count": 1.0, "samples": 0.0}),
    "reply_cut_short": Kind("task", "a reply has fewer bytes than it says", {"count": 1.0, "part": "array"}),
    "reply_out_of_order": Kind("task", "two replies are exchanged", {}),
    "server_frozen": Kind("server", "the device server does not answer", {}),
    "server_killed": Kind("server", "the device server is gone", {}),
}
"""Every fault that the simulated hardware can be told to have."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault. Times are seconds of the bench's clock, or a sample index of the first acquisition."""

    kind: str
    target: str = ""
    """Terminal, device, chassis or task name; empty is any task."""
    at_s: float | None = None
    """When it begins; without it and without `at_sample`: now."""
    at_sample: int | None = None
    for_s: float = math.inf
    parameters: Mapping[str, float | str] = field(default_factory=dict)

    @property
    def place(self) -> Place:
        return KINDS[self.kind].place

    def number(self, name: str) -> float:
        return float(self.parameters[name])

    def text(self, name: str) -> str:
        return str(self.parameters[name])


_COMMON: Final = ("kind", "target", "at_s", "at_sample", "for_s")


def fault_from(table: Mapping[str, Any]) -> Fault:
    """A fault of a plain table (script or command). `ValueError` says what is wrong, what is right."""
    name = str(table.get("kind", ""))
    kind = KINDS.get(name)
    if kind is None:
        raise ValueError(f"kind {name!r} is no fault; there are: {', '.join(KINDS)}")
    unknown = sorted(set(table) - set(_COMMON) - set(kind.parameters))
    if unknown:
        allowed = ", ".join([*_COMMON[1:], *kind.parameters])
        raise ValueError(f"{name}: unknown {', '.join(unknown)}; it takes {allowed}")
    target = str(table.get("target", ""))
    if not target and kind.place not in ("task", "server"):
        raise ValueError(f"{name}: target is missing: the {kind.place} it sits at")
    if "at_s" in table and "at_sample" in table:
        raise ValueError(f"{name}: give at_s or at_sample, not both")
    return Fault(
        kind=name,
        target=target,
        at_s=_number(name, "at_s", table["at_s"]) if "at_s" in table else None,
        at_sample=int(_number(name, "at_sample", table["at_sample"])) if "at_sample" in table else None,
        for_s=_number(name, "for_s", table.get("for_s", math.inf)),
        parameters=_parameters(name, kind, table),
    )


def _parameters(name: str, kind: Kind, table: Mapping[str, Any]) -> dict[str, float | str]:
    out: dict[str, float | str] = {}
    for key, default in kind.parameters.items():
        value = table.get(key, default)
        if value is None:
            raise ValueError(f"{name}: {key} is missing")
        if isinstance(default, float) or (default is None and key != "product"):
            value = _number(name, key, value)
        out[key] = value
    if out.get("side", "high") not in ("high", "low"):
        raise ValueError(f"{name}: side is high or low, not {out['side']!r}")
    if out.get("part", "array") not in ("array", "message"):
        raise ValueError(f"{name}: part is array or message, not {out['part']!r}")
    return out


_SIGNED: Final = ("ppm", "value_v", "amplitude_v", "hum_v")


def _number(name: str, key: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{name}: {key} is a number, not {value!r}")
    if value < 0 and key not in _SIGNED:
        raise ValueError(f"{name}: {key} is 0 or more, not {value!r}")
    if not math.isfinite(value) and key not in ("value_v", "for_s"):
        raise ValueError(f"{name}: {key} is a finite number, not {value!r}")
    return float(value)
