"""A real X server with a window manager, and the operator's window on it as a process of its own.

Keys go in as key presses (xdotool), what is on the screen comes back as words and as pictures of the display.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

NEEDED = {"Xvfb": "xvfb", "openbox": "openbox", "xdotool": "xdotool"}
"""Program → the Debian package that brings it."""

LIMIT_S = 400.0
"""The longest wait for one thing: it ends a hang, not a slow machine."""

_WINDOW = """
import json, sys, threading
from pathlib import Path
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QPushButton
from daq_app.monitor.data.settings import WindowSettings
from daq_app.monitor.window.app import application, campaign_beside, open_window, reach
from tests.support.window.clipped_text import clipped_texts

rig, out, ini, theme, token_wanted, size = sys.argv[1:7]
app = application()
settings = WindowSettings(Path(ini))
settings.theme = theme
address, token, mine = reach(Path(rig), Path(out), ["--speed", "2"])
token = token if token_wanted == "yes" else ""
window = open_window(address, token, settings, plan=campaign_beside(Path(rig)))
window.showMaximized() if size == "maximised" else window.show()
shape_before, asked, sought, said, cut_before, cut_told = [None], [], [], [None], [set()], [set()]

def listen():
    for line in sys.stdin:
        kind, _, what = line.strip().partition(" ")
        (asked if kind == "picture" else sought).append(what)

def tell_place(text):
    shown = [b for b in window.findChildren(QPushButton) if b.isVisible() and b.text().startswith(text)]
    if shown:
        centre = shown[0].mapToGlobal(shown[0].rect().center())
        print(json.dumps({"place": [centre.x(), centre.y()], "of": text}), flush=True)
        sought.remove(text)

def shape():
    # What the display is made of now: None until every window of ours is on it.
    shown = [each for each in app.topLevelWidgets() if each.isVisible()]
    if any(each.windowHandle() is None or not each.windowHandle().isExposed() for each in shown):
        return None
    return window.stack.currentIndex(), [(type(each).__name__, each.geometry().getRect()) for each in shown]

def take_pictures():
    # The same windows were there twice in a row: they have their size and layout, and are painted now.
    for each in app.topLevelWidgets():
        if each.isVisible():
            each.repaint()
    while asked:
        path = asked.pop(0)
        window.screen().grabWindow(0).save(path)
        print(json.dumps({"picture": path}), flush=True)

def look():
    if asked and shape() is not None and shape() == shape_before[0]:
        take_pictures()
    shape_before[0] = shape()
    for text in list(sought):
        tell_place(text)
    page = next(name for name, page in window.pages.items() if page is window.stack.currentWidget())
    card = window.prepare.card.choice
    words = {
        **window.header.words, "page": page, "gauge": window.prepare.gauge.words,
        "notice": (window.notices.current or ("", ""))[1], "chosen": card.name, "target": card.target_ratio,
        "zeroed": bool(window.prepare.zero.readings), "check": window.prepare.verdict_text,
        "result": window.result.result.test.test if window.result.result is not None else "",
        "verdict": window.result.banner.sentences[0].text(),
        "full_screen": window.display.full_screen is not None,
        "whole": window.screen().availableGeometry().contains(window.frameGeometry()),
    }
    words.pop("recording_detail")
    cut = {f"{page}: {text}" for text in clipped_texts(window)}
    lasting = cut & cut_before[0]  # a text that has just changed gets its room with the next layout
    cut_before[0] = cut
    if words != said[0] or not lasting <= cut_told[0]:
        said[0], cut_told[0] = words, cut_told[0] | lasting
        print(json.dumps({"words": words, "clipped": sorted(lasting)}), flush=True)

