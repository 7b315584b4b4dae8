"""What a sensor check says: findings per channel and for the rig, and the verdict that follows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from daq_app.config.rig import Family


class Verdict(StrEnum):
    """Outcome, from good to bad."""

    GO = "go"
    CAUTION = "caution"
    NO_GO = "no-go"


_RANK = {Verdict.GO: 0, Verdict.CAUTION: 1, Verdict.NO_GO: 2}


def worst(verdicts: Sequence[Verdict]) -> Verdict:
    """The worst of several; GO for none."""
    return max(verdicts, key=_RANK.__getitem__, default=Verdict.GO)


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that is wrong: a short code, how bad, and a sentence with what to do."""

    code: str
    verdict: Verdict
    text: str


@dataclass(frozen=True, slots=True)
class ChannelCheck:
    """The check of one channel. Quantities in SI units of the channel."""

    channel_id: str
    family: Family
    findings: tuple[Finding, ...]
    mean_si: float
    noise_si: float
    """rms about the straight line, mains hum taken out."""
    expected_noise_si: float
    hum_si: float
    """rms at 50 or 60 Hz and the first harmonics, whichever is larger."""
    pull_ratio: float | None = None
    """Measured over expected change in the pull test; None before it or where nothing is expected."""

    @property
    def verdict(self) -> Verdict:
        return worst([finding.verdict for finding in self.findings])

    @property
    def text(self) -> str:
        """All findings, the worst first."""
        ordered = sorted(self.findings, key=lambda finding: -_RANK[finding.verdict])
        return " ".join(finding.text for finding in ordered)


@dataclass(frozen=True, slots=True)
class SensorCheck:
    """The whole check."""

    channels: tuple[ChannelCheck, ...]
    rig_findings: tuple[Finding, ...] = ()
    pull_rotation_rad: float | None = None
    """Rotation of the pull test; None before it."""
    taken_utc: str = ""
    notes: tuple[str, ...] = field(default=())

    @property
    def verdict(self) -> Verdict:
        """NO_GO as soon as one channel or the rig has one."""
        return worst(
            [channel.verdict for channel in self.channels]
            + [finding.verdict for finding in self.rig_findings]
        )

    def count(self, verdict: Verdict) -> int:
        """Number of channels with that verdict."""
        return sum(channel.verdict is verdict for channel in self.channels)

    @property
    def summary(self) -> str:
        """One line for the operator."""
        bad, doubtful = self.count(Verdict.NO_GO), self.count(Verdict.CAUTION)
        total = len(self.channels)
        rig = " ".join(finding.text for finding in self.rig_findings)
        if not bad and not doubtful and not rig:
            return self._good_summary(total)
        parts = []
        if bad:
            parts.append(f"{bad} of {total} channels must be mended.")
        if doubtful:
            parts.append(f"{doubtful} of {total} deserve{'s' if doubtful == 1 else ''} a look.")
        return " ".join([*parts, rig]).strip()

    def _good_summary(self, total: int) -> str:
        """Nothing is wrong: how much of that was judged. What a pull does not move is judged at rest only."""
        if self.pull_rotation_rad is None:
            return f"All {total} channels are good at rest."
        at_rest_only = sum(channel.pull_ratio is None for channel in self.channels)
        if not at_rest_only:
            return f"All {total} channels are good, at rest and in the pull."
        return (
            f"{total - at_rest_only} of {total} channels are good, at rest and in the pull; "
            f"the pull does not judge {at_rest_only}, which are good at rest."
        )

    def as_dict(self) -> dict[str, Any]:
        """JSON-able, for the run's record."""
        return {
            "verdict": self.verdict.value,
            "taken_utc": self.taken_utc,
            "pull_rotation_rad": self.pull_rotation_rad,
            "rig": [{"code": f.code, "verdict": f.verdict.value, "text": f.text} for f in self.rig_findings],
            "channels": {
                check.channel_id: {
                    "verdict": check.verdict.value,
                    "codes": [finding.code for finding in check.findings],
                    "mean_si": check.mean_si,
                    "noise_si": check.noise_si,
                    "hum_si": check.hum_si,
                    "pull_ratio": check.pull_ratio,
                }
                for check in self.channels
            },
        }
