"""The paper's tables are printed whole, ours beside them, with a sentence for each number that differs."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from daq_app.rocking import RigidBlock
from studies.paper import __main__ as command
from studies.paper.tables import Number, bodies, numbers

PAGE = Path(__file__).parents[2] / "docs" / "explanation" / "analysis.md"
DIFFERENT = {
    ("3.1", "fr1, p against the original, %"): "0.63",
    ("4.1", "fr1, r_max"): "0.9317",
    ("4.1", "fr2, r_max"): "0.9360",
    ("4.1", "mean, r_max"): "0.9339",
    ("4.1", "fr2, CRT/r_max"): "0.9946",
}
"""Numbers of the paper that its own equations and Table 3.1 do not give, and what they give."""
PRINTED_R_MAX = {"fr1": 0.931, "fr2": 0.935, "mean": 0.933}


@pytest.fixture(scope="module")
def all_numbers() -> list[Number]:
    return numbers()


@pytest.fixture(scope="module")
def blocks() -> dict[str, RigidBlock]:
    return bodies()


def test_every_number_of_the_tables_is_reproduced_but_the_known_ones(all_numbers: list[Number]) -> None:
    assert {(row.table, row.what) for row in all_numbers if row.differs} == set(DIFFERENT)


def test_a_sentence_stands_by_each_number_that_differs_with_what_ours_is_and_by_no_other(
    all_numbers: list[Number],
) -> None:
    for row in all_numbers:
        assert bool(row.why) is row.differs, row
        assert DIFFERENT.get((row.table, row.what), "") in row.why


def test_the_command_prints_every_number_beside_the_papers(
    capsys: pytest.CaptureFixture[str], all_numbers: list[Number]
) -> None:
    command.main()
    printed = capsys.readouterr().out.splitlines()

    for row in all_numbers:
        (line,) = [line for line in printed if line.startswith(f"  {row.what} ")]
        ours, paper = line.removeprefix(f"  {row.what}").split()
        assert float(ours) == pytest.approx(row.ours, abs=10.0 ** -(row.decimals + 1))
        assert paper == row.shown(row.paper)
    assert [line for line in printed if "differs:" in line] == [
        f"    differs: {row.why}" for row in all_numbers if row.differs
    ]


def test_the_page_has_every_number_that_differs(all_numbers: list[Number]) -> None:
    section = PAGE.read_text(encoding="utf-8").split("## The paper's tables beside ours")[1].split("\n## ")[0]

    for row in all_numbers:
        if row.differs:
            assert DIFFERENT[row.table, row.what] in section
            assert row.shown(row.paper) in section


def test_the_printed_r_max_is_the_block_form_cut_after_the_third_digit(blocks: dict[str, RigidBlock]) -> None:
    block_form = {name: blocks[name].r_max for name in ("fr1", "fr2")}
    block_form["mean"] = sum(block_form.values()) / 2.0

    assert {name: math.floor(1e3 * r) / 1e3 for name, r in block_form.items()} == PRINTED_R_MAX


def test_the_printed_percentage_of_p_is_that_of_the_printed_p(all_numbers: list[Number]) -> None:
    printed = {row.what: row.paper for row in all_numbers}
    share = 100.0 * (printed["fr1, p, rad/s"] / printed["original, p, rad/s"] - 1.0)

    assert round(share, 1) == printed["fr1, p against the original, %"]


def test_crt_of_fr2_over_the_printed_r_max_is_the_printed_ratio(all_numbers: list[Number]) -> None:
    printed = {row.what: row.paper for row in all_numbers}

    assert round(0.931 / printed["fr2, r_max"], 2) == printed["fr2, CRT/r_max"]
