"""From the text of a rig file to a `Rig`, or to every problem in it."""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args

from pydantic import ValidationError

from daq_app.config.errors import ConfigError, Problem
from daq_app.config.rig import Family, Rig
from daq_app.config.toml_file import parse_toml, read_text
from daq_app.config.validation import Location, nearest, problems_of

DEFAULTS_KEY = "channel_defaults"
"""Tables of a rig file, one per family, whose keys every channel of the family takes over."""


def load_rig(path: Path | str) -> Rig:
    """The rig of a file. Raises `ConfigError` with all problems of the file."""
    return parse_rig(read_text(path), str(path))


def parse_rig(text: str, file: str = "rig") -> Rig:
    """The rig of a TOML text (of a file, or kept in a run). Raises `ConfigError` with all problems."""
    data = parse_toml(text, file)
    problems = merge_channel_defaults(data, file)
    try:
        rig = Rig.model_validate(data)
    except ValidationError as error:
        problems += problems_of(error, Rig, file, lambda location: _channel_label(data, location))
        raise ConfigError(problems) from None
    if problems:
        raise ConfigError(problems)
    return rig


def merge_channel_defaults(data: dict[str, Any], file: str) -> list[Problem]:
    """Take the ``channel_defaults`` tables out of `data` and merge each into its family's channels.

    A key of the channel wins; sub-tables (certificate, excitation) are merged key by key, and
    `assumed` lists are joined (a default that the channel overrides is assumed no more).
    """
    defaults = data.pop(DEFAULTS_KEY, {})
    if not isinstance(defaults, dict):
        return [Problem(file, DEFAULTS_KEY, "is not a table", "Write [channel_defaults.lvdt] and so on")]
    problems: list[Problem] = []
    families = get_args(Family)
    for family, table in defaults.items():
        key = f"{DEFAULTS_KEY}.{family}"
        if family not in families:
            near = nearest(family, families)
            hint = f"Did you mean `{near[0]}`? " if near else ""
            wrong = f"`{family}` is no sensor family"
            problems.append(Problem(file, key, wrong, f"{hint}Families: {', '.join(families)}"))
        elif not isinstance(table, dict):
            problems.append(Problem(file, key, "is not a table", f"Write [{key}] and keys below it"))
    channels = data.get("channels")
    if isinstance(channels, list):
        data["channels"] = [_merged(channel, defaults) for channel in channels]
    return problems


def _merged(channel: object, defaults: dict[str, Any]) -> object:
    if not isinstance(channel, dict):
        return channel
    family = channel.get("family")
    table = defaults.get(family) if isinstance(family, str) else None
    if not isinstance(table, dict):
        return channel
    merged: dict[str, Any] = dict(table)
    for key, value in channel.items():
        base = merged.get(key)
        merged[key] = {**base, **value} if isinstance(base, dict) and isinstance(value, dict) else value
    assumed = table.get("assumed")
    if isinstance(assumed, list):
        own = channel.get("assumed", [])
        merged["assumed"] = (
            assumed + [key for key in own if key not in assumed] if isinstance(own, list) else own
        )
    return merged


def _channel_label(data: dict[str, Any], location: Location) -> str:
    """The channel's id beside its index, where the location is one of a channel."""
    if len(location) == 2 and location[0] == "channels" and isinstance(location[1], int):
        channel = data["channels"][location[1]]
        if isinstance(channel, dict) and isinstance(channel.get("id"), str):
            return str(channel["id"])
    return ""
