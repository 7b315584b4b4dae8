"""One simulated test of all 41 channels, made once."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from daq_app.cli.app import build_app


@pytest.fixture(scope="session")
def simulated_run(configs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """FR1-L1-1 of the shipped rig, analysed and judged as after a test."""
    out = tmp_path_factory.mktemp("simulated") / "FR1-L1-1.h5"
    done = CliRunner().invoke(
        build_app(), ["simulate", str(configs / "fr1.toml"), "--level", "L1", "--out", str(out)]
    )
    assert done.exit_code == 0, done.output
    return out
