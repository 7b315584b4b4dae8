"""Findings about instruments beside causes: they never take a place, and only material ones are spoken of."""

from __future__ import annotations

from dataclasses import replace

import pytest

from daq_app.gap.core import Finding, Options, diagnose
from daq_app.gap.core.judging.joined import with_findings
from tests.support.gap.toy_wave import LIBRARY, DecayModel, make_runs

HUM = Finding(
    name="hum@wire",
    words="mains hum of 2 mm in the wires",
    family="sensor",
    probability=0.999,
    size=2e-3,
    low=1.9e-3,
    high=2.1e-3,
    unit="m",
    where="6 of 6 runs",
    material=True,
    parameter="amplitude",
    in_noise=4.0,
)
ORDINARY = replace(HUM, name="hum@lvdt", material=False, in_noise=0.2)
STRANGE = replace(
    HUM, name="crossed@TL-1Y", words="TL-1Y shows 8 % of the rotation", parameter="", unknown=0.999
)


def test_findings_take_no_place_from_causes() -> None:
    """Two causes and two material findings: all four are named, and the causes as surely as without."""
    runs = make_runs(4, slope_k=0.05, shift_s=0.05)
    alone = diagnose(DecayModel(), runs, LIBRARY, Options())
    other = replace(HUM, name="polarity@LV-1", parameter="on")
    result = diagnose(DecayModel(), runs, LIBRARY, Options(), findings=(HUM, other))
    assert result.decision.verdict == "several"
    assert result.decision.effects == ("hum@wire", "polarity@LV-1", "shift", "slope")
    assert result.which[0].probability == alone.which[0].probability
    assert result.best == ("shift", "slope")
    assert [cause.name for cause in result.causes[:2]] == [cause.name for cause in alone.causes[:2]]


def test_an_ordinary_finding_is_listed_and_no_part_of_the_answer() -> None:
    result = diagnose(DecayModel(), make_runs(11), LIBRARY, Options(), findings=(ORDINARY,))
    assert result.decision.verdict in ("parameters", "nothing_missing")
    assert result.findings == (ORDINARY,)
    assert result.which[0].effects == ()


def test_a_material_finding_is_the_answer_where_nothing_else_is_missing() -> None:
    result = diagnose(DecayModel(), make_runs(11), LIBRARY, Options(), findings=(HUM, ORDINARY))
    assert (result.decision.verdict, result.decision.effects) == ("effect", ("hum@wire",))
    assert HUM.words in result.decision.sentence
    sizes = {estimate.name: estimate.value for estimate in result.effect_parameters}
    assert sizes == {"hum@wire.amplitude": 2e-3}
    assert result.to_dict()["findings"][0]["name"] == "hum@wire"


def test_what_no_effect_explains_is_none_of_these() -> None:
    result = diagnose(DecayModel(), make_runs(11), LIBRARY, Options(), findings=(STRANGE,))
    assert result.decision.verdict == "none_of_these"
    assert STRANGE.words in result.decision.sentence


def test_what_no_effect_explains_counts_by_degrees() -> None:
    """A chance of a quarter to matter: the causes stand, less probable by that, and the unknown is ranked."""
    runs = make_runs(4, slope_k=0.05, shift_s=0.05)
    alone = diagnose(DecayModel(), runs, LIBRARY, Options())
    small = replace(STRANGE, material=False, unknown=0.25)
    result = diagnose(DecayModel(), runs, LIBRARY, Options(), findings=(small,))
    assert result.decision.effects == alone.decision.effects
    assert result.which[0].probability == pytest.approx(0.75 * alone.which[0].probability)
    assert result.decision.confidence == pytest.approx(0.75 * alone.decision.confidence)
    assert result.rest.unknown == pytest.approx(1.0 - 0.75 * (1.0 - alone.rest.unknown))


def test_two_weak_signs_of_something_unknown_are_none_of_these_together() -> None:
    """A finding that may matter, and a remainder that may: either alone leaves the causes standing."""
    runs = make_runs(4, slope_k=0.05, shift_s=0.05)
    alone = diagnose(DecayModel(), runs, LIBRARY, Options())
    may_matter = replace(STRANGE, material=False, unknown=0.45)
    left = replace(alone, rest=replace(alone.rest, unknown=0.2))
    assert with_findings(left, (may_matter,)).decision.verdict == "none_of_these"
    assert STRANGE.words in with_findings(left, (may_matter,)).decision.sentence
    assert with_findings(alone, (may_matter,)).decision.effects == alone.decision.effects
    assert with_findings(left, (ORDINARY,)).decision.effects == alone.decision.effects
