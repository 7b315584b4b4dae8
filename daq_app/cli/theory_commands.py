"""`daq-app theory`: classic rocking theory of any block."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from daq_app.cli.errors import EXIT_BAD_INPUT, print_paragraph, reported
from daq_app.cli.terminal import Console, echo_json
from daq_app.config import load_rig

if TYPE_CHECKING:
    from daq_app.rocking.theory.block import RigidBlock

_LEVELS = (0.15, 0.25, 0.35, 0.40)


def register(app: typer.Typer) -> None:
    """Add the command ``theory``."""
    app.command("theory", epilog="Example: daq-app theory --rig configs/fr1.toml --phi 0.35 --r 0.895")(
        theory_command
    )


def theory_command(
    rig: Annotated[Path | None, typer.Option(help="Take the block from a rig file.")] = None,
    weight_kn: Annotated[float | None, typer.Option(help="Weight, kN.")] = None,
    inertia: Annotated[float | None, typer.Option(help="Inertia about the base corner, kg m².")] = None,
    radius: Annotated[float | None, typer.Option(help="R, base corner to centre of mass, m.")] = None,
    alpha: Annotated[float | None, typer.Option(help="α, rad.")] = None,
    width: Annotated[float | None, typer.Option(help="Base width of a homogeneous rectangle, m.")] = None,
    height: Annotated[float | None, typer.Option(help="Height of a homogeneous rectangle, m.")] = None,
    mortar_mpa: Annotated[
        float | None, typer.Option(help="Compressive strength of the joint, MPa (2.3).")
    ] = None,
    length: Annotated[float | None, typer.Option(help="Length of the wall, m (2.3).")] = None,
    phi: Annotated[list[float] | None, typer.Option(help="Amplitude φ = θ/α; may be repeated.")] = None,
    r: Annotated[
        float | None, typer.Option(help="Coefficient of restitution; r_max of the block if left out.")
    ] = None,
    impacts: Annotated[int, typer.Option(min=1, max=200, help="Rows of the decay table.")] = 8,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """p, α, r_max (both forms), periods T(φ), the decay T_n and φ_n, and the semi-rigid joint.

    The block is that of a rig file, or weight, inertia, radius and alpha, or a homogeneous rectangle
    (weight, width, height). Values given beside --rig replace those of the rig.
    """
    with reported():
        try:
            block, joint = _block(rig, weight_kn, inertia, radius, alpha, width, height, mortar_mpa, length)
            result = _compute(block, joint, phi or list(_LEVELS), r, impacts)
        except ValueError as error:
            print_paragraph("Error", f"{error}")
            raise typer.Exit(EXIT_BAD_INPUT) from None
        if as_json:
            echo_json(result)
        else:
            _print(result)


def _block(
    rig: Path | None,
    weight_kn: float | None,
    inertia: float | None,
    radius: float | None,
    alpha: float | None,
    width: float | None,
    height: float | None,
    mortar_mpa: float | None,
    length: float | None,
) -> tuple[RigidBlock, tuple[float, float] | None]:
    """The block, and the joint's (strength in Pa, length in m) where both are known."""
    # Imported here, as below: `daq-app --help` should not load SciPy.
    from daq_app.rocking.theory.block import RigidBlock

    specimen = load_rig(rig).specimen if rig is not None else None
    strength = mortar_mpa * 1e6 if mortar_mpa is not None else None
    if specimen is not None:
        strength = strength if strength is not None else specimen.mortar_compressive_strength_pa
        length = length if length is not None else specimen.length_m
    joint = (strength, length) if strength is not None and length is not None else None
    if width is not None or height is not None:
        if specimen is not None or inertia is not None or radius is not None or alpha is not None:
            raise ValueError(
                "--width and --height describe a homogeneous rectangle: give only --weight-kn with them"
            )
        if width is None or height is None or weight_kn is None:
            raise ValueError("a homogeneous rectangle needs --weight-kn, --width and --height")
        return RigidBlock.rectangular(width, height, weight_kn * 1e3), joint
    given = [None if weight_kn is None else weight_kn * 1e3, radius, inertia, alpha]
    if specimen is not None:
        surveyed = RigidBlock.from_specimen(specimen)
        defaults = [surveyed.weight_n, surveyed.r0_m, surveyed.inertia_kg_m2, surveyed.alpha0_rad]
        given = [
            value if value is not None else default for value, default in zip(given, defaults, strict=True)
        ]
    names = ("--weight-kn", "--radius", "--inertia", "--alpha")
    missing = [name for name, value in zip(names, given, strict=True) if value is None]
    if missing:
        raise ValueError(f"{', '.join(missing)} missing: give --rig FILE, or all of {', '.join(names)}")
    values = [float(value) for value in given if value is not None]
    return RigidBlock(*values), joint


