"""From the text of a rig file to a `Rig`, or to every problem in it."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any, get_args

from pydantic import ValidationError

from daq_app.config.checks import rig_problems
from daq_app.config.errors import ConfigError, Problem
from daq_app.config.hardware.product_files import read_product_files
from daq_app.config.planning.grouping import OwnKeys, grouped
from daq_app.config.planning.planner import channel_problems
from daq_app.config.rig import Channel, Family, Rig
from daq_app.config.toml_file import parse_toml, read_text
from daq_app.config.validation import Location, nearest, problems_of

DEFAULTS_KEY = "channel_defaults"
"""Tables of a rig file, one per family, whose keys every channel of the family takes over."""


def load_rig(path: Path | str) -> Rig:
    """The rig of a file. Raises `ConfigError` with all problems of the file and of its product files."""
    text = read_text(path)
    return parse_rig(text, str(path), _product_texts(text, Path(path)))


def _product_texts(text: str, path: Path) -> tuple[str, ...]:
    """Contents of the product files that a rig file names, each of which is good. Raises `ConfigError`."""
    hardware = parse_toml(text, str(path)).get("hardware")
    names = hardware.get("products") if isinstance(hardware, dict) else None
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        return ()  # nothing, or what the rig's own check refuses
    files = [path.parent / name for name in names]
    read_product_files(files)
    return tuple(read_text(file) for file in files)


def parse_rig(text: str, file: str = "rig", product_texts: tuple[str, ...] = ()) -> Rig:
    """The rig of a TOML text (of a file, or kept in a run). Raises `ConfigError` with all problems.

    `product_texts` are the contents of the product files that it names.

    Rules of the hardware are checked by `plan_tasks`: a rig that can no longer be planned can still
    be read for analysis. But a rig that is refused here has its hardware problems listed too.
    """
    data = parse_toml(text, file)
    own_keys = _own_keys(data)
    problems = merge_channel_defaults(data, file)
    try:
        rig = _with_products(Rig.model_validate(data), product_texts)
        channels = dict(enumerate(rig.channels))
    except ValidationError as error:
        problems += problems_of(error, Rig, file, lambda location: _channel_label(data, location))
        salvaged = _salvage(data, error)
        if salvaged is None:
            raise ConfigError(grouped(problems, own_keys)) from None
        rig, channels = _with_products(salvaged[0], product_texts), salvaged[1]
    problems += rig_problems(rig, channels, _families(data), file)
    if problems:
        problems += channel_problems(rig, channels, file)[1]
        raise ConfigError(grouped(problems, own_keys))
    return rig


def _with_products(rig: Rig, texts: tuple[str, ...]) -> Rig:
    if not texts:
        return rig
    return rig.model_copy(update={"hardware": rig.hardware.with_product_texts(texts)})


def _salvage(data: dict[str, Any], error: ValidationError) -> tuple[Rig, dict[int, Channel]] | None:
    """The rig without what could not be read, and its channels by their index in the file.

    So that one mistyped key does not hide the other faults. None where the rest makes no rig.
    """
    rest = dict(data)
    bad: set[int] = set()
    for detail in error.errors(include_url=False):
        location = detail["loc"]
        if len(location) >= 2 and location[0] == "channels" and isinstance(location[1], int):
            bad.add(location[1])
        elif location:
            rest.pop(str(location[0]), None)
    listed = data.get("channels")
    kept = [i for i in range(len(listed)) if i not in bad] if isinstance(listed, list) else []
    rest["channels"] = [listed[i] for i in kept] if isinstance(listed, list) else []
    rest.setdefault("name", "unnamed")
    try:
        rig = Rig.model_validate(rest)
    except ValidationError:
        return None
    return rig, dict(zip(kept, rig.channels, strict=True))


def _own_keys(data: dict[str, Any]) -> OwnKeys:
    """(family, keys that the channel gives itself) of each channel, before defaults are merged."""
    channels = data.get("channels")
    if not isinstance(channels, list):
        return {}
    return {
        index: (str(channel.get("family", "")), frozenset(channel))
        for index, channel in enumerate(channels)
        if isinstance(channel, dict)
    }


def _families(data: dict[str, Any]) -> Counter[str]:
    """How many channels of each family the file lists."""
    channels = data.get("channels")
    if not isinstance(channels, list):
        return Counter()
    return Counter(
        channel["family"]
        for channel in channels
        if isinstance(channel, dict) and isinstance(channel.get("family"), str)
    )


def merge_channel_defaults(data: dict[str, Any], file: str) -> list[Problem]:
    """Take the ``channel_defaults`` tables out of `data` and merge each into its family's channels.

    A key of the channel wins; sub-tables (certificate, excitation) are merged key by key, and
    `assumed` lists are joined: those of the family name keys wherever they are given.
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
        declared = channel.get("assumed", [])
        merged["assumed"] = (
            assumed + [key for key in declared if key not in assumed]
            if isinstance(declared, list)
            else declared
        )
    return merged


def _channel_label(data: dict[str, Any], location: Location) -> str:
    """The channel's id beside its index, where the location is one of a channel."""
    if len(location) == 2 and location[0] == "channels" and isinstance(location[1], int):
        channel = data["channels"][location[1]]
        if isinstance(channel, dict) and isinstance(channel.get("id"), str):
            return str(channel["id"])
    return ""
