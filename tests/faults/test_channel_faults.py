"""Every fault of a single line, with a wall behind it: noticed while it is there, named in the verdict."""

from __future__ import annotations

import pytest

from daq_app.acquisition import AcquisitionClient
from daq_app.acquisition.messages.published import State
from daq_app.config import Rig
from daq_app.runfile import open_run
from sim_hardware.control import SimControl
from tests.support.recorder.fault_bench import Acquisition, Row, another_process, look_at
from tests.support.recorder.saboteur import view_for_ever

WALL = "commanded"

pytestmark = pytest.mark.heavy


@pytest.mark.parametrize(
    ("fault", "channel", "words"),
    [
        ("channel_stuck", "LV-A03", ("does not change any more", "plug and supply")),
        ("channel_saturated", "WP-2", ("Overloaded: WP-2", "WP-2 leapt")),
        ("channel_open", "TL-1X", ("Overloaded: TL-1X",)),
        ("channel_hum", "LV-B02", ("hums with the mains", "shield")),
        ("channel_swapped", "WP-3", ("leapt within one sample", "polarity")),
    ],
)
def test_a_channel_that_is_broken(
    shared: Acquisition,
    bench: SimControl,
    rig: Rig,
    row: Row,
    fault: str,
    channel: str,
    words: tuple[str, ...],
) -> None:
    bench.command("reset")
    shared.arm()
    shared.strike()
    bench.command("fault", kind=fault, target=rig.channel(channel).physical_channel)
    told = shared.told(*words)
    assert channel in told.text
    shared.record(2000)
    saved = shared.stop()
    facts = look_at(saved.run_path, None)
    assert facts.lost == 0, "the other forty go on"
    assert any(channel in text for text in facts.reasons), (
        f"{facts.verdict}: {facts.reasons}\n{facts.account}"
    )
    row(f"{fault.replace('_', ' ')} ({channel})", told, facts)


def test_a_channel_that_was_broken_before_arming_is_in_the_run_as_well(
    shared: Acquisition, bench: SimControl, rig: Rig
) -> None:
    bench.command("reset")
    bench.command("fault", kind="channel_stuck", target=rig.channel("LV-A05").physical_channel)
    shared.told("LV-A05 does not change")
    shared.arm()
    shared.told("LV-A05 does not change")
    facts = look_at(shared.stop().run_path, None)
    assert any("LV-A05" in text for text in facts.reasons)


def test_wires_that_were_swapped_from_the_beginning_are_no_zero(
    shared: Acquisition, bench: SimControl, rig: Rig
) -> None:
    bench.command("reset")
    bench.command("fault", kind="channel_swapped", target=rig.channel("WP-1").physical_channel)
    refused = shared.client.request("tare", timeout_s=60.0)
    while "drifts" in refused.text or "leaning" in refused.text or "scatters" in refused.text:
        refused = shared.client.request("tare", timeout_s=60.0)  # the wall is just being let down
    assert not refused.ok and "WP-1 reads" in refused.text and "far from zero" in refused.text


def test_a_viewer_that_is_killed_and_one_that_hangs_cost_a_whole_test_nothing(
    shared: Acquisition, bench: SimControl, rig: Rig, row: Row
) -> None:
    bench.command("reset")
    with AcquisitionClient(shared.session.address) as hanging:
        hanging.receive(1.0)
        while not shared.client.request("tare", timeout_s=60.0).ok:
            pass  # the wall is just being let down
        shared.arm()
        victim = another_process(view_for_ever, shared.session.address)
        bench.command("pull", duration_s=1.0)
        shared.state(State.HOLDING)
        shared.record(3 * 4000)
        victim.kill()
        bench.command("release")
        saved = shared.state(State.SAVED, State.FAILED)
    facts = look_at(saved.run_path, None)
    assert (facts.lost, facts.verdict) == (0, "good"), facts.reasons
    with open_run(saved.run_path) as run:
        assert run.derived is not None
        for method in ("eav", "crt"):
            assert run.derived.results["analysis"]["estimates"][method]["r"] == pytest.approx(0.7, abs=0.003)
    row("viewer killed, another hanging", None, facts, "nothing: no viewer is needed")
