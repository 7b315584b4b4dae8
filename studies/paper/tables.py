"""Every number that the paper's tables print, ours beside it, and a sentence for each that differs.

Ours comes from the shipped rigs and plan alone. Its measured r (Table 4.1) are taken as printed: the
recordings behind them are not published.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from daq_app.campaign.plan import Campaign, load_campaign
from daq_app.config import load_rig
from daq_app.rocking import RigidBlock

CONFIGS: Final = Path(__file__).parents[2] / "configs"
SPECIMENS: Final = ("original", "fr1", "fr2")

_BODIES: Final = {
    "original": (48.2, 3.0, 15426, 1.535, 2.19, 0.213),
    "fr1": (51.3, 2.9, 16107, 1.525, 2.20, 0.215),
    "fr2": (52.8, 2.9, 17652, 1.574, 2.17, 0.208),
}
"""Weight, kN; height, m; inertia about the corner, kg m²; R0, m; p, rad/s; α0, rad."""
_BODY_COLUMNS: Final = (
    ("W, kN", 1), ("height, m", 1), ("I_O, kg m²", 0), ("R0, m", 3), ("p, rad/s", 2), ("α0, rad", 3),
)  # fmt: skip
_PERCENTAGES: Final = {"fr1": (-0.7, 0.5, 0.9), "fr2": (2.5, -0.9, -2.3)}
"""R0, p and α0 against the original, %."""
_TESTS: Final = {
    "FR1": {"L1": 5, "L2": 5, "L3": 5, "L4": 3},
    "FR2": {"L1": 3, "L2": 3, "L3": 3, "L4": 3},
}
"""Tests of each level without the repetitions at the end."""
_REPETITIONS: Final = {"FR1": 3, "FR2": 3}
_ALL_TESTS: Final = 36
_LOST: Final = 6
_RESTITUTION: Final = {
    "fr1": (0.895, 0.96, 0.819, 0.88, 0.931),
    "fr2": (0.931, 1.00, 0.895, 0.96, 0.935),
    "mean": (0.913, 0.98, 0.857, 0.92, 0.933),
}
"""CRT, CRT/r_max, EAV, EAV/r_max, r_max."""

_CUT: Final = (
    "(1.2), which the paper names, gives {ours:.4f}; it prints the block form 1 − 2 m R² sin²α / I_O, "
    "{block:.4f}, cut after the third digit"
)
_P_PRINTED: Final = "p as it is gives {ours:+.2f} %; the paper's follows from its printed p, 2.20/2.19"
_RATIO: Final = "0.931 over (1.2), 0.9360, is {ours:.4f}; over the printed r_max, 0.935, it is 1.00"
_WHY: Final = {
    ("4.1", "fr1, r_max"): _CUT,
    ("4.1", "fr2, r_max"): _CUT,
    ("4.1", "mean, r_max"): _CUT,
    ("3.1", "fr1, p against the original, %"): _P_PRINTED,
    ("4.1", "fr2, CRT/r_max"): _RATIO,
}


@dataclass(frozen=True, slots=True)
class Number:
    """One number of a table."""

    table: str
    what: str
    ours: float
    paper: float
    decimals: int
    """Those that the paper prints."""
    why: str = ""
    """A sentence where it differs."""

    @property
    def differs(self) -> bool:
        """Whether ours, rounded to what is printed, is another number."""
        return self.shown(self.ours) != self.shown(self.paper)

    def shown(self, value: float) -> str:
        """With the paper's decimals."""
        return f"{value:.{self.decimals}f}"


def bodies() -> dict[str, RigidBlock]:
    """The three bodies of Table 3.1."""
    return {name: RigidBlock.from_specimen(load_rig(CONFIGS / f"{name}.toml").specimen) for name in SPECIMENS}


def numbers() -> list[Number]:
    """All numbers of Tables 3.1, 3.2 and 4.1."""
    blocks = bodies()
    return [
        *_table_3_1(blocks),
        *_table_3_2(load_campaign(CONFIGS / "campaigns" / "costa.toml")),
        *_table_4_1(blocks),
    ]


def _number(table: str, what: str, ours: float, paper: float, decimals: int, block: float = 0.0) -> Number:
    why = _WHY.get((table, what), "").format(ours=ours, block=block)
    return Number(table, what, ours, paper, decimals, why)


def _table_3_1(blocks: Mapping[str, RigidBlock]) -> list[Number]:
    """Properties of the bodies, p of W R0 / I_O, and percentages against the original."""
    found = []
    first = blocks["original"]
    for name, block in blocks.items():
        height_m = load_rig(CONFIGS / f"{name}.toml").specimen.height_m
        ours = (
            block.weight_n / 1e3, height_m, block.inertia_kg_m2,
            block.r0_m, block.p_rad_s, block.alpha0_rad,
        )  # fmt: skip
        for (column, decimals), value, paper in zip(_BODY_COLUMNS, ours, _BODIES[name], strict=True):
            found.append(_number("3.1", f"{name}, {column}", value, paper, decimals))
        ratios = {
            "R0": block.r0_m / first.r0_m,
            "p": block.p_rad_s / first.p_rad_s,
            "α0": block.alpha0_rad / first.alpha0_rad,
        }
        for (symbol, ratio), paper in zip(ratios.items(), _PERCENTAGES.get(name, ()), strict=False):
            share = 100.0 * (ratio - 1.0)
            found.append(_number("3.1", f"{name}, {symbol} against the original, %", share, paper, 1))
    return found


def _table_3_2(campaign: Campaign) -> list[Number]:
    """Tests by specimen and level, repetitions, and lost ones."""
    found = []
    for specimen, levels in _TESTS.items():
        own = [test for test in campaign.tests if test.name.specimen == specimen]
        planned = [test for test in own if not test.name.repetition]
        for level, paper in levels.items():
            count = sum(test.name.level == level for test in planned)
            found.append(_number("3.2", f"{specimen}-{level}, tests", count, paper, 0))
        repeated = len(own) - len(planned)
        found.append(_number("3.2", f"{specimen}, repetitions", repeated, _REPETITIONS[specimen], 0))
    lost = sum(test.lost_originally for test in campaign.tests)
    found.append(_number("3.2", "all tests", len(campaign.tests), _ALL_TESTS, 0))
    return [*found, _number("3.2", "data not acquired", lost, _LOST, 0)]


def _table_4_1(blocks: Mapping[str, RigidBlock]) -> list[Number]:
    """r_max by (1.2), the paper's r over it, and the means of the specimens."""
    names = ("fr1", "fr2")
    largest = {name: blocks[name].r_max_rectangular for name in names}
    block_form = {name: blocks[name].r_max for name in names}
    crt = {name: _RESTITUTION[name][0] for name in names}
    eav = {name: _RESTITUTION[name][2] for name in names}
    for column in (largest, block_form, crt, eav):
        column["mean"] = sum(column[name] for name in names) / len(names)
    found = [
        _number("4.1", "mean, CRT", crt["mean"], _RESTITUTION["mean"][0], 3),
        _number("4.1", "mean, EAV", eav["mean"], _RESTITUTION["mean"][2], 3),
    ]
    for name, (_, by_crt, _, by_eav, r_max) in _RESTITUTION.items():
        found += [
            _number("4.1", f"{name}, r_max", largest[name], r_max, 3, block_form[name]),
            _number("4.1", f"{name}, CRT/r_max", crt[name] / largest[name], by_crt, 2),
            _number("4.1", f"{name}, EAV/r_max", eav[name] / largest[name], by_eav, 2),
        ]
    return found
