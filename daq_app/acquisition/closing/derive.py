"""Derived signals and results of a run, from its journal: rotation, velocity, θ0, impacts, r, quality."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from daq_app.acquisition.closing.verdict import judge_imported, judge_run
from daq_app.config.rig import Rig
from daq_app.config.scaling import Scaling
from daq_app.plain import plain
from daq_app.rocking.analysis.analyse import analyse_record
from daq_app.rocking.analysis.options import AnalysisOptions
from daq_app.rocking.analysis.results import Series
from daq_app.rocking.live import LiveAnalyser
from daq_app.rocking.record import TestRecord, analysed_part, tare_si
from daq_app.runfile import DerivedData, DerivedSignal, JournalContents
from daq_app.runfile.source import RunSource, rig_of

Floats = NDArray[np.float64]

_WINDOW: Final = 4000
_OPTIONS: Final = AnalysisOptions(fit=False, bias_runs=0)
"""What takes long (simulated bias, fit of the whole motion) waits for `daq-app analyse`."""
_SIGNALS: Final = {
    "rotation_rad": ("rotation", "rad", "rotation of the wall from the wire potentiometers"),
    "velocity_rad_s": ("velocity", "rad/s", "angular velocity, filtered derivative of rotation"),
    "best_rotation_rad": ("rotation_fused", "rad", "rotation of the wall from wires and LVDTs"),
    "neutral_axis_m": ("neutral_axis", "m", "x of zero opening of the base joint"),
    "contact_m": ("contact_length", "m", "length of the base joint in contact"),
    "twist_rad_per_m": ("twist", "rad/m", "change of the joint's rotation along the wall's length"),
}


def derive(contents: JournalContents) -> tuple[DerivedData | None, str]:
    """Derived data, and a sentence where there are none (empty otherwise). Never raises."""
    if contents.n_samples == 0:
        return None, ""
    rig = rig_of(contents.header)
    if rig is None or rig.channel_ids != contents.header.channel_ids:
        return None, "The run's rig file is not understood, so nothing was derived"
    start, stop = analysed_part(contents, contents.header.rate_hz)
    try:
        analysis = analyse_record(_record(contents, rig, start, stop), _OPTIONS)
        online = _online(contents, rig)
    except Exception as error:
        return None, f"The analysis failed ({type(error).__name__}: {error}); the readings are complete"
    results: dict[str, Any] = {"analysis": analysis.as_dict(), "online": online}
    quality = judge_run(contents, analysis)
    if quality is not None:
        results["quality"] = quality
    remark = ""
    if stop - start < contents.n_samples:
        rate_hz = contents.header.rate_hz
        remark = f"Analysed from {start / rate_hz:.0f} s to {stop / rate_hz:.0f} s of this long recording"
    return DerivedData(contents.first_sample + start, _signals(analysis.series), results=results), remark


def derive_imported(run: RunSource) -> DerivedData | None:
    """Derived signals and the verdict of a recording of another program, judged as a recorded one is.

    None where its rig file is not understood. A recording that cannot be analysed gets a verdict that says
    why; a channel of the rig may be missing. Never raises.
    """
    rig = rig_of(run.header)
    if run.n_samples == 0 or rig is None:
        return None
    start, stop = analysed_part(run, run.header.rate_hz)
    try:
        analysis = analyse_record(_record(run, rig, start, stop), _OPTIONS)
    except Exception as error:
        quality = {"verdict": "bad", "reasons": [f"it cannot be analysed: {error}"], "doubtful_channels": []}
        return DerivedData(run.first_sample, {}, results={"quality": quality})
    results = {"analysis": analysis.as_dict(), "quality": judge_imported(run, analysis)}
    return DerivedData(run.first_sample + start, _signals(analysis.series), results=results)


def _record(contents: RunSource, rig: Rig, start: int, stop: int) -> TestRecord:
    header = contents.header
    row = {channel_id: index for index, channel_id in enumerate(header.channel_ids)}

    begin, whole = contents.first_sample + start, stop - start

    def load(ids: tuple[str, ...], start: int = 0, stop: int | None = None) -> Floats:
        """Some channels of what is analysed; the journal is walked through once for each call."""
        rows = [row[channel_id] for channel_id in ids]
        scaling = Scaling.of([rig.channel(channel_id) for channel_id in ids], header.tare)
        first_column, last_column, _ = slice(start, stop).indices(whole)
        si = np.empty((len(rows), max(last_column - first_column, 0)))
        for first, window in contents.windows(_WINDOW):
            at = first - begin - first_column
            low, high = max(at, 0), min(at + window.shape[1], si.shape[1])
            if low < high:
                si[:, low:high] = scaling.to_si(window[rows, low - at : high - at])
        return si

    return TestRecord(
        rig=rig,
        rate_hz=header.rate_hz,
        n_samples=whole,
        channel_ids=tuple(channel_id for channel_id in header.channel_ids if channel_id in rig.channel_ids),
        load=load,
        first_sample=begin,
        time_offsets_s={channel_id: header.time_offset_s(channel_id) for channel_id in header.channel_ids},
        tared=bool(header.tare),
        label=header.test or header.run_id,
        zeros_si=tare_si(rig, header.tare),
        part_of=None if whole == contents.n_samples else contents.n_samples,
    )


def _online(contents: JournalContents, rig: Rig) -> dict[str, Any] | None:
    """What the causal analyser makes of the same samples: it is what the operator saw."""
    analyser = LiveAnalyser(rig, contents.header.rate_hz, contents.header.tare)
    estimate = None
    for first, window in contents.windows(_WINDOW):
        estimate = analyser.process(first, window).estimate or estimate
    return None if estimate is None else plain(estimate.as_message())


def _signals(series: Series | None) -> dict[str, DerivedSignal]:
    if series is None:
        return {}
    return {
        name: DerivedSignal(getattr(series, attribute), unit, long_name)
        for attribute, (name, unit, long_name) in _SIGNALS.items()
    }
