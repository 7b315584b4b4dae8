"""The real window on the real acquisition and the simulated server, through a whole release test."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from daq_app.acquisition.checks.check_model import Verdict
from daq_app.acquisition.messages.published import BlockMessage, State
from daq_app.acquisition.viewers.launcher import AcquisitionProcess
from daq_app.runfile import open_run, verify

pytestmark = pytest.mark.heavy
LIMIT_S = 300.0
"""Limit of one wait: for a hang, not for a slow machine."""
LIMIT_MS = round(1e3 * LIMIT_S)

WINDOW = """
import sys
from pathlib import Path
from PySide6.QtCore import QTimer
from daq_app.acquisition.messages.published import MotionMessage
from daq_app.monitor.window.app import application, open_window
from daq_app.monitor.data.settings import WindowSettings

app = application()
window = open_window(sys.argv[1], "", WindowSettings(Path(sys.argv[2])))
window.show_page(window.live)
window.show()

def look():
    if window.live.frames > 10 and window.session.fresh(MotionMessage):
        print("live", flush=True)
        timer.stop()

timer = QTimer()
timer.timeout.connect(look)
timer.start(50)
app.exec()
"""


@pytest.fixture(scope="module")
def acquisition(configs, tmp_path_factory):
    """One acquisition and one wall for all tests here: they take turns, as on a test day."""
    out = tmp_path_factory.mktemp("day") / "runs"
    out.mkdir()
    process = AcquisitionProcess(["--rig", str(configs / "fr1.toml"), "--out", str(out), "--speed", "2"])
    yield process
    process.kill()


def test_from_the_check_to_the_next_test(qtbot, acquisition, configs, settings):
    from daq_app.monitor.window.app import open_window

    window = open_window(
        acquisition.address, acquisition.token, settings, plan=configs / "campaigns" / "costa.toml"
    )
    qtbot.addWidget(window)
    window.show()
    session, prepare = window.session, window.prepare

    def until(condition) -> None:
        qtbot.waitUntil(condition, timeout=LIMIT_MS)

    def reach(state: State) -> None:
        until(lambda: session.current_state is state)

    # The campaign proposes the first test, and its target.
    until(lambda: window.campaign.status is not None)
    reach(State.PREVIEWING)
    window._on_slow()
    window.actions_bar.buttons["next"].setEnabled(True)
    window.actions_bar.buttons["next"].click()
    assert prepare.card.choice.name == "FR1-L1-1"
    assert prepare.card.choice.target_ratio == 0.15

    # Check the sensors, then zero.
    until(lambda: session.recent(3.0) is not None)
    window._on_slow()
    prepare.check_button.click()
    until(lambda: prepare.check is not None)
    assert prepare.check.verdict is Verdict.GO, prepare.check.summary
    prepare.tare_button.click()
    until(lambda: bool(prepare.zero.record))
    assert set(prepare.zero.readings) == set(session.rig.channel_ids)

    # Arm, pull, take the pull test while the wall is held, release.
    window._on_slow()
    window.actions_bar.buttons["arm"].click()
    reach(State.ARMED)
    assert window.stack.currentWidget() is window.test, "the gauge is in front while the wall is pulled"
    until(lambda: session.recording_on_disk)
    window._on_slow()
    assert window.header.words["recording"] == "Recording"
    prepare.wall.order("pull")
    reach(State.HOLDING)
    prepare.pull_button.setEnabled(True)
    prepare.pull_button.click()
    until(lambda: prepare.check.pull_rotation_rad is not None)
    assert prepare.check.verdict is Verdict.GO, [
        (c.channel_id, c.text) for c in prepare.check.channels if c.findings
    ]
    assert abs(prepare.check.pull_rotation_rad) == pytest.approx(0.15 * session.alpha_rad, rel=0.1)
    prepare.wall.order("release")
    until(lambda: session.estimate is not None and len(session.estimate.eav) >= 2)
    window.show_page(window.live)
    until(lambda: window.live.restitution.shown["eav"] >= 2)

    # It ends by itself, the result appears, and the next test is offered.
    reach(State.SAVED)
    until(lambda: window.result.result is not None)
    assert window.stack.currentWidget() is window.result
    test = window.result.result.test
    assert test.test == "FR1-L1-1"
    assert test.methods["CRT"].r == pytest.approx(0.895, abs=0.02)
    run = window.result.run
    assert run.with_suffix(".result.html").stat().st_size > 10_000
    assert run.with_suffix(".result.pdf").read_bytes().startswith(b"%PDF")
    until(lambda: window.campaign.proposal is not None and str(window.campaign.proposal.name) == "FR1-L1-2")
    window.result.buttons["next"].click()
    assert prepare.card.choice.name == "FR1-L1-2"
    assert verify(run).ok
    with open_run(run) as opened:
        assert opened.header.test_plan.check.verdict == "go"
        assert opened.header.test_plan.theta0_over_alpha == 0.15
    window.close()


def test_killing_the_window_while_the_wall_rocks_costs_no_sample(qtbot, acquisition, tmp_path):
    """Another process shows the window; kill −9 on it must not be felt by the recording."""
    window = subprocess.Popen(
        [sys.executable, "-c", WINDOW, acquisition.address, str(tmp_path / "window.ini")],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        text=True,
    )
    with acquisition.client(topics=("state", "block", "estimate")) as client:
        about = client.request("hello").data

        def follow(*wanted: State) -> None:
            for received in client.messages(LIMIT_S):
                if getattr(received.message, "state", None) in wanted:
                    return
            raise AssertionError(f"{wanted} was not heard")

        follow(State.PREVIEWING, State.SAVED)
        assert window.stdout.readline().strip() == "live", "the window must be at work when it is killed"
        assert client.request("tare").ok
        assert client.request("arm", test="FR1-L3-1").ok
        about = client.request("hello").data
        from sim_hardware.control import SimControl

        with SimControl(about["connection"]) as wall:
            wall.command("pull", theta0_over_alpha=0.35)
            follow(State.HOLDING)
            assert window.poll() is None
            wall.command("release")
        follow(State.ROCKING)
        window.send_signal(signal.SIGKILL if hasattr(signal, "SIGKILL") else signal.SIGTERM)
        window.wait(10)
        follow(State.SAVED)
        path = Path(client.request("hello").data["state"]["run_path"])
    report = verify(path)
    assert report.ok, report
    with open_run(path) as run:
        assert not run.gaps
        assert {"released", "rocking", "at_rest"} <= {event.kind for event in run.events}


def test_a_window_without_the_token_watches_and_cannot_command(qtbot, acquisition, settings):
    from daq_app.monitor.window.app import open_window

    window = open_window(acquisition.address, "", settings)
    qtbot.addWidget(window)
    window.show()
    qtbot.waitUntil(lambda: window.session.fresh(BlockMessage), timeout=LIMIT_MS)
    window._on_slow()
    assert not any(button.isEnabled() for button in window.actions_bar.buttons.values())
    with qtbot.waitSignal(window.link.replied, timeout=LIMIT_MS) as replied:
        window.link.request("arm", {"test": "FR1-L1-1"})
    assert not replied.args[1].ok
    assert "may watch, not command" in replied.args[1].text
    window.close()
