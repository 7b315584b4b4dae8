"""What of a run is exported, and how it is walked through in pieces."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from daq_app.runfile.errors import RunFileError
from daq_app.runfile.exporters.results import Decimal, ResultRow, result_rows
from daq_app.runfile.hdf5.read import Run
from daq_app.runfile.model import DerivedData

Units = Literal["raw", "si"]
PIECE_SAMPLES: Final = 65536
"""Samples per channel in memory at a time: 21 MB at 41 channels."""


@dataclass(frozen=True, slots=True)
class DerivedColumn:
    """A signal computed from the readings, one value per sample of the selection; NaN where it is unknown."""

    name: str
    unit: str
    long_name: str
    values: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Selection:
    """Columns [start, stop) of all channels of a run, as readings or in SI."""

    run: Run
    units: Units
    start: int
    stop: int
    report: Callable[[float], None]
    """Told the fraction done from time to time."""
    derived: tuple[DerivedColumn, ...] = ()
    """Rotation, velocity, phase and what else was computed; none where nothing was."""
    results: tuple[ResultRow, ...] = ()
    decimal: Decimal = "point"
    """Decimal sign of text formats: a comma goes with semicolons between columns."""

    @classmethod
    def of(
        cls,
        run: Run,
        units: Units,
        from_s: float | None,
        to_s: float | None,
        report: Callable[[float], None],
        derived: DerivedData | None = None,
        decimal: Decimal = "point",
    ) -> Selection:
        """Columns of the times ``from_s ≤ t < to_s`` of the run's own time axis.

        Raises `RunFileError` if there are none, or if SI is asked of a run without a rig.
        """
        if units == "si" and run.rig is None:
            raise RunFileError(
                f"{run.path} holds no rig that says how to scale its readings",
                advice="Export the readings as they are: --raw.",
            )
        start = 0 if from_s is None else _column(run, from_s)
        stop = run.n_samples if to_s is None else _column(run, to_s)
        if start >= stop:
            low, high = run.first_sample / run.rate_hz, (run.first_sample + run.n_samples) / run.rate_hz
            raise RunFileError(
                f"{run.path}: there are no samples in the time asked for",
                advice=f"The run goes from {low:g} s to {high:g} s.",
            )
        if derived is None:
            return cls(run, units, start, stop, report, decimal=decimal)
        columns = tuple(
            DerivedColumn(
                name, signal.unit, signal.long_name, _on_samples(derived, signal.values, run, start, stop)
            )
            for name, signal in derived.signals.items()
            if name not in run.channel_ids
        )
        rows = tuple(result_rows(derived.results.get("analysis") or {}))
        return cls(run, units, start, stop, report, columns, rows, decimal)

    @property
    def ids(self) -> tuple[str, ...]:
        return self.run.channel_ids

    @property
    def n_samples(self) -> int:
        return self.stop - self.start

    @property
    def channel_units(self) -> tuple[str, ...]:
        """Unit of each channel as exported."""
        if self.units == "raw":
            return self.run.header.reading_units
        rig = self.run.rig
        assert rig is not None
        return tuple(rig.channel(channel_id).si_unit for channel_id in self.ids)

    def values(self, ids: tuple[str, ...], start: int, stop: int) -> NDArray[np.float64]:
        """(len(ids), stop − start) of columns counted from the run's first."""
        return self.run.readings(ids, start, stop) if self.units == "raw" else self.run.si(ids, start, stop)

    def pieces(self) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """(times (m,), values (n_channels, m)) from beginning to end."""
        for start in range(self.start, self.stop, PIECE_SAMPLES):
            stop = min(start + PIECE_SAMPLES, self.stop)
            yield self.run.time_s(start, stop), self.values(self.ids, start, stop)
            self.report((stop - self.start) / self.n_samples)

    def channel_pieces(self, channel_id: str) -> Iterator[NDArray[np.float64]]:
        """One channel from beginning to end."""
        for start in range(self.start, self.stop, PIECE_SAMPLES):
            yield self.values((channel_id,), start, min(start + PIECE_SAMPLES, self.stop))[0]

    def channel_metadata(self, channel_id: str) -> dict[str, Any]:
        """What is known of a channel, JSON-able."""
        header, rig = self.run.header, self.run.rig
        known: dict[str, Any] = {"time_offset_s": header.time_offset_s(channel_id)}
        if rig is not None and channel_id in rig.channel_ids:
            channel = rig.channel(channel_id)
            known |= {
                "family": channel.family,
                "physical_channel": channel.physical_channel,
                "position_m": list(channel.position_m),
                "axis": channel.axis,
                "sensitivity": channel.sensitivity,
                "sensitivity_unit": channel.sensitivity_unit,
                "offset": channel.offset,
                "tare": header.tare.get(channel_id, 0.0),
                "polarity": channel.polarity,
                "certificate": channel.certificate.number,
                "certificate_due": channel.certificate.due.isoformat(),
            }
            if channel.anchor_m is not None:
                known["anchor_m"] = list(channel.anchor_m)
        return known

    def metadata(self) -> dict[str, Any]:
        """What is known of the run, JSON-able: who, when, events and gaps within the selection."""
        run = self.run
        first, last = run.first_sample + self.start, run.first_sample + self.stop
        return {
            "run_id": run.header.run_id,
            "test": run.header.test,
            "specimen": run.header.specimen,
            "rig_name": run.header.rig_name,
            "operator": run.header.test_plan.operator if run.header.test_plan is not None else "",
            "notes": run.header.notes,
            "rate_hz": run.rate_hz,
            "first_sample": first,
            "n_samples": self.n_samples,
            "start_utc_ns": run.header.start_utc_ns,
            "first_row_utc_ns": self._first_row_utc_ns(),
            "raw_sha256": run.attributes.raw_sha256,
            "values": "readings of the NI channels"
            if self.units == "raw"
            else "SI, offset and tare taken off",
            "events": [
                {"sample": e.sample, "kind": e.kind, "text": e.text}
                for e in run.events
                if first <= e.sample < last
            ],
            "gaps": [
                {"first_sample": g.first_sample, "n_samples": g.n_samples, "reason": g.reason}
                for g in run.gaps
                if g.first_sample < last and g.end > first
            ],
        }

    def _first_row_utc_ns(self) -> int:
        """Wall clock at the first sample of the selection; 0 where the run does not know it."""
        started = self.run.header.start_utc_ns
        return started + round(self.start / self.run.rate_hz * 1e9) if started else 0


def _on_samples(
    derived: DerivedData, values: NDArray[np.float64], run: Run, start: int, stop: int
) -> NDArray[np.float64]:
    """Derived values on columns start … stop of the run: straight lines between them, NaN beyond."""
    wanted = run.first_sample + np.arange(start, stop)
    samples = derived.first_sample + derived.step * np.arange(values.size)
    return np.interp(wanted, samples, values, left=np.nan, right=np.nan)


def _column(run: Run, time_s: float) -> int:
    if not np.isfinite(time_s):
        raise RunFileError(f"{time_s} is no time")
    # A time that names a sample must give that sample in spite of rounding.
    sample = int(np.ceil(np.round(time_s * run.rate_hz, 6)))
    return min(max(sample - run.first_sample, 0), run.n_samples)
