"""``python -m docs.tools.make_screenshots``: the pictures of the operator's manual, from simulated FR1 tests.

Everything is real but the wall: the acquisition process, the NI-DAQmx client, the simulated device
server, the window. Pictures go to docs/images/window: dark/ at 1366×768, light/ at 1920×1080.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from PySide6.QtWidgets import QWidget

from daq_app.acquisition.messages.published import State
from daq_app.acquisition.viewers.launcher import AcquisitionProcess
from daq_app.cli.record.simulate import simulate_run
from daq_app.monitor.data.settings import WindowSettings
from daq_app.monitor.window.app import application, open_window
from daq_app.monitor.window.main_window import MainWindow
from sim_hardware.control import SimControl

REPOSITORY = Path(__file__).parents[2]
Look = tuple[str, int, int]
LOOKS: tuple[Look, ...] = (("dark", 1366, 768), ("light", 1920, 1080))
FAULTS = (
    {"kind": "channel_hum", "family": "LV-A07", "amplitude_v": 0.25},
    {"kind": "channel_stuck", "family": "WP-3"},
)


def save(widget: QWidget, path: Path) -> None:
    """Write the picture of a widget, and say so."""
    path.parent.mkdir(parents=True, exist_ok=True)
    widget.grab().save(str(path))
    print(path.name, flush=True)


class Studio:
    """A window, the wall it looks at, and the folder the pictures go to."""

    def __init__(self, window: MainWindow, folder: Path) -> None:
        self.app = application()
        self.window = window
        self.folder = folder

    def meet_the_wall(self) -> None:
        """Wait until samples come in, and ask the acquisition where its simulator listens."""
        self.state(State.PREVIEWING)
        found: list[str] = []
        link = self.window.link
        assert link is not None
        link.replied.connect(lambda name, reply: found.append(str(reply.data.get("connection", ""))))
        link.request("hello")
        self.until(lambda: bool(found))
        self.wall = SimControl(found[0])

    def until(self, condition: Callable[[], bool], limit_s: float = 300.0) -> None:
        """Let the window live until something is so."""
        end = time.monotonic() + limit_s
        while not condition():
            if time.monotonic() > end:
                raise TimeoutError(f"not there in time; the window says {self.window.header.words}")
            self.app.processEvents()
            time.sleep(0.002)

    def live_for(self, seconds: float) -> None:
        """Let the window live for some time."""
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() > end)

    def state(self, wanted: State) -> None:
        """Wait for a state of the acquisition."""
        self.until(lambda: self.window.session.current_state is wanted)

    def is_live(self) -> bool:
        """Whether nothing on screen is stale that should be live."""
        return not self.window.session.data_missing

    def dress(self, look: Look) -> None:
        """Change theme and size."""
        theme, width, height = look
        if self.window.settings.theme != theme:
            self.window.toggle_theme()
        self.window.resize(width, height)

    def shoot(self, name: str, looks: Sequence[Look] = LOOKS) -> None:
        """Save the window as it is, in these looks."""
        for look in looks:
            theme, width, height = look
            self.dress(look)
            self.live_for(0.5)
            self.until(self.is_live)  # a slow machine must not make the picture
            self.window._on_slow()
            self.app.processEvents()  # lays out what has just changed
            path = self.folder / theme / f"{name}-{width}x{height}.png"
            save(self.window, path)

    def order(self, name: str) -> None:
        """Press one of the window's buttons as soon as it can be pressed."""
        button = self.window.actions_bar.buttons[name]
        self.until(button.isEnabled)
        button.click()


def take_test(studio: Studio, name: str, look: Look) -> None:
    """Arm, pull, release, wait for the result; pictures of pull and motion, which leave time for one look."""
    window = studio.window
    window.prepare.card.propose(name, 0.35)
    studio.order("arm")
    studio.state(State.ARMED)
    studio.live_for(1.0)
    studio.wall.command("pull", theta0_over_alpha=0.35)
    studio.dress(look)
    studio.live_for(1.4)
    studio.shoot("pull", [look])
    studio.state(State.HOLDING)
    window.prepare.pull_button.setEnabled(True)
    window.prepare.pull_button.click()
    window.show_page(window.live)
    studio.live_for(6.0)
    studio.wall.command("release")
    window.live.theory_button.setChecked(True)
    studio.until(lambda: (e := window.session.estimate) is not None and len(e.impact_samples) >= 6)
    studio.shoot("live", [look])
    studio.state(State.SAVED)
    studio.until(lambda: window.result.result is not None)


