"""Reading a TOML file that a person wrote: text and tables, or a `ConfigError` that says what to do."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any, Final

from daq_app.config.errors import ConfigError, Problem

MAX_BYTES: Final = 4 * 1024 * 1024
"""A configuration is some tens of kilobytes; more is a wrong file (a recording, an image)."""

_MAX_PARTS: Final = 32
"""Parts of a dotted key. Reading one takes a time that grows with the square of their number."""
_PART: Final = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
_LONG_CHAIN: Final = re.compile(rf"""(?<![\w.\-"']){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{_MAX_PARTS},}}+""")
_LINE_IN_MESSAGE = re.compile(r"\s*\(at (?:line (\d+), column (\d+)|end of document)\)$")


def read_text(path: Path | str) -> str:
    """UTF-8 text of a configuration file, without a byte-order mark.

    Raises `ConfigError` when the file is missing, a folder, unreadable, too large or no text.
    """
    path = Path(path)
    file = str(path)
    try:
        if path.is_dir():
            raise _single(file, "is a folder", "Name the TOML file inside it")
        with path.open("rb") as stream:
            data = stream.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise _single(
            file, "does not exist", f"Check the name; the folder is {path.absolute().parent}"
        ) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise _single(
            file, f"cannot be read ({reason})", "Check the path and the rights of the file"
        ) from None
    if len(data) > MAX_BYTES:
        size = path.stat().st_size / 1e6
        raise _single(
            file,
            f"has {size:.1f} MB, and a configuration is never larger than {MAX_BYTES / 1e6:.1f} MB",
            "This is probably a recording: give the TOML file instead",
        )
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise _single(
            file,
            f"is no UTF-8 text (byte {error.start}, line {line})",
            "A rig or campaign file is TOML text; save it as UTF-8",
        ) from None


def parse_toml(text: str, file: str) -> dict[str, Any]:
    """Tables of a TOML text. Raises `ConfigError` with the line of the first fault."""
    chain = _LONG_CHAIN.search(text)
    if chain is not None:
        line = text.count("\n", 0, chain.start()) + 1
        wrong = f"has more than {_MAX_PARTS} names joined by dots on line {line}"
        raise _single(file, wrong, "No key of a rig or campaign is so deep; remove it")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError([_syntax_problem(error, text, file)]) from None
    except (RecursionError, ValueError) as error:
        # Absurd nesting, or a number or date that Python refuses after TOML has let it pass.
        raise _single(file, f"cannot be read as TOML ({error})", "Mend or remove the odd value") from None


def _syntax_problem(error: tomllib.TOMLDecodeError, text: str, file: str) -> Problem:
    message = str(error)
    place = _LINE_IN_MESSAGE.search(message)
    lines = text.splitlines() or [""]
    number = int(place.group(1)) if place and place.group(1) else len(lines)
    what = _LINE_IN_MESSAGE.sub("", message)
    shown = lines[min(number, len(lines)) - 1].strip()[:80]
    column = f", column {place.group(2)}" if place and place.group(2) else ""
    return Problem(
        file,
        f"line {number}{column}",
        f"this is no valid TOML ({what[:1].lower()}{what[1:]}): `{shown}`",
        'TOML wants `key = value`, text in "double quotes", tables as [name] and each sensor as [[channels]]',
    )


def _single(file: str, wrong: str, right: str) -> ConfigError:
    return ConfigError([Problem(file, "the file", wrong, right)])
