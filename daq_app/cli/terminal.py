"""The terminal: what is printed is text, whoever wrote it, without commands or markup of its own."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Final

import rich.console
import typer
from rich.segment import Segment

from daq_app.config.shown_text import has_picture, visible

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn

_STRING: Final = re.compile(r'"(?:[^"\\]|\\.)*"')


class Console(rich.console.Console):
    """Rich's, without markup and emoji names in strings; characters without a picture show as their code."""

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, **options)

    def render(
        self,
        renderable: rich.console.RenderableType,
        options: rich.console.ConsoleOptions | None = None,
    ) -> Iterable[Segment]:
        """As Rich does; colours and cursor are added to the text only afterwards."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(visible(segment.text), segment.style)


def progress_on_stderr(*columns: ProgressColumn | str) -> Progress:
    """A bar that goes away again, so that standard output is clean; none in a file or pipe."""
    from rich.progress import Progress

    console = Console(stderr=True)
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)


def echo(text: object) -> None:
    """A line on standard output."""
    typer.echo(visible(str(text)))


def echo_json(document: object, *, indent: int | None = None) -> None:
    """Strict JSON on standard output: characters without a picture are escaped as JSON does."""
    text = json.dumps(document, ensure_ascii=False, allow_nan=False, indent=indent)
    typer.echo(_STRING.sub(_escaped, text))


def _escaped(string: re.Match[str]) -> str:
    return "".join(c if has_picture(c) else json.dumps(c)[1:-1] for c in string[0])
