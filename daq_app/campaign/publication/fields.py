"""What people write down for each test: a table ``fields.csv`` beside the runs, checked against the plan."""

from __future__ import annotations

import csv
import datetime as dt
import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from daq_app.campaign.description import FieldSpec
from daq_app.config import Problem

FIELDS_FILE: Final = "fields.csv"
_TEST: Final = "test"
_KIND_WORDS: Final = {"number": "a number", "integer": "a whole number", "date": "a date like 2026-05-31"}

Values = Mapping[str, Mapping[str, str]]
"""Test → field → value as text, with a decimal point."""


def read_fields(
    folder: Path, specs: Sequence[FieldSpec], tests: Sequence[str]
) -> tuple[Values, list[Problem]]:
    """Values of all tests, and what is wrong or missing. Semicolons and decimal commas are understood."""
    path = folder / FIELDS_FILE
    if not specs:
        return {}, []
    if not path.is_file():
        right = f"Make it with: daq-app publish {folder} --fields"
        return {}, [
            Problem(str(folder), FIELDS_FILE, "does not exist, and the campaign file wants fields", right)
        ]
    text = path.read_text(encoding="utf-8-sig", errors="replace")
    first = text.partition("\n")[0]
    semicolons = first.count(";") > first.count(",")
    rows = list(csv.DictReader(io.StringIO(text), delimiter=";" if semicolons else ","))
    values: dict[str, dict[str, str]] = {}
    problems = []
    for line, row in enumerate(rows, start=2):
        test = (row.get(_TEST) or "").strip()
        if test not in tests:
            right = "Write the test's name as `daq-app campaign status` shows it"
            problems.append(Problem(str(path), f"line {line}", f"`{test}` is no recorded test", right))
            continue
        values[test] = {}
        for spec in specs:
            value = (row.get(spec.name) or "").strip()
            if semicolons and spec.kind == "number":
                value = value.replace(",", ".")
            if value and not _fits(spec, value):
                right = f"Write {_KIND_WORDS[spec.kind]}"
                problems.append(Problem(str(path), f"{test}, {spec.name}", f"`{value}` is not that", right))
            values[test][spec.name] = value
    for spec in specs:
        without = [test for test in tests if not values.get(test, {}).get(spec.name)]
        if spec.required and without:
            which = ", ".join(without[:6]) + (f" and {len(without) - 6} more" if len(without) > 6 else "")
            problems.append(
                Problem(
                    str(path), spec.name, f"is missing for {which}", f"Write it into the column `{spec.name}`"
                )
            )
    return values, problems


def fields_template(specs: Sequence[FieldSpec], tests: Sequence[str]) -> str:
    """An empty table with a row for each test, for a spreadsheet."""
    out = io.StringIO()
    writer = csv.writer(out)
    writer.writerow([_TEST, *(spec.name for spec in specs)])
    writer.writerows([test, *("" for _ in specs)] for test in tests)
    return out.getvalue()


def _fits(spec: FieldSpec, value: str) -> bool:
    try:
        if spec.kind == "number":
            return math.isfinite(float(value))
        if spec.kind == "integer":
            int(value)
        elif spec.kind == "date":
            dt.date.fromisoformat(value)
    except ValueError:
        return False
    return True
