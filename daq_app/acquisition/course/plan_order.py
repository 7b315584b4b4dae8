"""A test plan from the arguments of an order, as a viewer sends them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from pydantic import ValidationError

from daq_app.acquisition.messages.items import RequestRefused
from daq_app.runfile import TestPlan

FIELDS: Final = (
    "test",
    "specimen",
    "level",
    "theta0_over_alpha",
    "tolerance",
    "side",
    "operator",
    "conditions",
    "notes",
)
"""What an order may say; check and zero are the recorder's own."""
_WORDS: Final = {
    "theta0_over_alpha": "the target θ0/α lies between 0 and 1",
    "tolerance": "the tolerance is a share of the target between 0 and 1",
    "side": "the side is +x, -x, or empty for either",
}


def plan_of(arguments: Mapping[str, float | str], chosen: TestPlan) -> TestPlan:
    """The plan that an order means: what it leaves out is taken from the chosen plan of the same test.

    Raises `RequestRefused` for values that no plan can have.
    """
    given = {name: arguments[name] for name in FIELDS if name in arguments}
    same = given.get("test", chosen.test) == chosen.test
    base = chosen.model_dump(include=set(FIELDS)) if same else {}
    try:
        return TestPlan.model_validate({**base, **given})
    except ValidationError as error:
        name = str(error.errors()[0]["loc"][0])
        value = str(given.get(name, ""))[:40]
        why = _WORDS.get(name, error.errors()[0]["msg"])
        raise RequestRefused(f"The plan cannot be used: {name} = {value!r}, but {why}") from error
