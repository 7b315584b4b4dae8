"""``python -m studies.paper``: Tables 3.1, 3.2 and 4.1 and the equations, ours beside the paper's.

A sentence stands under each number that differs.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby

from daq_app.config import load_rig
from daq_app.rocking import RigidBlock, amplitude_after, period, period_after, restitution_from_peaks
from studies.paper.tables import CONFIGS, Number, bodies, numbers


def table(name: str, rows: Iterable[Number]) -> list[str]:
    """A line for each number, and its sentence where it differs."""
    lines = [f"Table {name:35s} {'ours':>10s} {'paper':>8s}"]
    for row in rows:
        decimals = row.decimals and row.decimals + 2
        lines.append(f"  {row.what:39s} {row.ours:10.{decimals}f} {row.shown(row.paper):>8s}")
        if row.differs:
            lines.append(f"    differs: {row.why}")
    return lines


def equations(body: RigidBlock) -> list[str]:
    """One number of each closed form, and of the semi-rigid joint."""
    specimen = load_rig(CONFIGS / "fr1.toml").specimen
    joint = body.semi_rigid(specimen.mortar_compressive_strength_pa, specimen.length_m)
    phi, r = 0.35, 0.895
    phi_3 = float(amplitude_after(3, phi, r))
    return [
        "Equations, FR1, φ0 = 0.35, r = 0.895",
        f"  (4.1) T = {float(period(phi, specimen.p_rad_s)):.4f} s",
        f"  (4.2) T_3 = {float(period_after(3, phi, r, specimen.p_rad_s)):.4f} s",
        f"  (4.3) φ_3 = {phi_3:.4f}",
        f"  (4.5) r from φ0 and φ_3 = {float(restitution_from_peaks(phi, phi_3, 3)):.4f}",
        f"  (2.3) a = {joint.a_m * 1e3:.1f} mm for a wall length of {specimen.length_m:g} m (assumed):",
        "  the paper gives none, and a is inversely proportional to it.",
    ]


def main() -> None:
    """Print everything."""
    parts = [table(name, rows) for name, rows in groupby(numbers(), key=lambda row: row.table)]
    parts.append(equations(bodies()["fr1"]))
    print("\n\n".join("\n".join(part) for part in parts))


if __name__ == "__main__":
    main()
