"""One case of the blind check as files, with what it hides."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from daq_app.gap.blind.making.case_files import write_case
from daq_app.gap.blind.making.make import Order, case_name, draw_case
from daq_app.runfile import open_run

_RIG = Path(__file__).parents[3] / "configs" / "fr1.toml"


def blind_case(
    folder: Path,
    laboratory: str,
    hidden: str,
    *,
    seed: int,
    runs: int,
    place: int = 0,
    usual: bool = True,
) -> tuple[list[Path], dict[str, float]]:
    """Run files of the case at a place of its order, and the parameters of the effect that it hides.

    The files are sorted by level. A case that hides nothing has no parameters. Without `usual` the wall and
    its amplifiers have nothing of what any wall and rig has of some effects.
    """
    text = _RIG.read_text(encoding="utf-8")
    order = Order(seed, folder / "out", folder / "kept", (text,), runs, None, laboratory, "", hidden)
    world, rig_text, _ = draw_case(order, place)
    name = case_name(place)
    write_case(order.out / name, name, world if usual else replace(world, usual=()), rig_text, 0)
    effects = world.effects
    return sorted((order.out / name).glob("*.h5")), effects[0].parameters if effects else {}


def slippery_base(folder: Path, *, runs: int, place: int) -> tuple[list[Path], float]:
    """Run files of a wall on a base that a contact engine lets slip, and the friction of that base.

    The label has the friction over what a plastic impact of a slender block needs, whose r is 1 − 3/2 sin² α
    (Housner 1963).
    """
    files, hidden = blind_case(folder, "contact", "slippery_base", seed=71, runs=runs, place=place)
    with open_run(files[0]) as run:
        alpha = run.rig.specimen.alpha0_rad
    r = 1.0 - 1.5 * math.sin(alpha) ** 2
    return files, hidden["friction_share"] * (1.0 - r) / ((1.0 + r) * math.tan(alpha))
