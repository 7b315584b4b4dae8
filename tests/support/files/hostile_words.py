"""Words that act where they are shown: formulas, tags, escape codes, letters that turn the reading order."""

from __future__ import annotations

import unicodedata

from hypothesis import strategies as st

_KNOWN = (
    "=cmd|'/C calc'!A0",
    "+SUM(1;2)",
    "-2+3",
    "@SUM(A1:A9)",
    "\t=1+1",
    "a,=1+1;=2+2",
    '"=1+1',
    '",=cmd|calc!A0,"',
    "<script>alert(1)</script>",
    "<img src=x onerror=alert(1)>",
    "--><svg onload=alert(1)>",
    "{{ 7 * 7 }}{% raw %}",
    "\x1b[2J\x1b]0;owned\x07",
    "\x9b31m red",
    "\u202egpj.exe\u2066",
    "\u2028new line\u2029",
    "[bold]markup[/] [/nothing] :warning:",
    "[link=http://x]here[/link]",
    "$\\frac{$ costs $5",
    "% comment \\input{/etc/passwd}",
    "a\r\nb\nc",
    "\x00nul",
    "🧱👷🏽\u200d♀️🏗️" * 8,
    "Ω" * 300,
    "a\u0300\u0301\u0302\u0303" * 60,
)


def hostile() -> st.SearchStrategy[str]:
    """One of the known ones, any text, or both together."""
    anything = st.text(st.characters(exclude_categories=("Cs",)), max_size=60)
    known = st.sampled_from(_KNOWN)
    return st.one_of(known, anything, st.tuples(known, anything).map("".join))


ALL_KNOWN = _KNOWN


def hidden_characters(text: str) -> list[str]:
    """Characters that no reader sees, other than line breaks, tabs and joiners."""
    allowed = "\n\r\t\u200c\u200d"
    kinds = ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp")
    return [c for c in text if c not in allowed and unicodedata.category(c) in kinds]
