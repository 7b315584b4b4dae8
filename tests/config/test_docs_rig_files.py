"""docs/reference/rig-files.md tells of every key and product that there is."""

from __future__ import annotations

from pathlib import Path

import pytest

from daq_app.config.hardware import catalogue
from daq_app.config.rig import Acquisition, Channel, ExpectedChannels, Simulation, Specimen, Table
from daq_app.config.units import SENSITIVITY_TO_SI


@pytest.fixture(scope="module")
def page(repository: Path) -> str:
    return (repository / "docs" / "reference" / "rig-files.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("table", [Specimen, Acquisition, ExpectedChannels, Channel, Simulation])
def test_every_key_is_described(page: str, table: type[Table]) -> None:
    assert [key for key in table.model_fields if f"`{key}`" not in page and key != "assumed"] == []


def test_every_unit_and_product_is_listed(page: str) -> None:
    assert [unit for unit in SENSITIVITY_TO_SI if f"`{unit}`" not in page] == []
    flat = page.replace("\n", " ")
    assert [name for name in (*catalogue.MODULES, *catalogue.CHASSIS) if name not in flat] == []
