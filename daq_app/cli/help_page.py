"""Help pages in plain text: every command with its whole first sentence.

Without frames and colours nothing of Rich is loaded, which takes longer than everything else of a help page.
"""

from __future__ import annotations

from typing import Any, Final

import typer
from typer.core import TyperGroup

WIDTH: Final = {"max_content_width": 110}
"""Longest line of a help page on a wide terminal, characters."""


class PlainGroup(TyperGroup):
    """A group whose page shows the first sentence of each command, however long it is."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write names and sentences in two columns."""
        commands = ((name, self.get_command(ctx, name)) for name in self.list_commands(ctx))
        rows = [(name, command.get_short_help_str(1000)) for name, command in commands if command is not None]
        with formatter.section("Commands"):
            formatter.write_dl(rows)


def command_group(help: str) -> typer.Typer:
    """A group of commands; without one of them it shows its help page."""
    return typer.Typer(cls=PlainGroup, no_args_is_help=True, help=help, rich_markup_mode=None)
