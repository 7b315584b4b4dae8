"""A study of many cases goes on where it stopped, and its rows know the code that they were measured with."""

from __future__ import annotations

import json
from pathlib import Path

from studies.gap.rows import Found, mark_of, run_study, write_page


def _run(folder: Path, *arguments: str) -> tuple[list[str], list[Found]]:
    """Cases that were done, and the rows that the page was made from."""
    done: list[str] = []
    rows: list[Found] = []

    def do(name: str, seed: int, cores: int) -> Found:
        done.append(name)
        return {"case": name}

    def page(found: list[Found]) -> str:
        rows.extend(found)
        return ""

    run_study("about", ["a", "b@c"], do, str, page, folder, arguments)
    return done, rows


def test_cases_are_done_once_per_seed_and_rows_of_older_code_only_when_asked(tmp_path: Path) -> None:
    assert _run(tmp_path, "--for-s", "0")[0] == []
    assert _run(tmp_path, "b@c")[0] == ["b@c"]
    assert _run(tmp_path)[0] == ["a"]
    assert _run(tmp_path, "--seed", "2")[0] == ["a", "b@c"]
    older = tmp_path / "a-1.json"
    older.write_text(older.read_text().replace(json.loads(older.read_text())["code"], "0" * 12))
    done, rows = _run(tmp_path)
    assert done == []
    assert [bool(mark_of(row)) for row in rows] == [True, False, False, False], "of another state than most"
    done, rows = _run(tmp_path, "--again")
    assert done == ["a"]
    assert [(row["case"], row["seed"]) for row in rows] == [("a", 1), ("a", 2), ("b@c", 1), ("b@c", 2)]
    assert len({row["code"] for row in rows}) == 1


def test_a_page_keeps_its_words_and_its_rows_stand_beside_it_as_csv(tmp_path):
    page = tmp_path / "study.md"
    text = (
        "# Study\n\nTwo rows.\n\n| case | found |\n|---|---|\n| a | **yes** |\n| b | 0.1, 0.2 |\n\nThe end.\n"
    )
    write_page(text, page)
    assert (
        page.read_text(encoding="utf-8")
        == "# Study\n\nTwo rows.\n\nAll 2 rows: [study.csv](study.csv).\n\nThe end.\n"
    )
    assert (tmp_path / "study.csv").read_text(encoding="utf-8") == 'case,found\na,yes\nb,"0.1, 0.2"\n'
