"""Rates, ranges, skews and delays as NI's documents give them."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq_app.config.hardware import catalogue


@pytest.mark.parametrize(
    ("products", "asked", "coerced"),
    [
        (["NI 9205"], 4000, 4000.0),
        (["PXIe-6345"], 4000, 4000.0),
        (["NI 9234"], 4000, 51200 / 12),
        (["NI 9234"], 51200, 51200.0),
        (["NI 9234"], 100, 51200 / 31),
        (["NI 9239"], 4000, 50000 / 12),
        (["NI 9205", "NI 9234"], 4000, 51200 / 12),
        (["NI 9239", "NI 9234"], 4000, 51200 / 12),
        (["NI 9233"], 100, 2000.0),
        (["PXIe-4340"], 4321.5, 4321.5),
        (["NI 9205"], 3999, 80e6 / 20005),
        (["NI 9205", "NI 9219"], 4000, 4000.0),
    ],
)
def test_coerces_rates_as_the_driver_does(products: list[str], asked: float, coerced: float) -> None:
    assert catalogue.coerce_rate(products, asked) == pytest.approx(coerced, rel=1e-12)


@pytest.mark.parametrize(
    ("products", "asked"),
    [(["NI 9234"], 51201), (["NI 9215"], 100001), (["PXIe-4340"], 30000), (["NI 9205"], math.nan)],
)
def test_refuses_rates_beyond_the_modules(products: list[str], asked: float) -> None:
    with pytest.raises(ValueError, match="Hz"):
        catalogue.coerce_rate(products, asked)


@given(st.sampled_from(["NI 9205", "NI 9234", "NI 9239", "NI 9215", "PXIe-6363"]), st.floats(1, 50_000))
def test_rate_is_never_lower_than_asked_and_is_stable(product: str, asked: float) -> None:
    coerced = catalogue.coerce_rate([product], asked)
    assert coerced >= asked * (1 - 1e-9)
    assert catalogue.coerce_rate([product], coerced) == pytest.approx(coerced, rel=1e-12)


@pytest.mark.parametrize(
    ("low", "high", "limit"), [(-0.1, 0.2, 0.2), (-0.2, 0.21, 1), (-5, 5, 5), (0, 10, 10), (-6, 0, 10)]
)
def test_coerces_ranges_to_the_narrowest_that_holds(low: float, high: float, limit: float) -> None:
    assert catalogue.coerce_range("NI 9205", low, high) == (-limit, limit)


def test_refuses_a_range_beyond_the_module() -> None:
    with pytest.raises(ValueError, match="NI 9205"):
        catalogue.coerce_range("NI 9205", -10, 11)


@pytest.mark.parametrize(("n", "period_us"), [(2, 14.0), (17, 14.0), (18, 1e6 / (18 * 4000)), (32, 7.8125)])
def test_multiplexer_skew_of_the_9205(n: int, period_us: float) -> None:
    """10 µs of padding up to 17 channels at 4 kHz, evenly spread beyond."""
    skews = catalogue.task_skews_s([("Mod1", catalogue.module("NI 9205"))] * n, 4000.0)
    assert skews == pytest.approx([k * period_us * 1e-6 for k in range(n)])


def test_a_full_module_takes_the_padding_of_the_whole_task() -> None:
    product = catalogue.module("NI 9205")
    channels = (
        [("Mod1", product)] * 32 + [("Mod2", product)] * 2 + [("Mod3", catalogue.module("NI 9215"))] * 2
    )
    skews = catalogue.task_skews_s(channels, 4000.0)
    assert skews[33] == pytest.approx(7.8125e-6)
    assert skews[34:] == [0.0, 0.0]


def test_input_delays() -> None:
    assert catalogue.input_delay_s("NI 9237", 4000) == pytest.approx(10.0e-3, abs=0.1e-3)
    assert catalogue.input_delay_s("NI 9237", 2000) == pytest.approx(0.0200094, abs=1e-7)
    assert catalogue.input_delay_s("NI 9233", 4000) == pytest.approx(12.8 / 4000)
    assert catalogue.input_delay_s("NI 9205", 4000) == 0.0


def test_diff_terminals_of_the_9205() -> None:
    terminals = catalogue.module("NI 9205").terminals
    assert terminals["DIFF"] == frozenset([*range(8), *range(16, 24)])
    assert terminals["RSE"] == frozenset(range(32))


def test_unknown_product_names_its_neighbours() -> None:
    with pytest.raises(catalogue.UnknownProduct) as caught:
        catalogue.module("NI 9205x")
    assert "NI 9205" in caught.value.near


@pytest.mark.parametrize("spelling", ["NI-9205", "ni 9205", "NI 9205"])
def test_a_product_is_found_in_other_spellings(spelling: str) -> None:
    assert catalogue.module(spelling).name == "NI 9205"
