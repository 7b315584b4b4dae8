"""Where a command writes: a file that is named, or a folder that is made if need be."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from daq_app.runfile import RunFileError


@contextmanager
def file_or_folder(out: Path) -> Iterator[Path]:
    """A name without a suffix is a folder, and is made: no file would be found again without one."""
    made = not out.suffix and not out.exists()
    if made:
        try:
            out.mkdir(parents=True)
        except OSError as error:
            raise RunFileError(
                f"the folder {out} cannot be made ({error.strerror or error})", advice="Choose another place."
            ) from error
    try:
        yield out
    except BaseException:
        if made:
            with suppress(OSError):
                out.rmdir()
        raise
