"""A lab trusts the recorder of another one: by its key, under a name, until it is taken back."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from typer.testing import CliRunner, Result

from daq_app.cli.app import build_app
from daq_app.runfile import finalise
from daq_app.runfile.seal import signing


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Keys of this test alone."""
    monkeypatch.setattr(signing, "key_file", lambda: tmp_path / "home" / "seal.key")
    monkeypatch.setattr("daq_app.runfile.seal.trust.key_file", lambda: tmp_path / "home" / "seal.key")
    return tmp_path / "home"


@pytest.fixture
def foreign(
    tmp_path: Path, make_journal: Callable[..., object], with_new_seal: Callable[..., Path]
) -> tuple[Path, str]:
    """A run that another recorder sealed, and that recorder's key."""
    make_journal(tmp_path / "run.journal", n_blocks=2)
    run = finalise(tmp_path / "run.journal", tmp_path / "run.h5", keep_journal=False)
    key = Ed25519PrivateKey.generate()
    public = key.public_key().public_bytes_raw()
    with_new_seal(run, lambda root: (public, key.sign(root)))
    return run, public.hex()


def say(*arguments: object) -> Result:
    return CliRunner().invoke(build_app(), list(map(str, arguments)))


def verified(run: Path) -> dict[str, object]:
    (report,) = json.loads(say("verify", run, "--json").stdout)
    return dict(report)


def test_a_stranger_is_told_with_the_key_and_how_to_trust_it(foreign: tuple[Path, str]) -> None:
    run, key = foreign
    report = verified(run)
    assert report["ok"] and report["proven"] == "every byte"
    assert f"not trusted here, key {key}" in str(report["notes"])
    assert "every byte" in say("verify", run).stdout


def test_a_trusted_recorder_is_named_until_it_is_trusted_no_more(foreign: tuple[Path, str]) -> None:
    run, key = foreign
    assert say("keys", "trust", "hall-2", key).exit_code == 0
    assert json.loads(say("keys", "trusted", "--json").stdout) == {"hall-2": key}
    assert "it was sealed by the trusted recorder hall-2" in str(verified(run)["notes"])
    assert say("keys", "distrust", "hall-2").exit_code == 0
    assert "not trusted here" in str(verified(run)["notes"])


def test_a_name_keeps_its_key_unless_told_and_nonsense_is_refused(foreign: tuple[Path, str]) -> None:
    _, key = foreign
    assert say("keys", "trust", "hall-2", key).exit_code == 0
    assert say("keys", "trust", "hall-2", "0" * 64).exit_code == 2
    assert json.loads(say("keys", "trusted", "--json").stdout) == {"hall-2": key}
    assert say("keys", "trust", "hall-2", "0" * 64, "--replace").exit_code == 0
    for name, value in (("../x", key), ("hall-3", "12ab"), ("hall-3", "g" * 64)):
        assert say("keys", "trust", name, value).exit_code == 2
    assert say("keys", "distrust", "nobody").exit_code == 2


def test_this_machines_key_is_the_one_that_its_runs_bear(
    tmp_path: Path, make_journal: Callable[..., object]
) -> None:
    key = say("keys", "seal").stdout.strip()
    make_journal(tmp_path / "own.journal", n_blocks=2)
    run = finalise(tmp_path / "own.journal", tmp_path / "own.h5", keep_journal=False)
    assert bytes.fromhex(key) in run.read_bytes()
    assert verified(run)["notes"] == []
