"""A study of many cases that can be interrupted: one JSON per case, a page from all that there are."""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

Found = dict[str, Any]


def run_study(
    about: str,
    cases: Sequence[str],
    do: Callable[[str, argparse.Namespace], Found],
    say: Callable[[Found], str],
    page: Callable[[list[Found]], str],
    folder: Path,
    arguments: Sequence[str] | None = None,
) -> int:
    """Do the cases whose JSON is not there yet, then write the page. Returns the exit code."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=about, formatter_class=raw)
    parser.add_argument("effects", nargs="*", help="cases to do; all if none is named")
    parser.add_argument("--out", type=Path, default=folder)
    parser.add_argument("--page", type=Path)
    parser.add_argument("--cores", type=int, default=1)
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--for-s", type=float, default=float("inf"), help="begin no case after this long")
    given = parser.parse_args(arguments)
    unknown = [name for name in given.effects if name not in cases]
    if unknown:
        parser.error(f"unknown cases {', '.join(unknown)}; there are {', '.join(cases)}")
    given.out.mkdir(parents=True, exist_ok=True)
    began = time.monotonic()
    for name in given.effects or cases:
        target = given.out / f"{name}.json"
        if target.exists():
            continue
        if time.monotonic() - began > given.for_s:
            break
        found = do(name, given)
        target.write_text(json.dumps(found, indent=1), encoding="utf-8")
        print(f"{name}: {say(found)}", flush=True)
    done = [given.out / f"{name}.json" for name in cases if (given.out / f"{name}.json").exists()]
    text = page([json.loads(path.read_text(encoding="utf-8")) for path in done])
    if given.page:
        given.page.write_text(text, encoding="utf-8")
    else:
        print(text)
    return 0
