"""`daq-app campaign`: the plan, what of it is done, and the operator's verdicts."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from daq_app.campaign.names import TestName
from daq_app.campaign.recorded import read_recorded
from daq_app.campaign.status import CampaignStatus, PlaceState
from daq_app.campaign.verdicts import give_place, give_verdict
from daq_app.cli.campaign.progress import DEFAULT_PLAN, open_plan
from daq_app.cli.campaign.record import record
from daq_app.cli.campaign.report import report
from daq_app.cli.campaign.simulate import simulate
from daq_app.cli.errors import reported
from daq_app.cli.help_page import command_group
from daq_app.cli.terminal import Console, echo, echo_json
from daq_app.config import ConfigError, Problem
from daq_app.runfile import RunFileError, open_run

_PlanOption = Annotated[Path, typer.Option("--plan", help="Campaign file (TOML).")]


class _Verdict(StrEnum):
    GOOD = "good"
    BAD = "bad"
    LOST = "lost"


def register(app: typer.Typer) -> None:
    """Add the group ``campaign``."""
    group = command_group("Plan and follow a campaign of tests.")
    group.command("plan", epilog="Example: daq-app campaign plan configs/campaigns/costa.toml")(plan)
    group.command("status", epilog="Example: daq-app campaign status runs --specimen FR1")(status)
    group.command(
        "verdict",
        epilog='Example: daq-app campaign verdict runs/FR1-L3-2.h5 bad --reason "hit a rope"',
    )(verdict)
    group.command("assign", epilog="Example: daq-app campaign assign runs/unarmed_….h5 FR1-L3-2")(assign)
    group.command("record", epilog="Example: daq-app campaign record runs/FR1-L3-2.h5")(record)
    group.command("report", epilog="Example: daq-app campaign report runs --out report")(report)
    group.command("simulate", epilog="Example: daq-app campaign simulate runs --r FR1=0.895 --seed 3")(
        simulate
    )
    app.add_typer(group, name="campaign")


def plan(file: Annotated[Path, typer.Argument(help="Campaign file (TOML).")] = DEFAULT_PLAN) -> None:
    """Show every test of a campaign in its order, with its level."""
    with reported():
        campaign = open_plan(file)
        table = Table(title=f"{campaign.name}: {len(campaign.tests)} tests", title_justify="left")
        for column in ("", "test", "θ0/α", "remark"):
            table.add_column(column, overflow="fold")
        for number, test in enumerate(campaign.tests, start=1):
            remark = "lost in the original campaign" if test.lost_originally else ""
            table.add_row(str(number), str(test.name), f"{test.theta0_over_alpha:.2f}", remark)
        Console().print(table)


def status(
    folder: Annotated[Path, typer.Argument(help="Folder of the runs.")],
    plan_file: _PlanOption = DEFAULT_PLAN,
    specimen: Annotated[str, typer.Option(help="Only this specimen, for instance FR1.")] = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Say what of a campaign is done, what is missing, what must be repeated, and which test is next."""
    with reported():
        campaign = open_plan(plan_file)
        if specimen and specimen not in campaign.specimens:
            wrong = f"`{specimen}` is no specimen of {plan_file}"
            right = f"Specimens: {', '.join(campaign.specimens)}"
            raise ConfigError([Problem("--specimen", specimen, wrong, right)])
        found = CampaignStatus.scan(campaign, folder, read_recorded)
        if as_json:
            echo_json(_as_json(found, specimen))
        else:
            _print_status(found, specimen)


def _print_status(found: CampaignStatus, specimen: str) -> None:
    console = Console()
    table = Table(title=f"Campaign {found.campaign.name}", title_justify="left")
    for column in ("place", "θ0/α", "state", "tests"):
        table.add_column(column, overflow="fold")
    for place in found.places:
        name = place.planned.name
        if specimen in ("", name.specimen):
            tests = "\n".join(
                f"{test.name}: {test.verdict.value}" + (f" ({test.reason})" if test.reason else "")
                for test in place.tests
            )
            table.add_row(str(name), f"{place.planned.theta0_over_alpha:.2f}", place.state.value, tests)
    console.print(table)
    counts = ", ".join(f"{len(found.in_state(state, specimen))} {state.value}" for state in PlaceState)
    console.print(counts, highlight=False)
    for test in found.extra:
        console.print(f"not in the plan: {test.name} ({test.verdict.value})", highlight=False, markup=False)
    proposal = found.next_test(specimen)
    text = f"Next: {proposal.name}, {proposal.reason}" if proposal else "Every planned test is done."
    console.print(text, highlight=False, markup=False, soft_wrap=True)


def _as_json(found: CampaignStatus, specimen: str) -> dict[str, object]:
    proposal = found.next_test(specimen)
    return {
        "campaign": found.campaign.name,
        "counts": {state.value: len(found.in_state(state, specimen)) for state in PlaceState},
        "places": [
            {
                "name": str(place.planned.name),
                "theta0_over_alpha": place.planned.theta0_over_alpha,
                "state": place.state.value,
                "tests": [
                    {
                        "name": str(test.name),
                        "verdict": test.verdict.value,
                        "reason": test.reason,
                        "run": str(test.path) if test.path else None,
                    }
                    for test in place.tests
                ],
            }
            for place in found.places
            if specimen in ("", place.planned.name.specimen)
        ],
        "extra": [str(test.name) for test in found.extra],
        "next": {
            "name": str(proposal.name),
            "theta0_over_alpha": proposal.theta0_over_alpha,
            "reason": proposal.reason,
        }
        if proposal
        else None,
    }


def verdict(
    run_file: Annotated[Path, typer.Argument(help="Run file (.h5).", metavar="RUN")],
    decision: Annotated[_Verdict, typer.Argument(help="What became of the test.", metavar="VERDICT")],
    reason: Annotated[str, typer.Option(help="Why, in words.")] = "",
) -> None:
    """Accept or reject a run by hand (good, bad, lost). The run itself is not changed."""
    with reported():
        with open_run(run_file) as run:
            run_id, test = run.header.run_id, run.header.test
        give_verdict(run_file.parent, run_id, decision.value, reason)
        echo(f"{test or run_id}: {decision.value}" + (f" ({reason})" if reason else ""))


def assign(
    run_file: Annotated[Path, typer.Argument(help="Run file (.h5).", metavar="RUN")],
    test: Annotated[str, typer.Argument(help="The test that it is, for instance FR1-L3-2.", metavar="TEST")],
) -> None:
    """Give a release that nobody had armed its place in the campaign, and make its result.

    The run itself is not changed.
    """
    with reported():
        try:
            name = TestName.parse(test)
        except ValueError as error:
            raise typer.BadParameter(str(error)) from error
        with open_run(run_file) as run:
            run_id, armed_for = run.header.run_id, run.header.test
            if run.header.kept is None:
                raise RunFileError(
                    f"{run_file.name} was armed for {armed_for}",
                    advice="Only a release that nobody had armed is given a place afterwards.",
                )
        give_place(run_file.parent, run_id, str(name))
        echo(f"{run_file.name} counts as {name}")
        from daq_app.campaign.result.result import NoResult, make_result

        try:
            make_result(run_file)
            echo(f"Its result: {run_file.with_suffix('.result.html')} and .pdf")
        except (NoResult, OSError) as error:
            echo(f"No result: {error}")
