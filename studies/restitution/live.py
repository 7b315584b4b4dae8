"""``python -m studies.restitution.live --tests 12``: what is told beside r while the wall still rocks.

Sound laboratories, walls that bend, have round edges or are let go slowly, as the recorder analyses
them: zeroed, in blocks of 0.1 s.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from daq_app.config import Rig, Scaling, load_rig
from daq_app.rocking import LiveAnalyser
from daq_app.rocking.live import Estimate
from studies.restitution.faults import Fault
from studies.restitution.laboratory import LaboratoryTest, draw_test
from studies.restitution.walls import SimulatedEffect, ringing_test

RIG: Final = Path(__file__).parents[2] / "configs" / "fr1.toml"
_BLOCK_S: Final = 0.1
_TOLD: Final = {
    "the wall bends": "bending",
    "off the survey's": "survey alpha",
    "give EAV": "wires and LVDTs apart",
    "give CRT": "wires and LVDTs apart",
    "EAV and CRT differ": "EAV and CRT apart",
    "no clean one": "release",
    "are slow": "slow",
    "drift apart": "drift",
    "where a lean to": "side",
    "sticks": "sticking wire",
}
"""What a sentence is counted as, by words in it."""


def round_edges(rig: Rig, seed: int) -> LaboratoryTest:
    """The laboratory of `seed` whose wall rolls on edges with a radius of a tenth of its width."""
    return SimulatedEffect("rounded_edge", {"rho": 0.1}).test(rig, seed)


def slowly_released(rig: Rig, seed: int) -> LaboratoryTest:
    """The laboratory of `seed` whose wall is let go within 100 ms."""
    return SimulatedEffect("slow_release", {"tau": 0.1}).test(rig, seed)


def behind_slow_lvdts(rig: Rig, seed: int) -> LaboratoryTest:
    """The wall of `seed` that bends, whose LVDTs follow like a first order of 20 ms."""
    return Fault("lvdt", "slow", 0.02).test(ringing_test(rig, seed))


def behind_slow_wires(rig: Rig, seed: int) -> LaboratoryTest:
    """The wall of `seed` that bends, whose wires are slow by less than is named."""
    return Fault("wire", "slow", 0.0014).test(ringing_test(rig, seed))


def drifting_wires(rig: Rig, seed: int) -> LaboratoryTest:
    """The laboratory of `seed` with wires whose zeros move by 0.1 mm/s, all of them."""
    return Fault("wire", "drift", 1e-4).test(draw_test(rig, seed))


def sticking_wire(rig: Rig, seed: int) -> LaboratoryTest:
    """The laboratory of `seed` with a wire at the top that has 2 mm of play."""
    return Fault("wire", "sticks", 2e-3, single=4).test(draw_test(rig, seed))


WALLS: Final[dict[str, Callable[[Rig, int], LaboratoryTest]]] = {
    "sound": draw_test,
    "bends": ringing_test,
    "bends, LVDTs slow": behind_slow_lvdts,
    "bends, wires slow": behind_slow_wires,
    "wires drift": drifting_wires,
    "one wire sticks": sticking_wire,
    "round edges": round_edges,
    "slow release": slowly_released,
}


def live_estimates(test: LaboratoryTest) -> list[Estimate]:
    """The estimate after each impact, or after several of one block, while the test runs."""
    readings = Scaling.of(test.rig.channels).to_readings(test.si)
    analyser = LiveAnalyser(test.rig, test.rate_hz, {channel.id: 0.0 for channel in test.rig.channels})
    size = round(_BLOCK_S * test.rate_hz)
    blocks = (
        analyser.process(start, readings[:, start : start + size])
        for start in range(0, readings.shape[1], size)
    )
    return [block.estimate for block in blocks if block.estimate is not None and block.impacts]


def row_of(name: str, tests: Sequence[LaboratoryTest]) -> str:
    """One line: tests with a doubt, the latest impact that brings the first, errors of r, what is told."""
    doubted, latest = 0, 0
    largest = [0.0, 0.0]
    told: Counter[str] = Counter()
    for test in tests:
        estimates = live_estimates(test)
        true_r = test.truth["restitution"]
        for place, found in enumerate((estimates[-1].eav, estimates[-1].crt)):
            if found.r is not None:
                largest[place] = max(largest[place], abs(found.r - true_r))
        impacts = [len(estimate.impact_samples) for estimate in estimates if estimate.doubts]
        doubted += bool(impacts)
        latest = max([latest, *impacts[:1]])
        said = [doubt for estimate in estimates for doubt in estimate.doubts]
        told.update({_kind(doubt) for doubt in said})
    errors = " ".join(f"{error:.4f}" for error in largest)
    return f"{name:18s} {doubted:3d} of {len(tests):<5d} {latest:6d}  {errors}  {dict(told)}"


def _kind(doubt: str) -> str:
    return next((kind for words, kind in _TOLD.items() if words in doubt), doubt)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m studies.restitution.live", description=__doc__)
    parser.add_argument("--tests", type=int, default=12, help="laboratories for each wall")
    parser.add_argument("--first-seed", type=int, default=91000)
    parser.add_argument("--walls", nargs="*", choices=list(WALLS), default=list(WALLS))
    options = parser.parse_args()
    rig = load_rig(RIG)
    print("wall               in doubt     from impact  largest error of r, EAV and CRT; told, tests")
    for name in options.walls:
        tests = [WALLS[name](rig, options.first_seed + place) for place in range(options.tests)]
        print(row_of(name, tests), flush=True)


if __name__ == "__main__":
    main()
