"""From the findings of single runs to findings about instruments over all runs."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.stats import norm

from daq_app.config.families import FAMILY_NAMES, in_a_sentence
from daq_app.gap.core.findings import Finding
from daq_app.gap.core.parameters import NORMAL_95
from daq_app.gap.core.policy import POLICY
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.run_findings import EFFECT_SIZES, RunFinding

_IN_NOISE = ("hum", "quantisation", "ringing")
"""Conditions whose size counts over the noise."""
_LEAST = {
    "hum": POLICY.finding_in_noise,
    "quantisation": POLICY.finding_in_noise,
    "noise": POLICY.finding_noise,
    "ringing": POLICY.finding_ringing,
    "shaking": POLICY.finding_shaking,
    "ambient": POLICY.finding_floor,
    "sliding": POLICY.finding_slip,
    "corner_twist": POLICY.finding_slip,
    "crossed": POLICY.finding_crossed,
    "acceleration": POLICY.finding_unlike,
    "unlike": POLICY.finding_unlike,
}
"""Size from which a condition that every laboratory has a little of is material; any other always is."""
_UNITS_OF_LIMITS = {"1/m": "m", "s²/m": "m/s²"}
_FAMILIES = {"floor": "ambient", "base": "contact"}
"""Family of the effects that a finding belongs to, by who has it, where that is no instrument."""


def findings_of(runs: Sequence[RockingRun]) -> tuple[Finding, ...]:
    """One finding per condition that any run shows, in the order in which the runs show them."""
    seen: dict[str, list[RunFinding]] = {}
    for run in runs:
        for finding in run.findings:
            if finding.value > 0.0:
                seen.setdefault(finding.key, []).append(finding)
    return tuple(_finding(key, findings, len(runs)) for key, findings in seen.items())


def _finding(key: str, findings: Sequence[RunFinding], runs: int) -> Finding:
    kind, _, target = key.partition("@")
    size, sd = _median_with_sd(findings)
    chance = float(np.prod([norm.sf(finding.value / finding.sd) for finding in findings]))
    unit = findings[0].unit
    if kind == "saturation":
        # The finding is the inverse of the limit, so that no limit is 0 ± sd.
        size, sd, unit = 1.0 / size, sd / size**2, _UNITS_OF_LIMITS[unit]
    rms = size / math.sqrt(2.0) if kind == "hum" else size
    in_noise = rms / findings[0].noise if kind in _IN_NOISE and findings[0].noise > 0.0 else math.nan
    limit = _LEAST.get(kind, 0.0)
    parameter = EFFECT_SIZES.get(kind, "")
    matters = POLICY.chance(in_noise if kind in _IN_NOISE else size, limit)
    where = f"{len(findings)} of {runs} runs"
    return Finding(
        name=key,
        words=_words(kind, target, findings[0], size, unit) + f" in {where}",
        family=_FAMILIES.get(target, "sensor"),
        probability=1.0 - chance,
        size=size,
        low=max(size - NORMAL_95 * sd, 0.0),
        high=size + NORMAL_95 * sd,
        unit=unit,
        where=where,
        material=matters >= POLICY.refused,
        parameter=parameter,
        in_noise=in_noise,
        unknown=0.0 if parameter else (1.0 - chance) * matters,
    )


def _median_with_sd(findings: Sequence[RunFinding]) -> tuple[float, float]:
    """Median over the runs, and its standard deviation by reading error and spread."""
    values = np.array([finding.value for finding in findings])
    reading = float(np.median([finding.sd for finding in findings]))
    spread = float(values.std(ddof=1)) if values.size > 1 else 0.0
    return float(np.median(values)), math.hypot(reading, spread) / math.sqrt(values.size)


def _words(kind: str, target: str, finding: RunFinding, size: float, unit: str) -> str:
    who = in_a_sentence(target)
    shown, label = (1e3 * size, f"m{unit}") if unit in ("m", "rad") else (size, unit)
    amount = f"{shown:.3g} {label}"
    match kind:
        case "hum":
            return f"mains hum of {amount} in {who}"
        case "quantisation":
            return f"{who} read in steps of {amount}"
        case "dropout":
            return f"{who} stands still for {100 * size:.2g} % of the time"
        case "noise":
            return f"noise of {who} is {size:.2g} times that of its family"
        case "spikes":
            return f"{size:.2g} lone samples a second in {who}"
        case "saturation":
            goes = "go" if target in FAMILY_NAMES else "goes"
            return f"{who} {goes} no further than {amount}"
        case "polarity" | "swap" | "disagreement":
            return finding.observable
        case "ambient":
            return f"irregular vibration of the floor of {amount}, {finding.observable},"
        case "sliding":
            return f"{finding.observable} lets the base slip by {amount} between impacts"
        case "corner_twist":
            return f"{finding.observable} lets one end slip: the base turns by {amount} between impacts"
        case "crossed":
            return f"{who} shows {100 * size:.2g} % of the rotation across its axis"
        case "acceleration":
            return f"{who} feels {100 * size:.0f} % of the horizontal acceleration"
        case "unlike":
            return f"{100 * size:.2g} % of what {who} shows is no response to the rotation"
    return f"{finding.observable} of {amount} ({who})"