def _compute(
    block: RigidBlock, joint: tuple[float, float] | None, phis: list[float], r: float | None, impacts: int
) -> dict[str, Any]:
    from daq_app.rocking import exact_period
    from daq_app.rocking.theory import classic as theory

    p, alpha = block.p_rad_s, block.alpha0_rad
    used = block.r_max_rectangular if r is None else r
    result: dict[str, Any] = {
        "p_rad_s": p,
        "alpha_rad": alpha,
        "base_width_m": block.base_width_m,
        "centroid_height_m": block.centroid_height_m,
        "r_max_rectangular": block.r_max_rectangular,
        "r_max": block.r_max,
        "r": used,
        "levels": [],
        "semi_rigid": None,
    }
    for phi in phis:
        n = range(impacts + 1)
        result["levels"].append(
            {
                "phi": phi,
                "theta_rad": phi * alpha,
                "period_s": float(theory.period(phi, p)),
                "period_nonlinear_s": float(exact_period(phi * alpha, p, alpha)),
                "impact_speed_rad_s": float(theory.impact_speed(phi, p, alpha)),
                "impacts_to_0.005": theory.impacts_until(0.005, phi, used) if used < 1 else None,
                "time_to_0.005_s": theory.time_to_decay(0.005, phi, used, p) if used < 1 else None,
                "phi_n": [float(value) for value in theory.amplitude_after(n, phi, used)],
                "period_n_s": [float(value) for value in theory.period_after(n, phi, used, p)],
            }
        )
    if joint is not None:
        shifted = block.semi_rigid(*joint)
        result["semi_rigid"] = {
            "mortar_strength_pa": joint[0],
            "length_m": joint[1],
            "a_f_m": shifted.a_f_m,
            "a_m": shifted.a_m,
            "r0_m": shifted.r0_m,
            "alpha_rad": shifted.alpha0_rad,
            "inertia_kg_m2": shifted.inertia_kg_m2,
            "p_rad_s": shifted.p_rad_s,
            "r_max": shifted.r_max,
        }
    return result


def _print(result: dict[str, Any]) -> None:
    console = Console()
    block = Table(title="Rigid block", title_justify="left")
    for column in ("quantity", "value", "equation"):
        block.add_column(column, justify="right" if column == "value" else "left")
    block.add_row("p", f"{result['p_rad_s']:.4f} rad/s", "√(W R / I_O)")
    block.add_row("α", f"{result['alpha_rad']:.4f} rad", "")
    block.add_row("base width b", f"{result['base_width_m'] * 1e3:.1f} mm", "2 R sin α")
    block.add_row("r_max, rectangle", f"{result['r_max_rectangular']:.4f}", "1 − 3/2 sin²α (1.2)")
    block.add_row("r_max, this block", f"{result['r_max']:.4f}", "1 − 2 m R² sin²α / I_O")
    if result["semi_rigid"] is not None:
        joint = result["semi_rigid"]
        block.add_section()
        block.add_row("semi-rigid: shift a", f"{joint['a_m'] * 1e3:.1f} mm", "2 a_f = W / (f_m l) (2.3)")
        block.add_row("semi-rigid: α'", f"{joint['alpha_rad']:.4f} rad", "atan((b/2 − a) / h_G)")
        block.add_row("semi-rigid: p'", f"{joint['p_rad_s']:.4f} rad/s", "√(W R' / I')")
        block.add_row("semi-rigid: r_max'", f"{joint['r_max']:.4f}", "1 − 2 m R'² sin²α' / I'")
    console.print(block)
    levels = Table(title=f"Levels, r = {result['r']:.4f}", title_justify="left")
    for column in (
        "φ0 = θ0/α",
        "θ0 mrad",
        "T s (4.1)",
        "T s nonlinear",
        "θ̇ at impact rad/s",
        "impacts to φ < 0.005",
        "in s",
    ):
        levels.add_column(column, justify="right")
    for level in result["levels"]:
        count, time = level["impacts_to_0.005"], level["time_to_0.005_s"]
        levels.add_row(
            f"{level['phi']:g}",
            f"{level['theta_rad'] * 1e3:.1f}",
            f"{level['period_s']:.3f}",
            f"{level['period_nonlinear_s']:.3f}",
            f"{level['impact_speed_rad_s']:.4f}",
            "never" if count is None else str(count),
            "" if time is None else f"{time:.2f}",
        )
    console.print(levels)
    decay = Table(title="Decay: φ_n (4.3) | T_n in s (4.2)", title_justify="left")
    decay.add_column("impact n", justify="right")
    for level in result["levels"]:
        decay.add_column(f"φ0 = {level['phi']:g}", justify="right")
    for n in range(len(result["levels"][0]["phi_n"])):
        cells = [f"{level['phi_n'][n]:.4f} | {level['period_n_s'][n]:.3f}" for level in result["levels"]]
        decay.add_row(str(n), *cells)
    console.print(decay)
