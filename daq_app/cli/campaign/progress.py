"""What the commands of a campaign share: the shipped plan and a progress bar."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn

from daq_app.campaign.plan import Campaign, load_campaign
from daq_app.cli.terminal import progress_on_stderr
from daq_app.config.shipped import here_or_shipped

DEFAULT_PLAN: Final = Path("configs/campaigns/costa.toml")


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[[int, int, str], None]]:
    """A bar on stderr, so that stdout stays clean for `--json`; called with (done, total, name)."""
    columns = (
        TextColumn(label),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.description}", markup=False),
        TimeElapsedColumn(),
    )
    with progress_on_stderr(*columns) as bar:
        task = bar.add_task("", total=None)

        def advance(done: int, total: int, name: str) -> None:
            bar.update(task, completed=done, total=total, description=name)

        yield advance


def open_plan(path: Path) -> Campaign:
    """The campaign of a file; the default, where it is not in this folder, is the one that ships.

    Raises `ConfigError`.
    """
    return load_campaign(here_or_shipped(path) if path == DEFAULT_PLAN else path)
