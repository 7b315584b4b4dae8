"""A diagnosis as it would come out, put together by hand: reports are tested without minutes of fitting."""

from __future__ import annotations

from daq_app.gap.core import Diagnosis
from daq_app.gap.core.fitting.held_out import GapSize
from daq_app.gap.core.judging.evidence import Ranked
from daq_app.gap.core.judging.remainder import GroupRest, Remainder
from daq_app.gap.core.judging.where import Cell, GapMap
from daq_app.gap.core.result import Cause, Decision, Detection, Estimate

NOMINAL = {"alpha": (0.215, "rad"), "p": (2.2021, "rad/s"), "r": (0.9, "1"), "half_base": (0.3254, "m")}


def cell(channel: str, phase: str, observable: str, in_noise: float) -> Cell:
    return Cell(channel, phase, observable, "all", "s", 20, 1e-3, in_noise, 2 * in_noise, 0.8, 0.1, 0.4)


def diagnosis(effects: dict[str, float], runs: tuple[str, ...], **parameters: float) -> Diagnosis:
    """`effects`: ``viscous.zeta`` → value. `parameters` go over the nominal ones."""
    names = tuple(dict.fromkeys(key.rpartition(".")[0] for key in effects))
    which = (
        Ranked(names, "dissipation", 0.98, 512.0),
        Ranked(("coulomb",), "dissipation", 0.02, 470.3),
        Ranked((), "none", 0.0, -31.0),
    )
    cells = (
        cell("lvdt", "swing", "fall time 1", 9.0),
        cell("lvdt", "peak", "time over the top", 4.0),
        cell("wire", "run", "gain", 0.9),
    )
    verdict = "effect" if names else "parameters"
    sentence = (
        f"{' + '.join(names) or 'other parameters'} <explains> the gap & more, probability 0.98 (σ ≤ 1 %)."
    )
    gap = GapSize(
        9.1, 1.05, 1.0, 0.98, (8.0, 10.0), (1.0, 1.1), 400.0, {"L1": (6.0, 1.1), "L4": (11.0, 1.0)}, {}
    )
    rest = Remainder(9.1, 9.1, 1.02, 0.0, 0.0, (GroupRest("lvdt", "fall time 1", 40, 0.1, 1.1, 0.0),), 0.02)
    values = {name: (parameters.get(name, value), unit) for name, (value, unit) in NOMINAL.items()}
    strengths = tuple(
        Estimate(key, value, 0.9 * value, 1.1 * value, "1", 0.0, 0.01, "strength")
        for key, value in effects.items()
    )
    return Diagnosis(
        model="free rocking",
        runs=runs,
        where=GapMap(cells, "The gap lies in the falls of the swings."),
        which=which,
        set95=which[:1],
        decision=Decision(verdict, names, "dissipation", sentence, 0.98),
        parameters=tuple(
            Estimate(name, value, 0.99 * value, 1.01 * value, unit, value, 0.02 * value, "as surveyed")
            for name, (value, unit) in values.items()
        ),
        effect_parameters=strengths,
        causes=tuple(
            Cause(
                name,
                "a cause",
                "dissipation",
                0.98,
                tuple(e for e in strengths if e.name.startswith(f"{name}.")),
                0.97,
                True,
            )
            for name in names
        ),
        scatter=(Estimate("scatter of r", 0.004, float("nan"), float("nan"), "1", 0.004, 0.7),),
        gap=gap,
        remaining=GapMap((cell("lvdt", "swing", "fall time 1", 1.0),), "Nothing stands out."),
        rest=rest,
        probes=(Ranked(("free_restitution",), "restitution", 0.0, 300.0),),
        probe_shapes={
            "free_restitution": {
                f"free_restitution.k{i}": (0.01 * i, 0.01 * i - 0.004, 0.01 * i + 0.004) for i in range(5)
            },
            "free_wire": {"free_wire.c0": (0.2, 0.1, 0.3), "free_wire.c1": (0.0, -0.2, 0.2)},
        },
        detection=(Detection("viscous", "zeta", 2e-4, "1"),),
        next_measurement="Repeat at another level to confirm the parameter.",
        limits=("One level only: <stated>.",),
        seconds=12.3,
    )
