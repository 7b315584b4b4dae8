"""The root command `daq-app`, and how the groups of commands find their way into it."""

from __future__ import annotations

import importlib
from typing import Final

import typer

_GROUPS: Final = (
    "daq_app.cli.monitor_commands",
    "daq_app.cli.config_commands",
    "daq_app.cli.record_commands",
    "daq_app.cli.campaign_commands",
    "daq_app.cli.analyse_commands",
    "daq_app.cli.theory_commands",
    "daq_app.cli.run_file_commands",
    "daq_app.cli.gap_commands",
    "daq_app.cli.gap_blind_commands",
)
"""Modules with a ``register(app)`` function, in the order of the help page."""


def build_app() -> typer.Typer:
    """The whole command tree."""
    app = typer.Typer(
        name="daq-app",
        rich_markup_mode="rich",
        pretty_exceptions_enable=False,
        help="Record, watch and analyse free-rocking tests of masonry walls.",
    )
    for name in _GROUPS:
        importlib.import_module(name).register(app)
    return app


def main() -> None:
    """Entry point of the console script."""
    build_app()()
