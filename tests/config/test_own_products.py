"""Products that the catalogue lacks, from a file in the rig file's folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from daq_app.acquisition.course.header import make_header
from daq_app.acquisition.course.tare import Tare
from daq_app.config import ConfigError, load_rig, parse_rig, plan_tasks
from daq_app.runfile import RunHeader, rig_of
from drivers import Opened
from sim_hardware.daqmx_server.inventory.devices import Inventory

PRODUCT = """
[[product]]
name = "NI 9999"
bus = "cdaq"
source = "its data sheet"
ai = { n = 32, converter = "multiplexed", bits = 18, terminals = { DIFF = "0-7,16-23", RSE = "0-31" }, \
ranges = { voltage = [10.0] }, max_rate_hz = 250000.0, aggregate_rate_hz = 250000.0, measures = ["voltage"] }
"""


@pytest.fixture
def rig_file(tmp_path: Path, configs: Path) -> Path:
    """FR1 with a product of the laboratory's own in slot 1."""
    text = (configs / "fr1.toml").read_text(encoding="utf-8")
    text = text.replace('slot = 1, product = "NI 9205"', 'slot = 1, product = "NI 9999"')
    text = text.replace("[hardware]\n", '[hardware]\nproducts = ["our_cards.toml"]\n')
    assert "NI 9999" in text
    assert "our_cards" in text
    path = tmp_path / "fr1.toml"
    path.write_text(text, encoding="utf-8")
    (tmp_path / "our_cards.toml").write_text(PRODUCT, encoding="utf-8", newline="\n")
    return path


def test_a_product_of_the_laboratory_is_planned_like_any_other(rig_file: Path) -> None:
    plan = plan_tasks(load_rig(rig_file))
    assert sum(len(task.channels) for task in plan.tasks) == 41


def test_the_simulated_hardware_has_it(rig_file: Path) -> None:
    module = Inventory.from_rig(load_rig(rig_file)).devices["cDAQ1Mod1"]
    assert module.product is not None
    assert (module.product.name, module.product.bits, len(module.physical_channels)) == ("NI 9999", 18, 32)


def test_a_run_brings_the_product_files_that_its_rig_names(rig_file: Path) -> None:
    """The plan can be worked out again from the run alone, where the product file has gone or changed."""
    rig = load_rig(rig_file)
    plan = plan_tasks(rig)
    opened = Opened(rate_hz=4000.0, ranges={}, buffer_samples=0, devices=(), driver="")
    header = make_header(rig, rig_file.read_text(encoding="utf-8"), plan, opened, Tare(), test="T1")
    stored = RunHeader.model_validate_json(header.model_dump_json())
    (rig_file.parent / "our_cards.toml").unlink()

    again = rig_of(stored)
    assert again is not None
    assert stored.product_texts == (PRODUCT,)
    assert plan_tasks(again) == plan


def test_a_run_s_text_can_be_read_where_the_product_file_is_not(rig_file: Path) -> None:
    assert len(parse_rig(rig_file.read_text(encoding="utf-8")).channels) == 41


def test_a_product_file_that_is_missing_is_named(rig_file: Path) -> None:
    (rig_file.parent / "our_cards.toml").unlink()
    with pytest.raises(ConfigError, match=r"our_cards\.toml"):
        load_rig(rig_file)


def test_a_product_file_with_a_mistake_is_named_with_it(rig_file: Path) -> None:
    (rig_file.parent / "our_cards.toml").write_text(PRODUCT.replace("multiplexed", "fast"), encoding="utf-8")
    with pytest.raises(ConfigError, match=r"our_cards\.toml.*converter"):
        load_rig(rig_file)


def test_a_product_that_nobody_knows_is_refused_with_where_to_describe_it(rig_file: Path) -> None:
    (rig_file.parent / "our_cards.toml").write_text(PRODUCT.replace("NI 9999", "NI 9998"), encoding="utf-8")
    with pytest.raises(ConfigError, match=r"hardware\.products"):
        plan_tasks(load_rig(rig_file))
