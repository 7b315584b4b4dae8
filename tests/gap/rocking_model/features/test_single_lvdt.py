"""One late LVDT among prompt ones: in which form it is late shows where its reading has a corner."""

from __future__ import annotations

import numpy as np
import pytest

from daq_app.gap.core import fit
from daq_app.gap.rocking_model.features.channel_response import channel
from daq_app.gap.rocking_model.inspection.inspect_runs import found_channels
from daq_app.gap.rocking_model.study import model_and_library, prepare
from tests.support.simulated_wall import simulate

NAME = "LV-B05"
FORMS = ("lag", "filter_delay", "slow_response")
LATE_S = 0.004


@pytest.mark.parametrize("form", FORMS)
def test_a_late_lvdt_rounds_its_corners_by_its_form(form: str) -> None:
    """All three are as late as each other; the variances of their delays are 0, τ²/3 and τ²."""
    runs, _ = prepare(simulate({f"{form}@{NAME}": {"tau": LATE_S}}, (-0.25, 0.35)))
    assert found_channels(runs) == {NAME: "lvdt"}
    block = next(b for b in runs[0].blocks if b.family == NAME)
    rounding = block.names.index("rounding")
    predicted = {one: channel(runs[0], block, {f"{one}@{NAME}.tau": LATE_S})[rounding] for one in FORMS}
    assert list(predicted.values()) == sorted(predicted.values())
    sd = np.sqrt(block.covariance[rounding, rounding])
    assert abs(block.values[rounding] - predicted[form]) < 3.0 * sd
    model, library = model_and_library(runs)
    null = fit(model, runs)
    found = {one: fit(model, runs, (library[f"{one}@{NAME}"],), null.known()).log_evidence for one in FORMS}
    others = max(evidence for one, evidence in found.items() if one != form)
    assert found[form] > others + 2.0
