"""Plugs of tiltmeters: one axis shows the rotation, the other next to nothing of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from daq_app.gap.rocking_model.features.coefficients import sizes
from daq_app.gap.rocking_model.findings import findings_of
from daq_app.gap.rocking_model.inspection.wiring import mend
from daq_app.gap.rocking_model.records import GapRun, Wiring
from daq_app.gap.rocking_model.study import prepare
from tests.support.gap.conditions import conditions_found
from tests.support.simulated_wall import declared_slow, simulate

LEVELS = (0.25, -0.35)
INSTRUMENT = {"TL-1X": "TL-1Y", "TL-2X": "TL-2Y"}


def _exchanged(runs: list[GapRun], pairs: dict[str, str]) -> list[GapRun]:
    """The runs with these plugs in each other's terminals."""
    made = []
    for run in runs:
        channels = run.channels.copy()
        for a, b in pairs.items():
            at = [run.place(a), run.place(b)]
            channels[at] = run.channels[at[::-1]]
        made.append(replace(run, channels=channels))
    return made


@pytest.mark.parametrize(
    ("pairs", "declared_s"),
    [
        ({"TL-2X": "TL-2Y"}, 0.3),
        ({"TL-2X": "TL-2Y"}, 0.1),
        ({"TL-1X": "TL-2Y"}, 0.3),
        (INSTRUMENT, 0.3),
    ],
)
def test_exchanged_axes_are_put_back_whatever_the_time_constant(
    pairs: dict[str, str], declared_s: float
) -> None:
    sound = simulate({"lag@wire": {"tau": 4e-3}}, LEVELS)
    mended, wiring = mend(declared_slow(_exchanged(sound, pairs), declared_s))
    assert dict(wiring.exchanged) == pairs | {b: a for a, b in pairs.items()}
    assert wiring.reversed_ids == ()
    for run, plain in zip(mended, sound, strict=True):
        np.testing.assert_array_equal(run.channels, plain.channels)


def test_an_exchange_is_named_and_its_axis_is_not_called_crossed() -> None:
    prepared, _ = prepare(_exchanged(simulate({}, LEVELS), {"TL-2X": "TL-2Y"}))
    assert conditions_found(prepared) == {"swap@tiltmeter"}
    (finding,) = findings_of(prepared)
    assert finding.material
    assert "TL-2X and TL-2Y exchanged" in finding.words
    block = next(b for b in prepared[0].blocks if b.family == "tiltmeter")
    gain = float(block.values[block.names.index("gain")])
    assert abs(gain) < 0.01 + sizes()["tiltmeter", "gain"].scatter


def test_of_one_instrument_alone_the_axes_are_told_apart() -> None:
    (run,) = simulate({}, LEVELS[1:])
    kept = [i for i, s in enumerate(run.sensors) if s.family != "tiltmeter" or s.id.startswith("TL-1")]
    alone = replace(
        run,
        sensors=tuple(run.sensors[i] for i in kept),
        channels=run.channels[kept],
        time_offset_s=run.time_offset_s[kept],
    )
    assert mend([alone])[1] == Wiring()
    _, wiring = mend(_exchanged([alone], {"TL-1X": "TL-1Y"}))
    assert dict(wiring.exchanged) == {"TL-1X": "TL-1Y", "TL-1Y": "TL-1X"}


def test_a_reversed_tiltmeter_is_turned_round_and_named() -> None:
    prepared, _ = prepare(simulate({"polarity@TL-1X": {"on": 1.0}}, LEVELS))
    assert conditions_found(prepared) == {"polarity@TL-1X"}


def test_a_dead_axis_or_a_turned_mount_is_no_exchange() -> None:
    (run,) = simulate({}, LEVELS[1:])
    dead, crossed = (run.channels.copy() for _ in range(2))
    dead[run.place("TL-1X")] = dead[run.place("TL-1Y")]
    crossed[run.place("TL-2Y")] += 0.2 * crossed[run.place("TL-2X")]
    for channels in (dead, crossed):
        assert mend([replace(run, channels=channels)])[1] == Wiring()
