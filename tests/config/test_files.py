"""Files that are no rig files at all."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from daq_app.config import ConfigError, Problem, load_rig


def only_problem(path: Path) -> Problem:
    with pytest.raises(ConfigError) as caught:
        load_rig(path)
    (problem,) = caught.value.problems
    assert problem.file == str(path)
    return problem


def test_missing_file(tmp_path: Path) -> None:
    problem = only_problem(tmp_path / "none.toml")
    assert "does not exist" in problem.wrong
    assert str(tmp_path) in problem.right


def test_folder(tmp_path: Path) -> None:
    assert "folder" in only_problem(tmp_path).wrong


def test_huge_file_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with path.open("wb") as stream:
        stream.truncate(1 << 33)
    problem = only_problem(path)
    assert "8589.9 MB" in problem.wrong
    assert "recording" in problem.right


def test_binary_file(tmp_path: Path) -> None:
    path = tmp_path / "wrong.toml"
    path.write_bytes(b"\x89HDF\r\n\x1a\n\x00\xff\xfe")
    assert "no UTF-8 text" in only_problem(path).wrong


def test_syntax_error_names_the_line(tmp_path: Path) -> None:
    path = tmp_path / "broken.toml"
    path.write_text('name = "a"\n\n[specimen]\nweight_n = 5,3\n', encoding="utf-8")
    problem = only_problem(path)
    assert problem.key.startswith("line 4")
    assert "weight_n = 5,3" in problem.wrong


def test_end_of_document_is_a_line_too(tmp_path: Path) -> None:
    path = tmp_path / "cut.toml"
    path.write_text('name = "a"\nx = """abc', encoding="utf-8")
    assert only_problem(path).key == "line 2"


@pytest.mark.parametrize("text", ["", "a = 1\n", "[[channels]]\n"])
def test_other_toml_files_are_named_as_such(tmp_path: Path, text: str) -> None:
    path = tmp_path / "other.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_rig(path)
    assert "specimen" in {problem.key for problem in caught.value.problems}


def test_byte_order_mark_and_windows_line_ends_are_fine(tmp_path: Path, configs: Path) -> None:
    text = (configs / "fr1.toml").read_text(encoding="utf-8").replace("\n", "\r\n")
    path = tmp_path / "fr1.toml"
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert load_rig(path).name == "fr1"


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX rights")
def test_unreadable_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "secret.toml"
    path.touch()

    def refuse(self: Path, *_args: object, **_kwargs: object) -> object:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)  # root may read everything
    assert "Permission denied" in only_problem(path).wrong


def test_name_that_the_system_refuses() -> None:
    assert "cannot be read" in only_problem(Path("rig\0.toml")).wrong


@pytest.mark.parametrize(
    "text",
    [
        ".".join("a" * 200_000) + " = 1",
        "x = { " + ".".join(['"a"'] * 100_000) + " = 1 }",
        "[" + " . ".join("a" * 50_000) + "]",
    ],
)
def test_a_key_of_absurdly_many_parts_is_refused_at_once(tmp_path: Path, text: str) -> None:
    path = tmp_path / "deep.toml"
    path.write_text(text, encoding="utf-8")
    assert "more than 32 names joined by dots on line 1" in only_problem(path).wrong


def test_dots_in_texts_are_no_key(tmp_path: Path, configs: Path) -> None:
    text = (configs / "fr1.toml").read_text(encoding="utf-8")
    path = tmp_path / "fr1.toml"
    path.write_text(text + "# " + "0.1 0.2 … end. " * 1000 + "\n# " + "." * 1000 + "\n", encoding="utf-8")
    assert load_rig(path).name == "fr1"
