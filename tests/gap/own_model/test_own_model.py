"""A stranger's folder: a model file, recordings, the command; and what it says of each mistake."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import Result
from typer.testing import CliRunner

from daq_app.cli.app import build_app

G = 9.81
DRAG_1_M = 0.06


def bounces(height_m: float, drag: float, rng: np.random.Generator) -> list[float]:
    """Times of fifteen bounces of a ball with quadratic drag, heard to 0.3 ms."""
    v, times = np.sqrt(2.0 * G * height_m), [0.0]
    for _ in range(14):
        s = v * np.sqrt(drag / G)
        times.append(times[-1] + (np.arctan(s) + np.arcsinh(s)) / np.sqrt(drag * G))
        v = 0.86 * (1.0 + 0.004 * rng.standard_normal()) * v / np.sqrt(1.0 + drag * v * v / G)
    return [time + 3e-4 * rng.standard_normal() for time in times]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The starter as the command writes it, and six drops of a ball."""
    assert run(["gap", "starter", str(tmp_path / "my_model.py")]).exit_code == 0
    rng = np.random.default_rng(3)
    (tmp_path / "drops").mkdir()
    for k, height in enumerate((1.2, 1.2, 0.9, 0.9, 0.5, 0.5)):
        write(tmp_path / "drops" / f"drop{k}.csv", bounces(height, DRAG_1_M, rng))
    return tmp_path


def write(path: Path, times: list[float]) -> None:
    path.write_text("time_s\n" + "\n".join(f"{time:.6f}" for time in times), encoding="utf-8")


def run(arguments: list[str]) -> Result:
    return CliRunner().invoke(build_app(), arguments)


def diagnose(folder: Path, *options: str) -> Result:
    return run(["gap", "diagnose", "--model", str(folder / "my_model.py"), str(folder / "drops"), *options])


def changed(folder: Path, old: str, new: str) -> Result:
    """The diagnosis after one change of the model file."""
    file = folder / "my_model.py"
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new), encoding="utf-8")
    return diagnose(folder)


def told(result: Result) -> str:
    return " ".join(result.output.split())


def test_the_starter_names_the_drag_of_a_bouncing_ball_and_its_size(folder: Path) -> None:
    out = folder / "result.json"
    result = diagnose(folder, "--json", str(out), "--report", str(folder / "page.html"))
    assert result.exit_code == 0, result.output
    found = json.loads(out.read_text(encoding="utf-8"))
    assert found["decision"] == "effect" and found["which"][0]["effects"] == ["air_drag"]
    drag = found["effect_parameters"][0]
    assert drag["low"] <= DRAG_1_M <= drag["high"]
    assert found["gap"]["closure"] > 0.9
    assert "wall" not in told(result)
    assert (folder / "page.pdf").stat().st_size > 0


def test_a_ball_without_drag_lacks_nothing(folder: Path) -> None:
    rng = np.random.default_rng(4)
    for k in range(6):
        write(folder / "drops" / f"drop{k}.csv", bounces(0.5 + 0.1 * k, 1e-9, rng))
    assert told(diagnose(folder)).startswith(("nothing_missing", "parameters", "below_detection"))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('q.get("air_drag.c"', 'q.get("airdrag.c"', "Effect air_drag changes no feature by air_drag.c"),
        ('q["e"]', "0.8 + 0 * q['first']", "Parameter e changes no feature"),
        ('{"scatter of e":', '{"scatter of r":', "scatter of r, which it does not declare"),
        (', {"scatter of e": flights * (np.arange(flights.size) > 0)}', "", "no prediction has a loading"),
        ("Prediction(flights,", "Prediction(flights[1:],", "shape (13,) for run drop0, which has 14"),
        ('q["e"]', 'q["restitution"]', "'restitution' for run drop0, which is no parameter of it"),
        ("flights = (np", "flights = np.nan * (np", "nan for flight of microphone (feature 1) of run drop0"),
        ("path.stem, flights", '"drop", flights', "6 runs are called drop"),
        ("return measured(", "return None\n    return measured(", "returned NoneType"),
        ("import numpy as np", "import numpy as np\n\n1 / 0", "line 11: ZeroDivisionError"),
        ("library = ", "effects = ", "does not define library"),
    ],
)
def test_a_mistake_in_the_model_is_told_by_its_name(folder: Path, old: str, new: str, words: str) -> None:
    result = changed(folder, old, new)
    assert result.exit_code == 2
    assert words in told(result)
    assert "Traceback" not in result.output


def test_constant_data_is_refused_with_its_run(folder: Path) -> None:
    write(folder / "drops" / "drop3.csv", [0.5 * k for k in range(15)])
    result = diagnose(folder)
    assert result.exit_code == 2
    assert "flight of microphone is 0.5 in all 14 places of run drop3: constant data" in told(result)


def test_a_recording_that_cannot_be_read_is_named(folder: Path) -> None:
    (folder / "drops" / "drop2.csv").write_text("time_s\nnoise\n", encoding="utf-8")
    result = diagnose(folder)
    assert result.exit_code == 2
    assert "drop2.csv cannot be loaded" in told(result) and "ValueError" in told(result)


def test_a_run_in_other_units_and_a_missed_bounce_are_among_the_limits(folder: Path) -> None:
    rng = np.random.default_rng(5)
    times = bounces(0.8, DRAG_1_M, rng)
    write(folder / "drops" / "drop6.csv", [1000.0 * time for time in times])
    words = told(diagnose(folder))
    assert "Run drop6 is" in words and "check its units" in words
    write(folder / "drops" / "drop6.csv", times[:6] + times[7:])
    assert "feature 6 of run drop6" in told(diagnose(folder))


def test_amplitudes_without_a_side_are_noted_where_features_have_two(folder: Path) -> None:
    old = "path.stem, flights, sd"
    result = changed(folder, old, "path.stem, (-1) ** np.arange(flights.size) * flights, sd")
    assert "give the amplitude the sign of its side" in told(result)


def test_a_rig_file_and_a_model_do_not_go_together(folder: Path, configs: Path) -> None:
    result = diagnose(folder, "--rig", str(configs / "fr1.toml"))
    assert result.exit_code == 2 and "--rig describes a rocking wall" in told(result)


def test_the_starter_never_writes_over_a_file(folder: Path) -> None:
    result = run(["gap", "starter", str(folder / "my_model.py")])
    assert result.exit_code == 2 and "is there already" in told(result)


def test_a_model_file_that_is_not_there_says_where_to_begin(tmp_path: Path) -> None:
    result = run(["gap", "diagnose", "--model", str(tmp_path / "none.py"), str(tmp_path)])
    assert result.exit_code == 2 and "gap starter my_model.py" in told(result)


def test_the_page_shows_the_starter_as_the_command_writes_it(folder: Path, repository: Path) -> None:
    page = (repository / "docs" / "how-to" / "own-model.md").read_text(encoding="utf-8")
    assert (folder / "my_model.py").read_text(encoding="utf-8") in page
