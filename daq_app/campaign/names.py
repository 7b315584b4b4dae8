"""Names of tests: ``FR1-L3-2``, and ``FR1-L3-R`` for a repetition at the end of a campaign."""

from __future__ import annotations

import re
from dataclasses import dataclass

_NAME = re.compile(
    r"(?P<specimen>[A-Za-z][A-Za-z0-9_]*)-(?P<level>[A-Za-z][A-Za-z0-9_]*)-(?P<r>R?)(?P<number>[1-9]\d{0,3})?"
)


@dataclass(frozen=True, slots=True, order=True)
class TestName:
    """One test. Repetitions are numbered too, and the first is written without its number."""

    __test__ = False  # no test class of pytest

    specimen: str
    level: str
    repetition: bool
    number: int

    @classmethod
    def parse(cls, text: str) -> TestName:
        """The test that `text` names. Raises `ValueError` with what would be right."""
        match = _NAME.fullmatch(text.strip())
        if match is None or not (match["r"] or match["number"]):
            raise ValueError(
                f"`{text}` is no name of a test. Write SPECIMEN-LEVEL-NUMBER, for instance FR1-L3-2, "
                "or SPECIMEN-LEVEL-R for a repetition"
            )
        return cls(match["specimen"], match["level"], bool(match["r"]), int(match["number"] or 1))

    @property
    def series(self) -> TestSeries:
        return TestSeries(self.specimen, self.level, self.repetition)

    def __str__(self) -> str:
        number = "R" + (str(self.number) if self.number > 1 else "") if self.repetition else str(self.number)
        return f"{self.specimen}-{self.level}-{number}"


def level_in(test: str) -> str:
    """``L3`` of ``FR1-L3-2``; empty where `test` is no name of a test."""
    try:
        return TestName.parse(test).level
    except ValueError:
        return ""


@dataclass(frozen=True, slots=True, order=True)
class TestSeries:
    """Tests that are counted together: one level of one specimen, repetitions apart."""

    __test__ = False

    specimen: str
    level: str
    repetition: bool

    def test(self, number: int) -> TestName:
        """The series' test of that number."""
        return TestName(self.specimen, self.level, self.repetition, number)

    def __str__(self) -> str:
        return f"{self.specimen}-{self.level}" + ("-R" if self.repetition else "")
