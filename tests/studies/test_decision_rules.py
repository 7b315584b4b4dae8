"""A rule that is switched off changes the stored answers that it decided, and no other."""

from __future__ import annotations

from typing import Any

import pytest

from daq_app.gap.core import diagnose
from studies.gap.rules import RULES, Rule, concluded
from tests.support.gap.toy_wave import LIBRARY, DecayModel, make_runs

BY_WORDS = {rule.words: rule for rule in RULES}
ALL = BY_WORDS["nothing"]


@pytest.mark.parametrize("given", [{"slope_k": 0.05}, {"step_h": 0.05}, {}], ids=["effect", "form", "none"])
def test_all_rules_conclude_what_the_diagnosis_did(given: dict[str, Any]) -> None:
    result = diagnose(DecayModel(), make_runs(2, scatter=0.002, **given), LIBRARY).to_dict()
    again = concluded(result, ALL)
    assert again["decision"] == result["decision"]
    assert again["p_unknown"] == pytest.approx(result["p_unknown"], abs=1e-9)
    assert [e["probability"] for e in again["which"]] == pytest.approx(
        [e["probability"] for e in result["which"]]
    )


def test_without_free_forms_another_form_is_named_by_the_library() -> None:
    result = diagnose(DecayModel(), make_runs(2, scatter=0.002, step_h=0.05), LIBRARY).to_dict()
    assert result["decision"] == "none_of_these"
    without: Rule = BY_WORDS["both of these"]
    assert concluded(result, without)["decision"] == "effect"
