"""Reading protobuf requests the same way whatever their type: enum pairs become one plain value."""

from __future__ import annotations

from typing import Any


def fields_of(request: Any) -> dict[str, Any]:
    """Every field but the task; of a pair ``units`` / ``units_raw`` the one that was sent, as ``units``."""
    out: dict[str, Any] = {}
    for field in request.DESCRIPTOR.fields:
        name = field.name
        if name == "task":
            continue
        if field.containing_oneof is None:
            out[name] = getattr(request, name)
            continue
        sent = request.WhichOneof(field.containing_oneof.name)
        plain = name.removesuffix("_raw")
        out[plain] = getattr(request, sent) if sent else 0
    return out