def check_with_faults(studio: Studio) -> None:
    """The sensor check with two faulty channels, and without."""
    window = studio.window
    rig = window.session.rig
    assert rig is not None
    for fault in FAULTS:
        arguments = {key: value for key, value in fault.items() if key != "family"}
        terminal = rig.channel(str(fault["family"])).physical_channel
        studio.wall.command("fault", target=terminal, **arguments)
    studio.live_for(4.0)
    window.show_page(window.prepare)
    check(studio)
    studio.shoot("check-faults")
    studio.wall.command("clear_faults")
    studio.live_for(4.0)
    check(studio)
    while window.notices.current is not None:
        window.notices.dismiss()


def check(studio: Studio) -> None:
    """Run the sensor check."""
    window = studio.window
    window.prepare.check = None
    studio.until(window.prepare.check_button.isEnabled)
    window.prepare.check_button.click()
    studio.until(lambda: window.prepare.check is not None)


def main() -> None:
    """Take all pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=REPOSITORY / "docs" / "images" / "window")
    parser.add_argument(
        "--part", choices=("all", "day", "gap"), default="all", help="what to take pictures of"
    )
    options = parser.parse_args()
    folder: Path = options.out
    folder.mkdir(parents=True, exist_ok=True)
    rig = REPOSITORY / "configs" / "fr1.toml"
    with tempfile.TemporaryDirectory() as temporary:
        if options.part != "day":
            take_gap(rig, Path(temporary), folder)
        if options.part == "gap":
            return
        runs = Path(temporary) / "runs"
        runs.mkdir()
        acquisition = AcquisitionProcess(["--rig", str(rig), "--out", str(runs)])
        try:
            take_all(acquisition, rig, Path(temporary), folder)
        finally:
            acquisition.kill()


def take_gap(rig: Path, temporary: Path, folder: Path) -> None:
    """Four tests of a wall with viscous damping, diagnosed by the page itself."""
    application()
    runs = temporary / "gap"
    runs.mkdir()
    levels = {"L1": 0.15, "L2": 0.25, "L3": 0.35, "L4": 0.40}
    for number, (level, ratio) in enumerate(levels.items()):
        simulate_run(
            rig,
            runs / f"FR1-{level}-1.h5",
            level=level,
            theta0_over_alpha=ratio,
            r=0.9,
            seed=number,
            test=None,
            effects=("viscous:zeta=0.006", "restitution_scatter:sigma=0.004"),
        )
    window = MainWindow(None, WindowSettings(temporary / "gap.ini"))
    window.show()
    studio = Studio(window, folder)
    page = window.gap
    window.show_page(page)
    page.set_folder(runs)
    studio.until(lambda: page.runs.count() == len(levels))
    page.start()
    studio.until(lambda: page.result is not None and not page.runner.busy, limit_s=1800.0)
    studio.shoot("gap")
    window.close()


def take_all(acquisition: AcquisitionProcess, rig: Path, temporary: Path, folder: Path) -> None:
    """A test day in short: check, zero, two tests of level L3, their result, the campaign, the replay."""
    application()
    plan = rig.parent / "campaigns" / "costa.toml"
    settings = WindowSettings(temporary / "window.ini")
    window = open_window(acquisition.address, acquisition.token, settings, plan=plan)
    window.show()
    studio = Studio(window, folder)
    studio.meet_the_wall()
    window.prepare.card.propose("FR1-L3-1", 0.35)
    studio.live_for(4.0)
    check_with_faults(studio)
    studio.until(window.prepare.tare_button.isEnabled)
    window.prepare.tare_button.click()
    studio.until(lambda: bool(window.prepare.zero.record))
    take_test(studio, "FR1-L3-1", LOOKS[1])
    take_test(studio, "FR1-L3-2", LOOKS[0])
    studio.shoot("result")
    window.show_page(window.campaign)
    studio.shoot("campaign")
    window.show_page(window.replay)
    studio.until(lambda: window.replay.run is not None and "FR1-L3-2" in window.replay.run.path.name)
    window.replay.choose(["θ", "dθ/dt", "AC-7", "LV-A01", "LV-B01", "WP-4"])
    window.replay.plots.set_cursor(0.46)
    studio.shoot("replay")
    window.show_page(window.messages)
    studio.shoot("messages")
    shoot_channel(studio, "LV-A07")
    window.close()


def shoot_channel(studio: Studio, name: str) -> None:
    """One channel large, in the look of the window."""
    studio.window.open_channel(name)
    (channel,) = studio.window.channels.shown
    studio.live_for(3.0)
    theme = studio.window.settings.theme
    save(channel, studio.folder / theme / f"channel-{channel.width()}x{channel.height()}.png")


if __name__ == "__main__":
    main()
