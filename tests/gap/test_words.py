"""Causes in words: every effect of the library has them, and sizes come with their interval."""

from __future__ import annotations

from typing import Any

import pytest

from daq_app.gap.rocking_model.library import rocking_library
from daq_app.gap.words import cause_in_words, causes_in_words, with_interval


@pytest.mark.parametrize("name", sorted(e.name for e in rocking_library().named))
def test_every_effect_of_the_library_is_said_in_words_with_its_sizes(name: str) -> None:
    effect = rocking_library()[name]
    words = cause_in_words(name, {effect.key(p): (0.02, 0.01, 0.03) for p in effect.parameters})
    assert "_" not in words and "@" not in words and "{" not in words
    assert "±" in words and "unknown" not in words


def test_sizes_are_in_the_units_of_the_rig_and_rounded_by_their_interval() -> None:
    words = cause_in_words("pivot_shift", {"pivot_shift.a": (0.00983, 0.00921, 0.01045)})
    assert words == "the pivot moved inwards by 9.8 ± 0.6 mm"
    assert with_interval(-0.0123, -0.0140, -0.0106, "mm") == "−12.3 ± 1.7 mm"
    assert with_interval(0.05, 0.05, 0.05, "%") == "5 %"


def test_a_fault_of_sensors_says_which() -> None:
    size = {"lag@lvdt.tau": (0.006, 0.0055, 0.0065)}
    assert cause_in_words("lag@lvdt", size) == "readings of the LVDTs are late by 6.0 ± 0.5 ms"
    assert cause_in_words("gain@WP-1", {"error": (0.02, 0.018, 0.022)}).startswith(
        "the scale of WP-1 is off by 2.0"
    )


def cause(name: str, closes: float | None, material: bool = True) -> dict[str, Any]:
    estimates = [{"name": f"{name}.beta", "value": 1e-3, "low": 9e-4, "high": 1.1e-3}]
    return {
        "name": name,
        "words": "said by its model",
        "estimates": estimates,
        "closes": closes,
        "material": material,
    }


def test_material_causes_are_said_with_what_each_closes_alone() -> None:
    said = causes_in_words(
        [cause("base_tilt", 0.94), cause("new_effect", None), cause("viscous", 0.01, False)]
    )
    assert said == (
        "the base is tilted by 1.00 ± 0.10 mrad (closes 94 % of the gap alone)",
        "said by its model",
    )
