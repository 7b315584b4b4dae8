"""What is wrong with a configuration, said so that the person who wrote it can mend it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Problem:
    """One fault: where (file and key path), what is wrong, what would be right."""

    file: str
    key: str
    wrong: str
    right: str

    def __str__(self) -> str:
        place = ": ".join(part for part in (self.file, self.key) if part)
        return f"{place}: {self.wrong}. {self.right}".rstrip()


class ConfigError(Exception):
    """A configuration that cannot be used, with every problem found, not the first only."""

    def __init__(self, problems: list[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(str(problem) for problem in problems))
