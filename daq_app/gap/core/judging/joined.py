"""The answer as a whole: causes and what was measured directly, most of it about instruments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from daq_app.gap.core.findings import Finding, material, unknown
from daq_app.gap.core.judging.evidence import Ranked
from daq_app.gap.core.policy import POLICY, Policy
from daq_app.gap.core.result import NAMING, NO_CAUSE, Decision, Diagnosis, Estimate, verdict_of


def with_findings(result: Diagnosis, findings: Sequence[Finding], policy: Policy = POLICY) -> Diagnosis:
    """The diagnosis with findings about instruments: material ones join each hypothesis and the decision.

    What no effect does adds to the probability of something unknown, and every hypothesis gives way.
    """
    if not findings:
        return result
    known = 1.0 - unknown(findings)
    joining = material(findings)
    sizes = tuple(
        Estimate(f"{f.name}.{f.parameter}", f.size, f.low, f.high, f.unit, 0.0, 0.0, f.words) for f in joining
    )
    return replace(
        result,
        which=tuple(_joined(entry, joining, known) for entry in result.which),
        set95=tuple(_joined(entry, joining) for entry in result.set95),
        decision=_decision(result, findings, policy),
        rest=replace(result.rest, unknown=1.0 - known * (1.0 - result.rest.unknown)),
        effect_parameters=(*result.effect_parameters, *sizes),
        findings=tuple(findings),
    )


def _joined(entry: Ranked, findings: Sequence[Finding], known: float = 1.0) -> Ranked:
    entry = replace(entry, probability=known * entry.probability)
    if not findings:
        return entry
    families = [family for family in entry.family.split(" + ") if family != "none"]
    family = " + ".join(dict.fromkeys([*families, *(finding.family for finding in findings)]))
    names = [finding.name for finding in findings]
    return replace(entry, effects=tuple(sorted((*entry.effects, *names))), family=family)


def _decision(result: Diagnosis, findings: Sequence[Finding], policy: Policy) -> Decision:
    decision, strange = result.decision, unknown(findings)
    # What no effect does may show in a finding, in what remains of the fit, or in a little of both.
    either = 1.0 - (1.0 - strange) * (1.0 - result.rest.unknown)
    telling = [f for f in findings if f.unknown >= policy.listed]
    if either >= policy.refused and telling and decision.verdict != "none_of_these":
        worst = max(telling, key=lambda finding: finding.unknown)
        words = "; ".join(f.words for f in telling)
        sentence = f"None of these explains what was measured directly: {words}. {decision.sentence}"
        return Decision("none_of_these", (), worst.family, sentence, either)
    decision = replace(decision, confidence=(1.0 - strange) * decision.confidence)
    joining = material(findings)
    if not joining or decision.verdict == "none_of_these":
        return decision
    names = tuple(finding.name for finding in joining)
    words = "; ".join(finding.words for finding in joining)
    sentence = f"Measured directly: {words}. {decision.sentence}"
    if decision.verdict in NO_CAUSE:
        sure = min(finding.probability for finding in joining)
        family = _joined(Ranked((), "none", 0.0, 0.0), joining).family
        return Decision(verdict_of(len(names)), names, family, sentence, sure)
    effects = tuple(sorted((*decision.effects, *names)))
    verdict = verdict_of(len(effects)) if decision.verdict in NAMING else decision.verdict
    family = _joined(Ranked(decision.effects, decision.family, 0.0, 0.0), joining).family
    others = tuple(tuple(sorted((*other, *names))) for other in decision.alternatives)
    return Decision(verdict, effects, family, sentence, decision.confidence, others)
