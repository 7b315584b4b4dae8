"""`daq-app campaign simulate`: every test of a plan from the simulated wall, without real time."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from daq_app.campaign.plan import Campaign
from daq_app.cli.campaign.progress import DEFAULT_PLAN, open_plan, progress_bar
from daq_app.cli.errors import reported
from daq_app.cli.scheduler_option import SchedulerOption
from daq_app.cli.terminal import Console
from daq_app.config import ConfigError, Problem, load_rig


def simulate(
    out: Annotated[Path, typer.Argument(help="Folder to write the runs into.", metavar="DIR")],
    plan_file: Annotated[Path, typer.Option("--plan", help="Campaign file (TOML).")] = DEFAULT_PLAN,
    r: Annotated[
        list[str] | None,
        typer.Option(help="True r of a specimen, SPECIMEN=R; may be repeated.", show_default="rig files"),
    ] = None,
    test_scatter: Annotated[
        float, typer.Option(min=0, max=0.05, help="Relative scatter of r from test to test.")
    ] = 0.005,
    impact_scatter: Annotated[
        float, typer.Option(min=0, max=0.05, help="Relative scatter of r from impact to impact.")
    ] = 0.004,
    seed: Annotated[int, typer.Option(min=0, help="Decides all that is random.")] = 1,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes.", show_default="all cores")] = None,
    scheduler: SchedulerOption = "",
) -> None:
    """Simulate all tests of a campaign; the truth goes into truth.json beside the runs, not into them.

    Runs that exist already are kept: after an interruption the same command goes on.
    """
    from daq_app.campaign.simulate import CampaignTruth, SpecimenTruth, simulate_campaign

    with reported():
        campaign = open_plan(plan_file)
        given = _given(r or [], campaign)
        specimens = {
            name: SpecimenTruth(given.get(name, _of_rig(campaign, name)), test_scatter, impact_scatter)
            for name in campaign.specimens
        }
        with progress_bar("simulating") as advance:
            runs = simulate_campaign(
                campaign,
                CampaignTruth(specimens, seed),
                out.resolve() if scheduler else out,
                workers=scheduler or workers,
                progress=advance,
            )
        truth = ", ".join(f"{name} r = {own.r:g}" for name, own in specimens.items())
        Console().print(f"{len(runs)} runs in {out} ({truth})", highlight=False, markup=False, soft_wrap=True)


def _of_rig(campaign: Campaign, specimen: str) -> float:
    path = campaign.rig_path(specimen)
    if path is None:
        raise ConfigError(
            [Problem(campaign.name, f"rigs.{specimen}", "no rig file is named", "Name one for each specimen")]
        )
    return load_rig(path).simulation.restitution


def _given(options: list[str], campaign: Campaign) -> dict[str, float]:
    found: dict[str, float] = {}
    problems = []
    for option in options:
        name, _, text = option.partition("=")
        try:
            value = float(text)
        except ValueError:
            value = -1.0
        if name not in campaign.specimens or not 0 < value <= 1:
            right = f"Write SPECIMEN=R, for instance {campaign.specimens[0]}=0.9, with 0 < R ≤ 1"
            problems.append(Problem("--r", option, "is no restitution of a specimen of the plan", right))
        found[name] = value
    if problems:
        raise ConfigError(problems)
    return found
