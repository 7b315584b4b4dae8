"""NI hardware as data: what each chassis and analogue-input module can do.

Sources are named per product.  "GK" marks general knowledge that is to be confirmed on site; the
planner's notes repeat it where a run depends on it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal

Bus = Literal["cdaq", "pxie"]
Converter = Literal["multiplexed", "simultaneous", "delta_sigma", "slow"]
TerminalConfig = Literal["DIFF", "RSE", "NRSE", "PSEUDO_DIFF"]
Measurement = Literal["voltage", "iepe", "lvdt_native"]
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


@dataclass(frozen=True, slots=True, eq=False)
class Product:
    """An analogue-input module or card; each is one object, compared by identity."""

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
    measurements: frozenset[Measurement] = frozenset({"voltage"})
    iepe_currents_a: tuple[float, ...] = ()
    excitation_v: Range = (0.0, 0.0)
    """AC excitation of native LVDT channels, volts rms."""
    excitation_hz: Range = (0.0, 0.0)
    external_clock: bool = True
    """Whether the module can take its sample clock from another task."""
    source: str = ""

    @property
    def min_convert_period_s(self) -> float:
        """Shortest time between two conversions of a multiplexed module."""
        return 1.0 / self.aggregate_rate_hz if self.aggregate_rate_hz else 0.0


def _same(configs: tuple[TerminalConfig, ...], n: int) -> Mapping[TerminalConfig, frozenset[int]]:
    every = frozenset(range(n))
    return MappingProxyType(dict.fromkeys(configs, every))


def _mux(n: int) -> Mapping[TerminalConfig, frozenset[int]]:
    """DIFF pairs ai(k) with ai(k+8) in each group of 16, so only the first eight of a group have it."""
    every = frozenset(range(n))
    return MappingProxyType(
        {"DIFF": frozenset(k for k in range(n) if k % 16 < 8), "RSE": every, "NRSE": every}
    )


def _pm(*limits: float) -> tuple[Range, ...]:
    return tuple((-limit, limit) for limit in sorted(limits))


_FILTER_40: Final = 40 + 5 / 512
"""Samples of lag of the older C Series delta-sigma filters (NI 9237: knowledge base on its input delay)."""


def _scanned(name: str, n: int, bits: int, rate: float, ranges: tuple[Range, ...], source: str) -> Product:
    return Product(
        name, "cdaq", "C Series", n, "multiplexed", bits, _mux(n), ranges, rate, rate, source=source
    )


def _sar(name: str, n: int, bits: int, rate: float, source: str) -> Product:
    return Product(
        name, "cdaq", "C Series", n, "simultaneous", bits, _same(("DIFF",), n), _pm(10), rate, source=source
    )


def _sigma(
    name: str,
    n: int,
    limit_v: float,
    clock: DeltaSigma,
    source: str,
    *,
    iepe: bool = False,
    config: TerminalConfig = "DIFF",
) -> Product:
    return Product(
        name,
        "cdaq",
        "C Series",
        n,
        "delta_sigma",
        24,
        _same((config,), n),
        _pm(limit_v),
        clock.timebase_hz / clock.divisor / clock.n_range[0],
        delta_sigma=clock,
        measurements=frozenset({"voltage", "iepe"} if iepe else {"voltage"}),
        iepe_currents_a=(0.002,) if iepe else (),
        external_clock=False,
        source=source,
    )


def _x_series(name: str, n: int, single_hz: float, aggregate_hz: float) -> Product:
    return Product(
        name,
        "pxie",
        "MIO X Series",
        n,
        "multiplexed",
        16,
        _mux(n),
        _pm(0.1, 0.2, 0.5, 1, 2, 5, 10),
        single_hz,
        aggregate_hz,
        timebase_hz=100e6,
        source="X Series user manual, table of analogue-input rates; ranges GK",
    )


_SPEC: Final = "NI specifications of the module"
_C_MODULES: Final = (
    _scanned("NI 9205", 32, 16, 250e3, _pm(0.2, 1, 5, 10), f"{_SPEC}; 250 kS/s and DIFF terminals confirmed"),
    _scanned("NI 9206", 32, 16, 250e3, _pm(0.2, 1, 5, 10), f"{_SPEC} (GK)"),
    Product(
        "NI 9201", "cdaq", "C Series", 8, "multiplexed", 12, _same(("RSE",), 8), _pm(10), 500e3, 500e3,
        source=f"{_SPEC} (GK)",
    ),
    _sar("NI 9215", 4, 16, 100e3, f"{_SPEC} (GK)"),
    _sar("NI 9220", 16, 16, 100e3, f"{_SPEC} (GK)"),
    _sar("NI 9222", 4, 16, 500e3, f"{_SPEC} (GK)"),
    _sar("NI 9223", 4, 16, 1e6, f"{_SPEC} (GK)"),
    _sigma(
        "NI 9229", 4, 60.0, DeltaSigma(12.8e6, 256, (1, 31), _FILTER_40, 3.3e-6),
        "NI 9229/9239 operating instructions (rates); delay GK",
    ),
    _sigma(
        "NI 9239", 4, 10.0, DeltaSigma(12.8e6, 256, (1, 31), _FILTER_40, 3.3e-6),
        "NI 9229/9239 operating instructions (rates); delay GK",
    ),
    _sigma(
        "NI 9233", 4, 5.0, DeltaSigma(12.8e6, 256, (1, 25), 12.8, 0.0),
        "NI specifications (rates GK, delay 12.8/fs)", iepe=True, config="PSEUDO_DIFF",
    ),
    _sigma(
        "NI 9234", 4, 5.0, DeltaSigma(13.1072e6, 256, (1, 31), _FILTER_40, 2.6e-6),
        "NI USB-9234 user guide (rates, IEPE); delay as NI 9237 (GK)", iepe=True, config="PSEUDO_DIFF",
    ),
    Product(
        "NI 9237", "cdaq", "C Series", 4, "delta_sigma", 24, _same(("DIFF",), 4), _pm(0.025), 50e3,
        delta_sigma=DeltaSigma(12.8e6, 256, (1, 31), _FILTER_40, 4.5e-6),
        measurements=frozenset(), external_clock=False,
        source="NI knowledge base, input delay of the NI 9237; a bridge module, ranges in V/V",
    ),
    Product(
        "NI 9209", "cdaq", "C Series", 32, "slow", 24, _mux(32), _pm(10), 500.0, 500.0,
        source=f"{_SPEC} (GK)",
    ),
    Product(
        "NI 9219", "cdaq", "C Series", 4, "slow", 24, _same(("DIFF",), 4), _pm(0.125, 1, 4, 15, 60), 100.0,
        source=f"{_SPEC} (GK)",
    ),
)  # fmt: skip
_PXI_MODULES: Final = (
    _x_series("PXIe-6341", 16, 500e3, 500e3),
    _x_series("PXIe-6345", 80, 500e3, 500e3),
    _x_series("PXIe-6355", 80, 1.25e6, 1e6),
    _x_series("PXIe-6361", 16, 2e6, 1e6),
    _x_series("PXIe-6363", 32, 2e6, 1e6),
    _x_series("PXIe-6365", 144, 2e6, 1e6),
    Product(
        "PXIe-4340",
        "pxie",
        "SC Express",
        4,
        "delta_sigma",
        24,
        _same(("DIFF",), 4),
        _pm(1, 10),
        25.6e3,
        measurements=frozenset({"lvdt_native"}),
        excitation_v=(1.0, 7.0),
        excitation_hz=(250.0, 10e3),
        external_clock=False,
        source="PXIe-4340 user manual (filter delay compensated); ranges, rate and excitation GK",
    ),
)

MODULES: Final[Mapping[str, Product]] = MappingProxyType({p.name: p for p in _C_MODULES + _PXI_MODULES})
"""Product name → module."""


def _cdaq(name: str, slots: int, *, engines: int = 3, network: bool = False) -> ChassisProduct:
    return ChassisProduct(
        name,
        "cdaq",
        tuple(range(1, slots + 1)),
        engines,
        80e6,
        network_synchronised=network,
        source="NI CompactDAQ user manual: three AI timing engines in a chassis of several slots; 80 MHz GK",
    )


def _pxie(name: str, slots: int) -> ChassisProduct:
    return ChassisProduct(
        name, "pxie", tuple(range(2, slots + 1)), None, 0.0, source="NI PXI Express chassis manual (GK)"
    )


CHASSIS: Final[Mapping[str, ChassisProduct]] = MappingProxyType(
    {
        chassis.name: chassis
        for chassis in (
            _cdaq("cDAQ-9171", 1, engines=1),
            _cdaq("cDAQ-9174", 4),
            _cdaq("cDAQ-9178", 8),
            _cdaq("cDAQ-9179", 14),
            _cdaq("cDAQ-9184", 4),
            _cdaq("cDAQ-9185", 4, network=True),
            _cdaq("cDAQ-9188", 8),
            _cdaq("cDAQ-9189", 8, network=True),
            _pxie("PXIe-1071", 4),
            _pxie("PXIe-1078", 9),
            _pxie("PXIe-1082", 8),
            _pxie("PXIe-1085", 18),
            _pxie("PXIe-1092", 10),
        )
    }
)
"""Product name → chassis."""
