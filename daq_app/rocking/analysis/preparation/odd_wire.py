"""The one wire that does not show what the others do, if there is one."""

from __future__ import annotations

from daq_app.rocking.analysis.preparation.signals import Signals
from daq_app.rocking.families import words
from daq_app.rocking.families.channels.compared_channels import (
    ChannelMeans,
    ComparedChannels,
    compare_channels,
)
from daq_app.rocking.families.channels.hysteresis import sticking_wire
from daq_app.rocking.families.finding import FamilyFinding


def wire_means(signals: Signals, motion: slice) -> ChannelMeans | None:
    """What each wire shows during the samples of the motion; None where they are too few to judge one."""
    if len(signals.excluded_share) > 1:
        return None  # they are named already, and the rest is no judge
    of_each_wire = signals.geometry.wires.rotation_of_each(signals.wires_m[:, motion])
    return ChannelMeans.of(of_each_wire, signals.record.rate_hz)


def compared_wires(signals: Signals, means: ChannelMeans | None) -> ComparedChannels | None:
    """How each wire deviates from the others; None where none can tell."""
    wires = signals.geometry.wires
    return None if means is None else compare_channels(means, wires.position_m[:, 1] / wires.lever_m)


def odd_wire(
    signals: Signals,
    means: ChannelMeans | None,
    compared: ComparedChannels | None,
    *,
    bends: bool,
    turns: bool,
) -> FamilyFinding | None:
    """The wire that is to be left out, and why.

    A wall that `bends` pulls wires of each height otherwise, and one that `turns` about the vertical those
    beside its middle. Sticking comes first, for it also looks like a delay.
    """
    wires = signals.geometry.wires
    if means is not None and not bends:
        sticking = sticking_wire(means.means_rad, wires.lever_m, wires.noise_m)
        if sticking is not None:
            return words.sticks(wires.ids[sticking[0]], sticking[1].width_m)
    outlier = None if compared is None else compared.outlier()
    if compared is None or outlier is None:
        return None
    place, kind = outlier
    if turns and kind == "drift" and wires.position_m[place, 1] != 0.0:
        return None
    return words.single_wire(wires.ids[place], kind, compared, place)
