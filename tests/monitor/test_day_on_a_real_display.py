"""A whole test day in the real window on a real X server: keys go in, words and pictures come out.

It takes minutes, so it runs only where ``DAQ_APP_REAL_DISPLAY=1`` is set.
With ``DAQ_APP_PICTURES`` set to a folder the pictures of the manual are written there.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import time
from pathlib import Path

import pytest

from daq_app.acquisition.process.simulated import SimulatedServer
from daq_app.acquisition.viewers.client import AcquisitionClient, AcquisitionUnreachable
from daq_app.acquisition.viewers.session_file import read_session_file
from daq_app.campaign.result.result import load_result
from daq_app.runfile import open_run, verify
from sim_hardware.control import SimControl
from tests.support.window.real_display import RealWindow, missing_packages, real_display

_MISSING = missing_packages()
pytestmark = [
    pytest.mark.heavy,
    pytest.mark.timeout(1500),
    pytest.mark.skipif(
        not os.environ.get("DAQ_APP_REAL_DISPLAY"), reason="set DAQ_APP_REAL_DISPLAY=1: minutes"
    ),
    pytest.mark.skipif(bool(_MISSING), reason=f"a real display needs the packages {' '.join(_MISSING)}"),
]


SMALLEST = (1366, 768)
"""On this screen the window is whole without being maximised."""


class Day:
    """The rig, its recorder and the windows of one day."""

    def __init__(
        self, display: str, folder: Path, rig: Path, look: str, theme: str, *, maximised: bool = False
    ) -> None:
        self.display, self.rig, self.look, self.theme = display, rig, look, theme
        self.maximised = maximised
        self.out, self.ini, self.shots = folder / "runs", folder / "window.ini", folder / "pictures"
        self.shots.mkdir(parents=True)
        self.windows: list[RealWindow] = []

    def open(self, *, may_command: bool = True) -> RealWindow:
        look = {"may_command": may_command, "maximised": self.maximised}
        window = RealWindow(self.display, self.rig, self.out, self.ini, self.theme, **look)
        self.windows.append(window)
        window.until(lambda words: words["state"] not in ("", "No link"))
        return window

    def reopen(self, window: RealWindow) -> RealWindow:
        """kill −9, and another window on the same rig and folder."""
        window.kill()
        return self.open()

    def shoot(self, window: RealWindow, name: str) -> None:
        window.picture(self.shots / f"{name}-{self.look}.png")

    def client(self) -> AcquisitionClient:
        session = read_session_file(self.out)
        assert session is not None
        return AcquisitionClient(session.address, session.token, topics=())

    def wall(self, name: str, **arguments: float) -> None:
        with self.client() as client, SimControl(client.request("hello").data["connection"]) as wall:
            wall.command(name, **arguments)

    def until_held(self) -> None:
        """The pull is over: what is let go before may be too small a fall to count."""
        with self.client() as client, SimControl(client.request("hello").data["connection"]) as wall:
            while wall.command("status")["state"] != "held":
                time.sleep(0.05)

    def end(self) -> None:
        for window in self.windows:
            if window.process.poll() is None:
                window.kill()
        try:
            with self.client() as client:
                client.request("shutdown")
        except AcquisitionUnreachable:
            pass
        pictures = os.environ.get("DAQ_APP_PICTURES")
        if pictures:
            Path(pictures).mkdir(parents=True, exist_ok=True)
            for picture in self.shots.glob("*.png"):
                shutil.copy(picture, pictures)

    def run_of(self, pattern: str) -> Path:
        return sorted(self.out.glob(pattern))[-1]


@pytest.fixture
def day_at(tmp_path, configs):
    """Makes a day on a display of some size; everything ends with the test."""
    days: list[Day] = []
    stack = contextlib.ExitStack()

    def begin(width: int, height: int, theme: str, rig: Path = configs / "fr1.toml") -> Day:
        display = stack.enter_context(real_display(width, height))
        look = f"{theme}-{width}x{height}"
        day = Day(display, tmp_path / "day", rig, look, theme, maximised=(width, height) > SMALLEST)
        days.append(day)
        return day

    yield begin
    for day in days:
        day.end()
    stack.close()


@pytest.mark.parametrize(
    ("width", "height", "theme"), [(1366, 768, "dark"), (1920, 1080, "light")], ids=["small", "large"]
)
def test_a_whole_day(day_at, width, height, theme):
    day = day_at(width, height, theme)
    window = day.open()
    window.says(state="Live view")
    window.says(whole=True)  # with its frame

    # Choose, zero, check.
    window.press("F6")
    window.says(test="FR1-L1-1", target=0.15)
    window.press("ctrl+0")
    window.says(zeroed=True, page="Prepare")
    window.press("F2")
    window.says(check="Go")
    day.shoot(window, "prepare")

    # Arm; the window dies, the test does not.
    window.press("F5")
    window.says(state="Armed", page="Test", recording="Recording")
    window = day.reopen(window)
    window.says(state="Armed", test="FR1-L1-1", target=0.15, check="Go", zeroed=True, recording="Recording")
    day.wall("pull", theta0_over_alpha=0.15)
    window.until(lambda words: "more" in words["gauge"])
    day.shoot(window, "pull")
    window = day.reopen(window)
    window.says(state="Holding", page="Test", test="FR1-L1-1", target=0.15)
    window = day.reopen(window)
    window.until(lambda words: words["gauge"] == "Release" and words["page"] == "Test")
    day.shoot(window, "release")
    window.press("F11")
    window.says(full_screen=True)
    day.shoot(window, "full-screen")
    window.press("Escape")
    window.says(full_screen=False)
    day.wall("release")
    window.says(state="Rocking", page="Test")
    day.shoot(window, "rocking")
    window = day.reopen(window)
    window.says(state="Saved")

    # Result, repeat under the next free number, the other pages. A window that came too late shows it all.
    window.says(page="Result", result="FR1-L1-1")
    run = day.run_of("FR1-L1-1_*.h5")
    report = verify(run)
    assert report.ok, report
    with open_run(run) as opened:
        assert not opened.gaps and opened.header.test_plan.theta0_over_alpha == 0.15
    day.shoot(window, "result")
    window.press("ctrl+o")
    window.until(lambda words: "Install a browser" in words["notice"] and ".result.html" in words["notice"])
    day.shoot(window, "no-browser")
    window.press("ctrl+d", "ctrl+r")
    window.press("F6")
    window.says(page="Prepare", chosen="FR1-L1-6")
    for key, page in (("3", "Live"), ("4", "Campaign"), ("6", "Replay"), ("7", "Gap"), ("8", "Messages")):
        window.press(f"ctrl+{key}")
        window.says(page=page)
        day.shoot(window, page.lower())

    # An arming that is given up, and a release that nobody armed.
    window.press("F5")
    window.says(state="Armed", test="FR1-L1-6")
    window.press("F8", "F8")
    window.says(state="Aborted")
    assert window.words["recording"] != "On disk"
    day.wall("pull", theta0_over_alpha=0.15)
    window.says(state="Not armed", recording="Not recording")
    day.until_held()
    day.shoot(window, "not-armed")
    day.wall("release")
    window.until(lambda words: "not armed" in words["state"] and words["page"] == "Test")
    window.says(state="Saved")
    window.until(lambda words: "campaign assign" in words["notice"] and words["page"] == "Result")
    day.shoot(window, "unarmed-saved")
    assert verify(day.run_of("unarmed_*.h5")).ok
    assert not window.clipped
    spoken = [(words["state"], words["gauge"]) for words in window.past]
    assert not [told for told in spoken if told[1] == "Release" and told[0] != "Holding"]


def test_two_windows_and_two_rigs_side_by_side(day_at, configs, tmp_path):
    day = day_at(1366, 768, "light")
    first = day.open()
    first.says(state="Live view")
    watcher = day.open(may_command=False)
    watcher.says(state="Live view")
    watcher.press("F5")  # it was opened last: it has the keys
    watcher.until(lambda words: "watch, not command" in words["notice"])
    assert first.words["state"] == "Live view"
    other = Day(day.display, tmp_path / "other", configs / "fr2.toml", "light-1366x768", "light")
    try:
        second = other.open()
        second.says(state="Live view")
        second.press("F6")
        second.until(lambda words: words["chosen"].startswith("FR2-"))
        second.press("F5")
        second.says(state="Armed", page="Test")
        assert first.words["state"] == "Live view" and not first.words["chosen"].startswith("FR2-")
        second.press("F8", "F8")
        second.says(state="Aborted")
    finally:
        other.end()


def test_wrong_clicks_and_keys_while_armed_change_nothing(day_at):
    day = day_at(1366, 768, "light")
    window = day.open()
    window.says(state="Live view")
    window.press("F6")
    window.says(chosen="FR1-L1-1", target=0.15)
    window.press("ctrl+0")
    window.says(zeroed=True)
    window.click("L3")
    window.says(target=0.35)
    window.press("F5")
    window.says(state="Armed", page="Test")
    armed = {name: window.words[name] for name in ("state", "test", "target", "zeroed", "check")}

    # Another target, another test, zero, check and pull test, with mouse and keys.
    window.click("Prepare")
    window.says(page="Prepare")
    for button in ("L4", "L1", "Zero", "Check sensors", "Pull test", "Next test", "Arm", "Live view"):
        window.click(button)
    window.press("ctrl+0", "F2", "F3", "F4", "F5", "F6")
    window.until(lambda words: "not now" in words["notice"])
    window.click("Test")
    window.says(page="Test", **armed)
    window = day.reopen(window)
    window.says(**armed)

    # One press of Abort gives nothing up; the wall is held where the test was planned.
    window.click("Abort")
    day.wall("pull", theta0_over_alpha=0.4)
    window.until(lambda words: "ease back" in words["gauge"])
    day.wall("pull", theta0_over_alpha=0.35)
    window.says(state="Holding", gauge="Release", test="FR1-L1-1", target=0.35)
    day.wall("release")
    window.says(state="Saved", page="Result", result="FR1-L1-1")
    with open_run(day.run_of("FR1-L1-1_*.h5")) as opened:
        assert opened.header.test_plan.theta0_over_alpha == 0.35 and not opened.gaps
    assert not [words for words in window.past if words["state"] == "Armed" and words["target"] != 0.35]


def test_a_family_that_disagrees_is_in_the_verdict_on_screen_and_on_paper(day_at, configs, tmp_path):
    """The wires of this wall follow like an instrument of 20 ms; its rig file knows nothing of it."""
    lab = shutil.copytree(configs, tmp_path / "lab")
    real, believed = lab / "real.toml", lab / "fr1.toml"
    text = believed.read_text(encoding="utf-8")
    heading = "[channel_defaults.wire]"
    real.write_text(text.replace(heading, f"{heading}\ntime_constant_s = 0.02\n#"), encoding="utf-8")
    with SimulatedServer(real, ["--wall", "commanded", "--speed", "2"]) as server:
        believed.write_text(text.replace('"simulated"', f'"{server.connection}"', 1), encoding="utf-8")
        day = day_at(1366, 768, "dark", rig=believed)
        window = day.open()
        window.says(state="Live view")
        window.press("F6", "ctrl+0")
        window.says(zeroed=True)
        window.press("F2")
        window.says(check="Go")
        window.press("F5")
        window.says(state="Armed", page="Test", test="FR1-L1-1")
        day.wall("pull", theta0_over_alpha=0.15)
        window.says(state="Holding", gauge="Release")
        day.wall("release")
        window.says(state="Saved", page="Result", result="FR1-L1-1")
        assert "wires are slow" in window.words["verdict"]
        assert "r is taken from the other family" in window.words["verdict"]
        day.shoot(window, "a-family-disagrees")
        run = day.run_of("FR1-L1-1_*.h5")
        assert "wires are slow" in run.with_suffix(".result.html").read_text(encoding="utf-8")
        result = load_result(run)
        assert result is not None and result.test.methods["CRT"].r == pytest.approx(0.895, abs=0.003)
        day.end()
