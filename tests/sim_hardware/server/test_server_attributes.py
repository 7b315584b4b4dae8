"""Attributes through the real client: who has them, what they take, what reads back, what is refused."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import nidaqmx
import pytest
from nidaqmx.constants import ADCTimingMode
from nidaqmx.errors import DaqError
from nidaqmx.task.channels import AIChannel

from sim_hardware.daqmx_server.inventory.devices import module_device
from tests.support.server_support import Rig

UNSUPPORTED = -200452
CARD = "PXI1Slot3"


def refused(action: Callable[[], object]) -> int:
    """NI's code with which an action is refused."""
    with pytest.raises(DaqError) as caught:
        action()
    return int(caught.value.error_code)


@pytest.fixture
def task(rig: Rig) -> Iterator[nidaqmx.Task]:
    for slot, product in ((6, "NI 9213"), (7, "NI 9237")):
        rig.bench.inventory.add(module_device(f"cDAQ1Mod{slot}", product, "cDAQ1", slot))
    with rig.task() as task:
        yield task


@pytest.mark.parametrize(
    "attribute",
    [
        "ai_adc_timing_mode",
        "ai_bridge_cfg",
        "ai_excit_val",
        "ai_temp_units",
        "ai_lowpass_enable",
        "ai_dig_fltr_enable",
        "ai_resistance_cfg",
        "ai_open_thrmcpl_detect_enable",
    ],
)
def test_a_multifunction_card_s_voltage_has_no_attribute_of_other_hardware(
    task: nidaqmx.Task, attribute: str
) -> None:
    channel = task.ai_channels.add_ai_voltage_chan(f"{CARD}/ai0")
    assert refused(lambda: getattr(channel, attribute)) == UNSUPPORTED


def test_a_product_keeps_the_attributes_of_what_it_measures(task: nidaqmx.Task) -> None:
    thermocouple: AIChannel = task.ai_channels.add_ai_thrmcpl_chan("cDAQ1Mod6/ai0")
    thermocouple.ai_adc_timing_mode = ADCTimingMode.HIGH_SPEED
    thermocouple.ai_open_thrmcpl_detect_enable = True
    assert thermocouple.ai_adc_timing_mode is ADCTimingMode.HIGH_SPEED
    assert thermocouple.ai_open_thrmcpl_detect_enable

    bridge: AIChannel = task.ai_channels.add_ai_bridge_chan(
        "cDAQ1Mod7/ai0", min_val=-0.02, max_val=0.02, voltage_excit_val=2.5
    )
    bridge.ai_filter_delay_adjustment = 0.5
    assert (bridge.ai_bridge_nom_resistance, bridge.ai_excit_val) == (350.0, 2.5)
    assert refused(lambda: bridge.ai_adc_timing_mode) == UNSUPPORTED