threading.Thread(target=listen, daemon=True).start()
timer = QTimer()
timer.timeout.connect(look)
timer.start(50)
app.exec()
"""


def missing_packages() -> list[str]:
    """Debian packages without which there is no real display here."""
    return [package for program, package in NEEDED.items() if shutil.which(program) is None]


@contextlib.contextmanager
def real_display(width: int, height: int) -> Iterator[str]:
    """An X server of its own with a window manager; yields the name of its display."""
    reads, writes = os.pipe()
    size = f"{width}x{height}x24"
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(writes), "-screen", "0", size, "-nolisten", "tcp"],
        pass_fds=[writes],
        stderr=subprocess.DEVNULL,
    )
    os.close(writes)
    with os.fdopen(reads) as told:
        display = f":{told.readline().strip()}"
    manager = subprocess.Popen(
        ["openbox"],
        env={**os.environ, "DISPLAY": display},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield display
    finally:
        for process in (manager, server):
            process.terminate()
            process.wait(30)


class RealWindow:
    """The operator's window in a process of its own, on a display."""

    def __init__(
        self,
        display: str,
        rig: Path,
        out: Path,
        ini: Path,
        theme: str,
        *,
        may_command: bool = True,
        maximised: bool = False,
    ) -> None:
        environment = {**os.environ, "DISPLAY": display, "QT_QPA_PLATFORM": "xcb"}
        environment["PYTHONPATH"] = str(Path(__file__).parents[3])
        # No browser: what a key would show outside must not cover the display, and the window has to say so.
        environment |= {"PATH": str(ini.parent), "BROWSER": ""}
        arguments = [str(rig), str(out), str(ini), theme, "yes" if may_command else "no"]
        arguments.append("maximised" if maximised else "usual")
        self._display = {**os.environ, "DISPLAY": display}
        self.process = subprocess.Popen(
            [sys.executable, "-c", _WINDOW, *arguments],
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.words: dict[str, Any] = {}
        """What the window says now."""
        self.past: list[dict[str, Any]] = []
        """Everything that it has said, oldest first."""
        self.clipped: set[str] = set()
        """Texts that were cut off at any time."""
        self._pictures: set[str] = set()
        self._places: dict[str, tuple[int, int]] = {}
        """Where buttons are that were asked for, pixels of the display."""
        self._news = threading.Condition()
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            told = json.loads(line)
            with self._news:
                if "picture" in told:
                    self._pictures.add(told["picture"])
                elif "place" in told:
                    self._places[told["of"]] = told["place"]
                else:
                    self.words = told["words"]
                    self.past.append(self.words)
                    self.clipped |= set(told["clipped"])
                self._news.notify_all()

    def until(self, condition: Callable[[dict[str, Any]], object], limit_s: float = LIMIT_S) -> None:
        """Wait until the window says something."""
        with self._news:
            if not self._news.wait_for(lambda: bool(self.words) and condition(self.words), limit_s):
                told = [(words["state"], words["page"], words["notice"]) for words in self.past[-15:]]
                raise AssertionError(f"not said in time; the window says {self.words}, after {told}")

    def says(self, limit_s: float = LIMIT_S, **expected: object) -> None:
        """Wait until the window says exactly this."""
        self.until(lambda words: all(words[name] == value for name, value in expected.items()), limit_s)

    def press(self, *keys: str) -> None:
        """Press keys, as the operator does."""
        subprocess.run(["xdotool", "key", "--delay", "120", *keys], env=self._display, check=True)

    def picture(self, path: Path) -> None:
        """Save what the display shows, once its windows have their size and are painted."""
        self._ask(f"picture {path}")
        with self._news:
            assert self._news.wait_for(lambda: str(path) in self._pictures, 60)

    def click(self, text: str) -> None:
        """Click with the mouse on the visible button whose text begins so, as soon as there is one."""
        self._ask(f"where {text}")
        with self._news:
            assert self._news.wait_for(lambda: text in self._places, 60), f"there is no button {text}"
            x, y = self._places.pop(text)
        move = ["xdotool", "mousemove", str(x), str(y), "click", "1"]
        subprocess.run(move, env=self._display, check=True)

    def _ask(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(f"{line}\n")
        self.process.stdin.flush()

    def kill(self) -> None:
        """End it as a crash does."""
        self.process.kill()
        self.process.wait(30)
