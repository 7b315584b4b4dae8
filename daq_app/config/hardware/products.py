"""NI hardware as data: what each chassis, module and card can do.

The facts are in TOML files (`product_data`, read by `product_files`), each with its source.  "GK" marks
general knowledge that is to be confirmed on site; the planner's notes repeat it where a run depends on it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Literal

Bus = Literal["cdaq", "pxie", "pxi", "pcie", "pci", "usb", "testscale"]
Converter = Literal["multiplexed", "simultaneous", "delta_sigma", "slow"]
TerminalConfig = Literal["DIFF", "RSE", "NRSE", "PSEUDO_DIFF"]
Range = tuple[float, float]


@dataclass(frozen=True, slots=True)
class ChassisProduct:
    """A chassis: its slots and how many AI tasks it can time at once."""

    name: str
    bus: Bus
    slots: tuple[int, ...]
    """Slots that take an I/O module."""
    ai_timing_engines: int | None
    """AI tasks with hardware timing at once; None where each module times itself (PXI)."""
    timebase_hz: float
    """Timebase that divides down to the sample clock of SAR modules; 0 where the module has its own."""
    network_synchronised: bool = False
    """Chassis of this kind on one time-synchronised network may share a task."""
    source: str = ""


@dataclass(frozen=True, slots=True)
class DeltaSigma:
    """Data rates ``timebase / divisor / n`` for n in `n_range`, and the lag of the digital filter."""

    timebase_hz: float
    divisor: int
    n_range: tuple[int, int]
    delay_samples: float
    """Input delay is ``delay_samples / rate + delay_s``."""
    delay_s: float


@dataclass(frozen=True, slots=True)
class AnalogOutputs:
    """Analogue outputs of a product."""

    n: int
    bits: int
    ranges_v: tuple[Range, ...]
    ranges_a: tuple[Range, ...]
    max_rate_hz: float


@dataclass(frozen=True, slots=True)
class DigitalPorts:
    """Digital ports of a product."""

    lines: tuple[int, ...]
    """Lines of each port."""
    max_rate_hz: float
    """0 where lines are read and written by software only."""
    input: bool
    output: bool


@dataclass(frozen=True, slots=True)
class Counters:
    """Counters of a product."""

    n: int
    bits: int
    max_rate_hz: float


NO_OUTPUTS: Final = AnalogOutputs(0, 16, (), (), 0.0)
NO_PORTS: Final = DigitalPorts((), 0.0, False, False)
NO_COUNTERS: Final = Counters(0, 32, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Product:
    """A module or card; each is one object, compared by identity. `n_ai` is 0 for one without inputs."""

    name: str
    bus: Bus
    task_family: str
    """Modules of one family (and bus) may share a task."""
    n_ai: int
    converter: Converter
    bits: int
    terminals: Mapping[TerminalConfig, frozenset[int]]
    """Terminal configuration → the ai numbers that have it."""
    ranges_v: tuple[Range, ...]
    """Input ranges, narrowest first."""
    max_rate_hz: float
    """Fastest sample rate of one channel alone."""
    aggregate_rate_hz: float = 0.0
    """Fastest rate summed over a multiplexed module; 0 where each channel has its own converter."""
    timebase_hz: float = 0.0
    """Timebase of a card that makes its own sample clock by division; 0: the chassis' timebase, or exact."""
    delta_sigma: DeltaSigma | None = None
    measurements: frozenset[str] = frozenset({"voltage"})
    """What the inputs measure: ``voltage``, ``iepe``, ``lvdt_native`` and, for the simulator, others."""
    ranges: Mapping[str, tuple[Range, ...]] = field(default_factory=dict)
    """Input ranges by electrical quantity: ``voltage`` (V), ``current`` (A), ``resistance`` (Ω),
    ``bridge`` (V/V), ``charge`` (C)."""
    iepe_currents_a: tuple[float, ...] = ()
    excitation_v: Range = (0.0, 0.0)
    """AC excitation of native LVDT channels, volts rms."""
    excitation_hz: Range = (0.0, 0.0)
    teds: bool = False
    """Whether the module asks its sensors for their data sheets (NI knowledge base on TEDS classes)."""
    external_clock: bool = True
    """Whether the module can take its sample clock from another task."""
    category: str = ""
    """NI's name of the product's category; empty: by the bus."""
    outputs: AnalogOutputs = NO_OUTPUTS
    ports: DigitalPorts = NO_PORTS
    counters: Counters = NO_COUNTERS
    source: str = ""

    @property
    def min_convert_period_s(self) -> float:
        """Shortest time between two conversions of a multiplexed module."""
        return 1.0 / self.aggregate_rate_hz if self.aggregate_rate_hz else 0.0
