"""One fault that many channels share is reported once, where it was written."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from daq_app.config.errors import Problem

OwnKeys = Mapping[int, tuple[str, frozenset[str]]]
"""Channel index → (family, keys that the channel's own table gives)."""

_CHANNEL = re.compile(r"channels\[(?P<index>\d+)\](?: \((?P<id>[^)]*)\))?(?:\.(?P<rest>.*))?")
_NO_KEYS: OwnKeys = {}


def grouped(problems: Iterable[Problem], own_keys: OwnKeys = _NO_KEYS) -> list[Problem]:
    """The problems in their order, equal ones of several channels merged into one.

    Where every channel of a family has the fault and none gives the key itself, the key path is
    that of the family's ``channel_defaults`` table.
    """
    groups: dict[object, list[tuple[Problem, re.Match[str] | None]]] = {}
    for number, problem in enumerate(problems):
        match = _CHANNEL.fullmatch(problem.key)
        key: object = (match["rest"], problem.wrong, problem.right) if match else number
        groups.setdefault(key, []).append((problem, match))
    return [_merged(group, own_keys) for group in groups.values()]


def _merged(group: list[tuple[Problem, re.Match[str] | None]], own_keys: OwnKeys) -> Problem:
    first, match = group[0]
    if match is None or len(group) == 1:
        return first
    matches = [m for _, m in group if m is not None]
    rest = match["rest"] or ""
    family = _common_default(matches, rest, own_keys)
    names = [m["id"] or f"[{m['index']}]" for m in matches]
    listed = ", ".join(names) if len(names) <= 3 else f"{names[0]}, {names[1]} … {names[-1]}"
    key = f"channel_defaults.{family}" if family else "channels"
    key += f" ({listed}: {len(names)} channels)"
    return Problem(first.file, f"{key}.{rest}" if rest else key, first.wrong, first.right)


def _common_default(matches: list[re.Match[str]], rest: str, own_keys: OwnKeys) -> str:
    """The family whose defaults hold the fault; empty if it is not one family's."""
    indices = {int(m["index"]) for m in matches}
    top = re.split(r"[.\[]", rest, maxsplit=1)[0]
    families = {own_keys[i][0] for i in indices if i in own_keys}
    if len(families) != 1:
        return ""
    (family,) = families
    inheriting = {i for i, (of, keys) in own_keys.items() if of == family and top not in keys}
    return family if indices == inheriting else ""
