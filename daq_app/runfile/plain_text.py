"""Text that every part of a run can hold."""

from __future__ import annotations


def clean_text(text: str) -> str:
    """Text that HDF5 and UTF-8 can hold: no NUL, no half of a surrogate pair."""
    return text.encode("utf-8", "replace").decode().replace("\0", "\ufffd")
