"""What NI's client knows of the attributes: types, which can be set, and which values they take.

The protobuf file in the wheel lists every attribute by group, type and access. Which `enum` of
`nidaqmx.constants` an attribute takes stands in the client's property code, next to its number.
"""

from __future__ import annotations

import re
from functools import cache
from importlib import resources
from typing import Any, Final

from google.protobuf.timestamp_pb2 import Timestamp
from nidaqmx import constants
from nidaqmx._stubs import nidaqmx_pb2

from sim_hardware.daqmx_server.channels.value_sets import part_of

CALL: Final = re.compile(
    r"^(?P<verb>Get|Set|Reset)(?P<group>[A-Za-z]+?)Attribute(?P<type>(?:Ex)?[A-Za-z0-9]*)$"
)
_PROPERTY: Final = re.compile(
    r"get_[a-z_]*attribute_int32(?:_array)?\([^)]*?0x([0-9a-fA-F]+)\)(.{0,200})", re.DOTALL
)
_ENUM: Final = re.compile(r"\b([A-Z][A-Za-z0-9]+)\(")
_DEFAULTS: Final[dict[str, Any]] = {
    "Bool": False,
    "Double": 0.0,
    "Int32": 0,
    "UInt32": 0,
    "UInt64": 0,
    "String": "",
    "DoubleArray": [],
    "Int32Array": [],
    "UInt32Array": [],
    "Bytes": b"",
    "Timestamp": Timestamp(seconds=-2_082_844_800),
}


def plain_name(name: str) -> str:
    """``CHANNEL_RESET_ATTRIBUTE_AI_MAX`` → ``AI_MAX``."""
    return name.split("ATTRIBUTE_", 1)[1]


@cache
def attributes_of(group: str) -> dict[str, tuple[int, str]]:
    """Attribute → (NI's number, type such as ``Double``) of a group such as ``Chan``."""
    service = nidaqmx_pb2.DESCRIPTOR.services_by_name["NiDAQmx"]
    out: dict[str, tuple[int, str]] = {}
    for method in service.methods:
        match = CALL.match(method.name)
        if match and match["group"] == group and match["verb"] == "Get":
            for value in method.input_type.fields_by_name["attribute"].enum_type.values:
                if value.number:
                    out[plain_name(value.name)] = (value.number, match["type"].removeprefix("Ex"))
    return out


@cache
def resettable(group: str) -> frozenset[str]:
    """Attributes that can be reset; what cannot be is not settable either."""
    service = nidaqmx_pb2.DESCRIPTOR.services_by_name["NiDAQmx"]
    for method in service.methods:
        if method.name == f"Reset{group}Attribute":
            values = method.input_type.fields_by_name["attribute"].enum_type.values
            return frozenset(plain_name(value.name) for value in values if value.number)
    return frozenset()


@cache
def _enums() -> dict[int, type[Any]]:
    """NI's number of an attribute → its enum in `nidaqmx.constants`."""
    out: dict[int, type[Any]] = {}
    pending = [resources.files("nidaqmx")]
    while pending:
        for entry in pending.pop().iterdir():
            if entry.is_dir():
                pending.append(entry)
            elif entry.name.endswith(".py") and "interpreter" not in entry.name:
                for number, following in _PROPERTY.findall(entry.read_text(encoding="utf-8")):
                    for name in _ENUM.findall(following):
                        if hasattr(constants, name):
                            out.setdefault(int(number, 16), getattr(constants, name))
                            break
    return out


def default_of(group: str, name: str) -> Any:
    """A value of the attribute's type that the client understands: the first of an enum, else zero."""
    number, kind = attributes_of(group)[name]
    if kind == "Int32" and number in _enums():
        part = part_of(group, name)
        return next(item.value for item in _members(number) if part is None or item.value in part)
    return _DEFAULTS[kind]


def enum_value(group: str, name: str, text: str) -> int:
    """Value of an enum's member from the words of NI MAX: ``Differential`` → DIFF; or from its number.

    Raises `ValueError`.
    """
    if text.lstrip("-").isdigit():
        return int(text)
    wanted = re.sub(r"[^A-Z0-9]", "", text.upper())
    members = {
        item.name.replace("_", ""): int(item.value) for item in _members(attributes_of(group)[name][0])
    }
    if wanted in members:
        return members[wanted]
    near = [
        value for member, value in members.items() if wanted.startswith(member) or member.startswith(wanted)
    ]
    if not near:
        raise ValueError(f"{text!r} is no value of {name}")
    return near[0]


def _members(number: int) -> list[Any]:
    enum: Any = _enums().get(number, ())
    return list(enum)


def is_value(group: str, name: str, value: int) -> bool:
    """Whether an integer is one of the values of the attribute's enum, where it has one."""
    number, kind = attributes_of(group)[name]
    if kind != "Int32" or number not in _enums():
        return True
    part = part_of(group, name)
    return value in ({int(item.value) for item in _members(number)} if part is None else part)
