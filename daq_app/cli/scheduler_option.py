"""The option of every command whose work other machines can do."""

from __future__ import annotations

from typing import Annotated

import typer

SchedulerOption = Annotated[
    str,
    typer.Option(
        "--scheduler",
        help="Address of a dask scheduler, tcp://HOST:PORT: its workers do the work. They must see the "
        "files under the same paths.",
        show_default="this machine",
    ),
]
