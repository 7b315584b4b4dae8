"""A campaign is published: a stranger opens every file, machines read the metadata, nothing is half done."""

from __future__ import annotations

import csv
import hashlib
import json
import tempfile
import zipfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from typer.testing import CliRunner, Result

from daq_app.campaign.description import Creator, FieldSpec
from daq_app.campaign.publication.fields import FIELDS_FILE, read_fields
from daq_app.cli.app import build_app
from daq_app.runfile import open_run

PLAN = """
schema_version = 1
name = "one wall"
levels = {{ L1 = 0.15 }}
rigs = {{ FR1 = "{rig}" }}
[[sequence]]
specimen = "FR1"
level = "L1"
"""
DESCRIBED = """
[[fields]]
name = "mortar_age_d"
title = "Age of the mortar"
kind = "number"
unit = "d"
required = true
[publication]
title = "Free-rocking tests of one wall"
abstract = "One release at 0.15 of the slenderness angle."
licence = "CC-BY-4.0"
publisher = "A repository"
published = 2026-11-22
keywords = ["rocking"]
method = "Released by a hook."
contact = "somebody@example.org"
[[publication.creators]]
family_name = "Carberry"
given_name = "Josiah"
orcid = "0000-0002-1825-0097"
affiliation = "Brown University"
[[publication.funding]]
funder = "A foundation"
"""


def command(*words: str | Path) -> Result:
    return CliRunner().invoke(build_app(), [str(word) for word in words])


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory, configs: Path) -> Path:
    folder = tmp_path_factory.mktemp("published")
    bare = PLAN.format(rig=(configs / "fr1.toml").as_posix())
    (folder / "bare.toml").write_text(bare, encoding="utf-8")
    (folder / "plan.toml").write_text(bare + DESCRIBED, encoding="utf-8")
    done = command("campaign", "simulate", folder / "runs", "--plan", folder / "bare.toml", "--workers", "1")
    assert done.exit_code == 0, done.output
    return folder / "runs"


@pytest.fixture(scope="module")
def published(runs: Path) -> Path:
    plan = runs.parent / "plan.toml"
    assert command("publish", runs, "--plan", plan, "--fields").exit_code == 0
    path = runs / FIELDS_FILE
    path.write_text(path.read_text(encoding="utf-8").replace("FR1-L1-1,", "FR1-L1-1,90"), encoding="utf-8")
    done = command("publish", runs, "--plan", plan, "--out", runs.parent / "out", "--zip", "--workers", "1")
    assert done.exit_code == 0, done.output
    return runs.parent / "out"


@pytest.mark.heavy
def test_every_file_is_under_a_checksum_and_in_the_zip(published: Path) -> None:
    lines = (published / "SHA256SUMS").read_text(encoding="utf-8").splitlines()
    summed = {name: digest for digest, name in (line.split("  ", 1) for line in lines)}
    files = {path.relative_to(published).as_posix() for path in published.rglob("*") if path.is_file()}
    assert set(summed) == files - {"SHA256SUMS"}
    for name, digest in summed.items():
        assert hashlib.sha256((published / name).read_bytes()).hexdigest() == digest
    with zipfile.ZipFile(published.with_suffix(".zip")) as archive:
        inside = {name.removeprefix("out/") for name in archive.namelist() if not name.endswith("/")}
    assert inside == files


@pytest.mark.heavy
def test_samples_and_tables_open_with_foreign_readers(published: Path, runs: Path) -> None:
    pandas = pytest.importorskip("pandas")
    xarray = pytest.importorskip("xarray")
    tests = pandas.read_csv(published / "tables" / "tests.csv")
    assert tests.test.tolist() == ["FR1-L1-1"]
    assert tests.mortar_age_d.tolist() == [90]
    with open_run(runs / "FR1-L1-1.h5") as run, xarray.open_dataset(published / tests.data_file[0]) as data:
        assert data.sizes["time"] == run.n_samples
        assert float(abs(data.rotation).max()) == pytest.approx(float(tests.theta0[0]), rel=0.05)
    results = pandas.read_csv(published / "tables" / "results.csv")
    fused = results[(results.quantity == "r") & results.source.str.startswith("verdict")]
    assert fused.value.tolist() == tests.r.tolist()
    assert set(results.level) == {"L1"}
    meanings = pandas.read_csv(published / "tables" / "columns.csv")
    assert set(tests.columns) == set(meanings[meanings.table == "tests.csv"].column)


@pytest.mark.heavy
def test_metadata_name_creators_licence_and_every_file(published: Path) -> None:
    cite = json.loads((published / "datacite.json").read_text(encoding="utf-8"))
    assert cite["creators"][0]["nameIdentifiers"][0]["nameIdentifier"].endswith("0000-0002-1825-0097")
    assert cite["rightsList"][0]["rightsIdentifier"] == "CC-BY-4.0"
    crate = json.loads((published / "ro-crate-metadata.json").read_text(encoding="utf-8"))
    entities = {entity["@id"]: entity for entity in crate["@graph"]}
    for part in entities["./"]["hasPart"]:
        assert (published / part["@id"]).is_file()
        assert entities[part["@id"]]["@type"] == "File"
    for key in ("license", "author", "publisher", "funder"):
        assert entities["./"][key]["@id"] in entities
    assert "Josiah Carberry" in (published / "README.md").read_text(encoding="utf-8")


@pytest.mark.heavy
def test_what_stands_there_is_never_replaced(published: Path, runs: Path) -> None:
    again = command("publish", runs, "--plan", runs.parent / "plan.toml", "--out", published)
    assert again.exit_code == 2
    assert "exists already" in again.output


@pytest.mark.heavy
def test_without_a_description_nothing_is_written(runs: Path) -> None:
    done = command("publish", runs, "--plan", runs.parent / "bare.toml", "--out", runs.parent / "no")
    assert done.exit_code == 2
    assert "[publication]" in done.output
    assert not (runs.parent / "no").exists()


@pytest.mark.parametrize("orcid", ["0000-0002-1825-0098", "0000-0002-1825", "x"])
def test_an_orcid_that_was_copied_wrongly_is_refused(orcid: str) -> None:
    with pytest.raises(ValidationError):
        Creator(family_name="Carberry", given_name="Josiah", orcid=orcid)


@given(st.floats(allow_nan=False, allow_infinity=False), st.booleans())
def test_numbers_of_fields_are_read_with_either_decimal_sign(number: float, comma: bool) -> None:
    with tempfile.TemporaryDirectory() as name:
        text = repr(number).replace(".", ",") if comma else repr(number)
        separator = ";" if comma else ","
        path = Path(name) / FIELDS_FILE
        path.write_text(f"test{separator}age\nFR1-L1-1{separator}{text}\n", encoding="utf-8")
        values, problems = read_fields(
            path.parent, [FieldSpec(name="age", title="Age", kind="number")], ["FR1-L1-1"]
        )
    assert not problems
    assert float(values["FR1-L1-1"]["age"]) == number


def test_values_that_are_none_are_named_with_test_and_field(tmp_path: Path) -> None:
    specs = [
        FieldSpec(name="age", title="Age", kind="number", required=True),
        FieldSpec(name="cast", title="Cast on", kind="date"),
    ]
    with (tmp_path / FIELDS_FILE).open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows(
            [["test", "age", "cast"], ["A", "old", "2026-05-31"], ["C", "3", ""], ["B", "", "May"]]
        )
    _, problems = read_fields(tmp_path, specs, ["A", "B"])
    said = " ".join(str(problem) for problem in problems)
    for words in ("A, age", "`C` is no recorded test", "B, cast", "missing for B"):
        assert words in said
