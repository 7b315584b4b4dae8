"""Names of terminals."""

from __future__ import annotations


def plain(terminal: str) -> str:
    """Terminals compare without case and without the leading slash."""
    return terminal.lower().strip("/")
