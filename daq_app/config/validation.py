"""Pydantic's complaints in the words of the person who wrote the file."""

from __future__ import annotations

import difflib
import types
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from daq_app.config.errors import Problem

Location = tuple[int | str, ...]
Label = Callable[[Location], str]


def nearest(word: str, known: Iterable[str], n: int = 1) -> list[str]:
    """The known names most like `word` (upper and lower case alike), best first."""
    folded = {name.casefold(): name for name in known}
    return [folded[hit] for hit in difflib.get_close_matches(word.casefold(), folded, n=n, cutoff=0.5)]


def key_path(location: Location, label: Label | None = None) -> str:
    """``('channels', 3, 'position_m', 0)`` → ``channels[3] (LV-A04).position_m[0]``."""
    text = ""
    for depth, part in enumerate(location):
        if isinstance(part, int):
            text += f"[{part}]"
            name = label(location[: depth + 1]) if label else ""
            text += f" ({name})" if name else ""
        else:
            text += f".{part}" if text else part
    return text or "the file"


def problems_of(
    error: ValidationError, model: type[BaseModel], file: str, label: Label | None = None
) -> list[Problem]:
    """Every complaint of a validation as a `Problem`; unknown keys get a did-you-mean.

    A key that is missing because it is misspelt is reported once, as the misspelling.
    """
    details = error.errors(include_url=False)
    meant = {
        (*detail["loc"][:-1], near)
        for detail in details
        if detail["type"] == "extra_forbidden"
        for near in _meant(detail["loc"], model)
    }
    return [
        _problem(detail, model, file, label)
        for detail in details
        if not (detail["type"] == "missing" and detail["loc"] in meant)
    ]


def _meant(location: Location, model: type[BaseModel]) -> list[str]:
    """The known key that an unknown one was probably meant to be."""
    owner = model_at(model, location[:-1])
    return nearest(str(location[-1]), sorted(owner.model_fields)) if owner else []


def _problem(detail: ErrorDetails, model: type[BaseModel], file: str, label: Label | None) -> Problem:
    location = detail["loc"]
    key = key_path(location, label)
    kind = detail["type"]
    context: Mapping[str, Any] = detail.get("ctx", {})
    got = _shown(detail.get("input"))
    owner = model_at(model, location[:-1])
    last = str(location[-1]) if location else ""
    if kind == "extra_forbidden":
        near = _meant(location, model)
        known = ", ".join(sorted(owner.model_fields)) if owner else ""
        right = f"Did you mean `{near[0]}`?" if near else f"Known keys: {known}"
        return Problem(file, key, f"`{last}` is no key of this table", right)
    if kind == "missing":
        return Problem(file, key, f"`{last}` is missing", f"Add `{last} = …`{_about(owner, last)}")
    if kind == "value_error":
        return Problem(file, key, str(context.get("error", detail["msg"])), "Correct it")
    wanted = _WANTED.get(kind)
    if wanted is not None:
        return Problem(file, key, f"{got} is not allowed here", f"Give {wanted.format(**context)}")
    message = detail["msg"]
    return Problem(file, key, f"{got} is not allowed here", message[:1].upper() + message[1:])


_WANTED: dict[str, str] = {
    "greater_than": "a number greater than {gt:g}",
    "greater_than_equal": "a number not less than {ge:g}",
    "less_than": "a number less than {lt:g}",
    "less_than_equal": "a number not greater than {le:g}",
    "finite_number": "a finite number",
    "float_type": "a number",
    "float_parsing": "a number",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_from_float": "a whole number",
    "string_type": "text in double quotes",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "literal_error": "one of {expected}",
    "date_type": "a date such as 2026-02-16, without quotes",
    "date_parsing": "a date such as 2026-02-16, without quotes",
    "date_from_datetime_parsing": "a date such as 2026-02-16, without quotes",
    "date_from_datetime_inexact": "a date such as 2026-02-16, without a time",
    "tuple_type": "a list in square brackets",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "dict_type": "a table",
    "string_pattern_mismatch": "text of the form {pattern}",
}


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "…"


def _about(owner: type[BaseModel] | None, name: str) -> str:
    """A hint at what belongs there, from the model's own type."""
    if owner is None or name not in owner.model_fields:
        return ""
    options = [value for value in get_args(owner.model_fields[name].annotation) if isinstance(value, str)]
    return f" (one of {', '.join(options)})" if options else ""


def model_at(model: type[BaseModel], location: Location) -> type[BaseModel] | None:
    """The model that validates the table at `location` below `model`; None if there is none."""
    annotation: object = model
    for part in location:
        if isinstance(part, int):
            inner = [arg for arg in get_args(annotation) if arg is not Ellipsis]
            if not inner:
                return None
            annotation = inner[min(part, len(inner) - 1)]
        else:
            owner = _as_model(annotation)
            if owner is None or part not in owner.model_fields:
                return None
            annotation = owner.model_fields[part].annotation
    return _as_model(annotation)


def _as_model(annotation: object) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    if get_origin(annotation) in (Union, types.UnionType):
        for option in get_args(annotation):
            found = _as_model(option)
            if found is not None:
                return found
    return None


__all__ = ["Label", "Location", "key_path", "model_at", "nearest", "problems_of"]
