"""The planned sequence of a campaign (Table 3.2), as its TOML file tells it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from daq_app.campaign.description import FieldSpec, Publication
from daq_app.campaign.names import TestName, TestSeries
from daq_app.config import ConfigError, Problem
from daq_app.config.toml_file import parse_toml, read_text
from daq_app.config.validation import nearest, problems_of

_Word = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", max_length=32)]
_Level = Annotated[float, Field(gt=0, lt=1, allow_inf_nan=False, strict=True)]
_Number = Annotated[int, Field(ge=1, le=1000, strict=True)]


class Step(BaseModel):
    """Tests of one level of one specimen that are made one after the other."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    specimen: _Word
    level: _Word
    tests: _Number = 1
    repetition: bool = Field(default=False, strict=True)
    """A repetition of an earlier level at the end, named R."""
    lost: tuple[_Number, ...] = ()
    """Numbers that the original campaign lost; history only."""


@dataclass(frozen=True, slots=True)
class PlannedTest:
    """One place of the sequence, to be filled by a good test."""

    name: TestName
    theta0_over_alpha: float
    lost_originally: bool = False


class Campaign(BaseModel):
    """A whole campaign file."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    schema_version: Literal[1] = 1
    name: str
    description: str = ""
    source: str = ""
    levels: dict[_Word, _Level]
    """Level → θ0/α of the release."""
    rigs: dict[_Word, str] = Field(default_factory=dict)
    """Specimen → rig file, relative to the campaign file (absolute once loaded from a file)."""
    sequence: Annotated[tuple[Step, ...], Field(min_length=1)]
    publication: Publication | None = None
    """What a published folder says of the data; None for a campaign that is not published."""
    fields: tuple[FieldSpec, ...] = ()
    """What is noted of every test beyond its notes."""

    @cached_property
    def tests(self) -> tuple[PlannedTest, ...]:
        """Every planned test in the order of the sequence."""
        counts: Counter[TestSeries] = Counter()
        planned = []
        for step in self.sequence:
            series = TestSeries(step.specimen, step.level, step.repetition)
            for place in range(1, step.tests + 1):
                counts[series] += 1
                name = series.test(counts[series])
                planned.append(PlannedTest(name, self.levels[step.level], place in step.lost))
        return tuple(planned)

    @property
    def specimens(self) -> tuple[str, ...]:
        """Specimens in the order in which they are tested first."""
        return tuple(dict.fromkeys(step.specimen for step in self.sequence))

    def theta0_over_alpha(self, name: TestName) -> float | None:
        """Level that a test is released from; None where the campaign does not know the level."""
        return self.levels.get(name.level)

    def rig_path(self, specimen: str) -> Path | None:
        """Rig file of a specimen; None if the campaign names none."""
        rig = self.rigs.get(specimen)
        return Path(rig) if rig else None


def load_campaign(path: Path | str) -> Campaign:
    """The campaign of a file. Raises `ConfigError` with all problems of the file."""
    path = Path(path)
    data = parse_toml(read_text(path), str(path))
    rigs = data.get("rigs")
    if isinstance(rigs, dict):
        data["rigs"] = {
            name: str(path.parent / rig) if isinstance(rig, str) else rig for name, rig in rigs.items()
        }
    try:
        campaign = Campaign.model_validate(data)
    except ValidationError as error:
        raise ConfigError(problems_of(error, Campaign, str(path), lambda at: _label(data, at))) from None
    problems = [*_sequence_problems(campaign, str(path)), *_rig_problems(campaign, str(path))]
    if problems:
        raise ConfigError(problems)
    return campaign


def _label(data: dict[str, Any], location: tuple[int | str, ...]) -> str:
    if len(location) == 2 and location[0] == "sequence" and isinstance(location[1], int):
        step = data["sequence"][location[1]]
        if isinstance(step, dict) and isinstance(step.get("specimen"), str):
            return f"{step['specimen']}-{step.get('level', '?')}"
    return ""


def _sequence_problems(campaign: Campaign, file: str) -> list[Problem]:
    problems = []
    for index, step in enumerate(campaign.sequence):
        key = f"sequence[{index}] ({step.specimen}-{step.level})"
        if step.level not in campaign.levels:
            near = nearest(step.level, campaign.levels)
            hint = f"Did you mean `{near[0]}`? " if near else ""
            right = f"{hint}Levels: {', '.join(campaign.levels) or 'none'}; add it to [levels]"
            problems.append(Problem(file, f"{key}.level", f"`{step.level}` is no level", right))
        beyond = [number for number in step.lost if number > step.tests]
        if beyond:
            wrong = f"test {beyond[0]} of {step.tests} cannot have been lost"
            right = f"Give numbers from 1 to {step.tests}"
            problems.append(Problem(file, f"{key}.lost", wrong, right))
    return problems


def _rig_problems(campaign: Campaign, file: str) -> list[Problem]:
    problems = []
    for specimen, rig in campaign.rigs.items():
        if specimen not in campaign.specimens:
            right = f"Specimens of the sequence: {', '.join(campaign.specimens)}"
            problems.append(Problem(file, f"rigs.{specimen}", "this specimen has no tests", right))
        elif not Path(rig).is_file():
            wrong = f"there is no file {rig}"
            problems.append(Problem(file, f"rigs.{specimen}", wrong, "Give the path from this file's folder"))
    return problems


__all__ = ["Campaign", "PlannedTest", "Step", "TestName", "TestSeries", "load_campaign"]
