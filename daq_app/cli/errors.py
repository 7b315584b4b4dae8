"""How every command fails: one clear paragraph for each problem on stderr, and a meaningful exit code.

Exit codes: 0 good, 1 a check failed or a verdict is bad, 2 bad input or configuration,
3 hardware failure, 130 interrupted.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import typer
from rich.text import Text

from daq_app.cli.terminal import Console
from daq_app.config import ConfigError, Problem
from daq_app.machines import SchedulerMissing
from daq_app.runfile.errors import RunFileError
from drivers.protocol import DriverError

EXIT_FAILED: Final = 1
EXIT_BAD_INPUT: Final = 2
EXIT_HARDWARE: Final = 3
EXIT_INTERRUPTED: Final = 130


def print_paragraph(title: str, body: str, *, style: str = "bold red") -> None:
    """One paragraph on stderr, wrapped to the terminal; brackets in it are text, not markup."""
    text = Text(f"{title}: ", style=style)
    text.append(body, style="default")
    Console(stderr=True).print(text, soft_wrap=not sys.stderr.isatty())


def print_problems(problems: tuple[Problem, ...] | list[Problem]) -> None:
    """A paragraph for each problem of a configuration, and how many there are."""
    for problem in problems:
        print_paragraph("Error", str(problem))
    if len(problems) > 1:
        print_paragraph("Problems", f"{len(problems)} in all; nothing was started")


def say_other_name(asked: Path, written: Path) -> None:
    """A warning where a file could not have the name that was asked for."""
    if written != asked:
        text = f"{asked} is open in another program; the new one is {written.name}"
        print_paragraph("Other name", text, style="bold yellow")


@contextmanager
def reported() -> Iterator[None]:
    """Turn the known failures of a command's body into paragraphs and exit codes.

    Exceptions that nobody expected pass through: they are bugs and want a traceback.
    """
    try:
        yield
    except ConfigError as error:
        print_problems(error.problems)
        raise typer.Exit(EXIT_BAD_INPUT) from None
    except (RunFileError, SchedulerMissing) as error:
        print_paragraph("Error", str(error))
        raise typer.Exit(EXIT_BAD_INPUT) from None
    except DriverError as error:
        print_paragraph("Hardware", str(error))
        raise typer.Exit(EXIT_HARDWARE) from None
    except KeyboardInterrupt:
        print_paragraph("Interrupted", "stopped at your request", style="bold yellow")
        raise typer.Exit(EXIT_INTERRUPTED) from None
    except BrokenPipeError:
        # The reader of our output (head, less) has gone: nothing is wrong here.
        raise typer.Exit(0) from None
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        print_paragraph(
            "Error", f"{where}{error.strerror or error}. Check the path, its rights and free space"
        )
        raise typer.Exit(EXIT_BAD_INPUT) from None
