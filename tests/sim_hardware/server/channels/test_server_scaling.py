"""Custom scales, convert clocks, slow modules, and sets of devices that cannot share a task."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from nidaqmx.constants import AcquisitionType, DigitalWidthUnits, Edge, TaskMode, UnitsPreScaled, VoltageUnits
from nidaqmx.errors import DaqError
from nidaqmx.scale import Scale

from sim_hardware.daqmx_server.inventory.devices import cdaq_chassis, module_device
from tests.support.server_support import Rig, TestSignals, continuous

RATE = 1000.0


def code_of(call: Callable[[], object]) -> int:
    with pytest.raises(DaqError) as caught:
        call()
    return caught.value.error_code


def _truth(n: int) -> np.ndarray:
    return TestSignals().volts(("x/ai0",), np.arange(n) / RATE)[0]


@pytest.mark.parametrize(
    ("create", "forward"),
    [
        (
            lambda rig: Scale.create_lin_scale(
                "s", 250.0, -10.0, scaled_units="mm", grpc_options=rig.options()
            ),
            lambda volts: 250.0 * volts - 10.0,
        ),
        (
            lambda rig: Scale.create_map_scale("s", -2.0, 2.0, 0.0, 800.0, grpc_options=rig.options()),
            lambda volts: 400.0 + 200.0 * volts,
        ),
        (
            lambda rig: Scale.create_polynomial_scale(
                "s", [0.0, 100.0, 5.0], [0.0, 0.01], grpc_options=rig.options()
            ),
            lambda volts: 100.0 * volts + 5.0 * volts**2,
        ),
        (
            lambda rig: Scale.create_table_scale(
                "s", [-2.0, 0.0, 0.5], [-200.0, 0.0, 100.0], grpc_options=rig.options()
            ),
            lambda volts: np.interp(volts, [-2.0, 0.0, 0.5], [-200.0, 0.0, 100.0]),
        ),
    ],
)
def test_custom_scales(
    rig: Rig, create: Callable[[Rig], Scale], forward: Callable[[np.ndarray], np.ndarray]
) -> None:
    create(rig)
    with rig.task() as task:
        channel = task.ai_channels.add_ai_voltage_chan(
            "cDAQ1Mod1/ai0",
            min_val=-50.0,
            max_val=90.0,
            units=VoltageUnits.FROM_CUSTOM_SCALE,
            custom_scale_name="s",
        )
        continuous(task, RATE)
        got = np.array(task.read(200))
        # The range is chosen for the volts behind the scaled limits, so larger signals meet its rails.
        rail = channel.ai_rng_high
    assert rail in (1.0, 5.0)
    expected = forward(np.clip(_truth(200), -rail, rail))
    assert np.max(np.abs(got - expected)) < 0.1


def test_scale_attributes_and_mistakes(rig: Rig) -> None:
    options = rig.options()
    scale = Scale.create_lin_scale("gain", 2.0, 1.0, UnitsPreScaled.VOLTS, "mm", grpc_options=options)
    assert (scale.lin_slope, scale.lin_y_intercept, scale.scaled_units) == (2.0, 1.0, "mm")
    scale.lin_slope = 3.0
    assert scale.lin_slope == 3.0
    assert code_of(lambda: scale.poly_forward_coeff) == -200601
    assert code_of(lambda: setattr(scale, "lin_slope", 0.0)) == -200409
    assert code_of(lambda: Scale.create_map_scale("m", 1, 1, 0, 5, grpc_options=options)) == -200602
    assert code_of(lambda: Scale.create_map_scale("m", 0, 1, 5, 5, grpc_options=options)) == -200603
    assert code_of(lambda: Scale.create_table_scale("t", [0, 1], [1], grpc_options=options)) == -200350
    assert code_of(lambda: Scale.create_polynomial_scale("p", [], [], grpc_options=options)) == -200404
    reverse = Scale.calculate_reverse_poly_coeff([1.0, 2.0], grpc_options=options)
    assert reverse == pytest.approx([-0.5, 0.5])
    with rig.task() as task:
        add = task.ai_channels.add_ai_voltage_chan
        custom = VoltageUnits.FROM_CUSTOM_SCALE
        assert code_of(lambda: add("cDAQ1Mod1/ai0", units=custom, custom_scale_name="none")) == -200378
        assert code_of(lambda: add("cDAQ1Mod1/ai0", custom_scale_name="gain")) == -200447


def test_the_client_may_set_the_convert_clock(rig: Rig) -> None:
    """A slower convert clock spreads the channels over the scan; too slow or too fast is refused."""
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0:3")
        continuous(task, RATE)
        task.timing.ai_conv_rate = 5000.0
        assert task.timing.ai_conv_rate == 5000.0
        got = np.array(task.read(300))
        task.stop()
        for rate in (3000.0, 300e3):
            task.timing.ai_conv_rate = rate
            assert code_of(task.start) == -200077
    expected = TestSignals().volts(("x/ai3",), np.arange(300) / RATE + 3 / 5000.0)[0]
    assert np.max(np.abs(got[3] - expected)) < 3e-4


def test_a_slow_module_silently_repeats_itself(rig: Rig) -> None:
    """NI 9219 in a 1 kHz task: ten equal samples after each other, and no error."""
    rig.bench.inventory.add(module_device("cDAQ1Mod6", "NI 9219", "cDAQ1", 6))
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod6/ai0", min_val=-4, max_val=4)
        continuous(task, RATE)
        got = np.array(task.read(1000)).reshape(100, 10)
    assert np.all(got == got[:, :1])
    assert len(np.unique(got[:, 0])) > 10


def test_clocks_that_no_hardware_makes(rig: Rig) -> None:
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        task.timing.cfg_samp_clk_timing(0.0, sample_mode=AcquisitionType.CONTINUOUS)
        assert code_of(task.start) == -200077
        task.timing.cfg_samp_clk_timing(100.0, samps_per_chan=1)
        assert code_of(task.start) == -200077


def test_a_fourth_task_finds_no_timing_engine(rig: Rig) -> None:
    tasks = [rig.task(f"t{module}") for module in (1, 2, 4, 5)]
    try:
        for task, module in zip(tasks, (1, 2, 4, 5), strict=True):
            task.ai_channels.add_ai_voltage_chan(f"cDAQ1Mod{module}/ai0")
            continuous(task)
        for task in tasks[:3]:
            task.control(TaskMode.TASK_RESERVE)
        assert code_of(tasks[3].start) == -50103
        tasks[0].control(TaskMode.TASK_UNRESERVE)
        tasks[3].start()
    finally:
        for task in tasks:
            task.close()


def test_devices_without_a_common_clock(rig: Rig) -> None:
    """Two cDAQ chassis share a task only on a time-synchronised network; cDAQ and PXIe never do."""
    inventory = rig.bench.inventory
    for name, product in (("Usb", "cDAQ-9174"), ("NetA", "cDAQ-9189"), ("NetB", "cDAQ-9189")):
        inventory.add(cdaq_chassis(name, product))
        inventory.add(module_device(f"{name}Mod1", "NI 9205", name, 1))
    for channels, code in (
        ("cDAQ1Mod1/ai0, UsbMod1/ai0", -201426),
        ("cDAQ1Mod1/ai0, PXI1Slot3/ai0", -201426),
        ("NetAMod1/ai0, NetBMod1/ai0", 0),
    ):
        with rig.task() as task:
            task.ai_channels.add_ai_voltage_chan(channels)
            continuous(task)
            if code:
                assert code_of(task.start) == code
            else:
                one, two = task.read(10)
                assert one == two


def test_a_falling_edge_is_not_a_rising_one(rig: Rig) -> None:
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        task.timing.cfg_samp_clk_timing(RATE, samps_per_chan=10)
        task.triggers.start_trigger.cfg_dig_edge_start_trig("/cDAQ1/PFI0", Edge.FALLING)
        task.triggers.start_trigger.delay_units = DigitalWidthUnits.SECONDS
        task.triggers.start_trigger.delay = 0.05
        task.start()
        rig.control.command("digital_edge", terminal="/cDAQ1/PFI0")
        rig.skip(0.2)
        assert task.in_stream.avail_samp_per_chan == 0
        instant = rig.control.command("digital_edge", terminal="/cDAQ1/PFI0", edge="falling")["time_s"]
        got = np.array(task.read(10))
    expected = TestSignals().volts(("x/ai0",), instant + 0.05 + np.arange(10) / RATE)[0]
    assert np.max(np.abs(got - expected)) < 3e-4
