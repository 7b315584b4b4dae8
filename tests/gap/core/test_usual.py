"""As much of an effect as any specimen has is told, and is no cause."""

from __future__ import annotations

from collections.abc import Mapping

from daq_app.gap.core import Options, Parameter, Prediction, Run, diagnose
from tests.support.gap.toy_wave import LIBRARY, DecayModel, make_runs

EFFECTS = LIBRARY.without("kick")


class _UsualSlope(DecayModel):
    """Any specimen's r depends on the amplitude by a hundredth or two."""

    nuisance = (
        *DecayModel.nuisance,
        Parameter("usual_slope", 0.0, 0.02, "1/rad", meaning="slope of r", usual_of="slope"),
    )

    def predict(self, run: Run, values: Mapping[str, float]) -> Prediction:
        slope = values.get("slope.k", 0.0) + values["usual_slope"]
        return super().predict(run, {**values, "slope.k": slope})


def test_as_much_as_any_specimen_has_is_no_cause_and_is_told() -> None:
    runs = make_runs(0, scatter=0.002, slope_k=0.013)
    assert diagnose(DecayModel(), runs, EFFECTS, Options()).decision.effects == ("slope",)
    decision = diagnose(_UsualSlope(), runs, EFFECTS, Options()).decision
    assert (decision.verdict, decision.effects) == ("below_detection", ("slope",))
    assert "slope of r 0.0" in decision.sentence and "no more than is usual" in decision.sentence
    none = diagnose(_UsualSlope(), make_runs(0, scatter=0.002), EFFECTS, Options()).decision
    assert "usual" not in none.sentence


def test_more_than_any_specimen_has_is_a_cause() -> None:
    runs = make_runs(0, scatter=0.002, slope_k=0.12)
    assert diagnose(_UsualSlope(), runs, EFFECTS, Options()).decision.effects == ("slope",)
