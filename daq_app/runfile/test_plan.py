"""What a test is to be: agreed before the wall is pulled, kept with the run, judged against afterwards."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from daq_app.runfile.plain_text import clean_text

TOLERANCE: Final = 0.05
"""Largest |θ0 / target − 1| of a release that counts. Assumed: five times the 1 % of a careful pull."""

_Text = Annotated[str, AfterValidator(clean_text)]
_Share = Annotated[float, Field(gt=0, lt=1, allow_inf_nan=False)]


class CheckFinding(BaseModel):
    """What the sensor check found wrong with one channel, or with the rig."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    channel: _Text = ""
    """Id of the channel; empty for the rig."""
    verdict: _Text
    """caution or no-go"""
    text: _Text


class CheckRecord(BaseModel):
    """What the last sensor check before the arming said."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    verdict: _Text
    """go, caution or no-go"""
    summary: _Text = ""
    taken_utc: _Text = ""
    overruled: bool = False
    """The operator armed in spite of a no-go."""
    findings: tuple[CheckFinding, ...] = ()
    """What was found, the rig first, then in the order of the channels."""


class TestPlan(BaseModel):
    """The order to arm. It cannot change from the arming to the end of the run."""

    __test__ = False  # no test case of pytest

    model_config = ConfigDict(frozen=True, extra="ignore")

    test: Annotated[_Text, Field(max_length=60)] = ""
    specimen: Annotated[_Text, Field(max_length=60)] = ""
    level: Annotated[_Text, Field(max_length=32)] = ""
    theta0_over_alpha: _Share | None = None
    """|θ0|/α to release from; None where nothing was planned."""
    tolerance: _Share = TOLERANCE
    """Largest |θ0 / target − 1|."""
    side: Literal["", "+x", "-x"] = ""
    """Side that the wall is pulled to; empty where both count."""
    operator: Annotated[_Text, Field(max_length=200)] = ""
    conditions: Annotated[_Text, Field(max_length=2000)] = ""
    """Temperature, cracks, changes at the wall: whatever may matter later."""
    notes: Annotated[_Text, Field(max_length=20_000)] = ""
    check: CheckRecord | None = None
    """None: the sensors were not checked."""
    zero_utc: _Text = ""
    """When the zero in force was taken; empty without one."""

    @property
    def band(self) -> tuple[float, float] | None:
        """Smallest and largest |θ0|/α that count; None without a target."""
        if self.theta0_over_alpha is None:
            return None
        return (
            self.theta0_over_alpha * (1.0 - self.tolerance),
            self.theta0_over_alpha * (1.0 + self.tolerance),
        )

    def side_of(self, rotation_rad: float) -> bool:
        """Whether a rotation of that sign is on the planned side."""
        return not self.side or (rotation_rad >= 0) == (self.side == "+x")
