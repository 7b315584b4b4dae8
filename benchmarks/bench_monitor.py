"""The window on a real acquisition of 41 channels at 4000 Hz: frames, latency, stalls, CPU, memory.

``python -m benchmarks monitor``. Qt draws offscreen. ``ROCKING_MEMORY_MINUTES=30`` watches the memory
for longer than the default minute.
"""

from __future__ import annotations

import gc
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import psutil

from benchmarks.support.effort import Effort
from benchmarks.support.figure import Figure

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

RIG = Path(__file__).parents[1] / "configs" / "fr1.toml"
SIZES = ((1366, 768), (1920, 1080))
FRAMES_S = 10.0
LATENCY_TESTS = 3
SETTLING_S = 2.0
WARMING_UP_S = 15.0


class Bench:
    """A window, its acquisition and its wall."""

    def __init__(self, folder: Path) -> None:
        from daq_app.acquisition.messages.published import State
        from daq_app.acquisition.viewers.launcher import AcquisitionProcess
        from daq_app.monitor.data.settings import WindowSettings
        from daq_app.monitor.window.app import application, open_window
        from sim_hardware.control import SimControl

        self.app = application()
        self.acquisition = AcquisitionProcess(["--rig", str(RIG), "--out", str(folder)])
        settings = WindowSettings(folder / "window.ini")
        self.window = open_window(self.acquisition.address, self.acquisition.token, settings)
        self.window.show()
        self.window.show_page(self.window.live)
        self.states = State
        self.until(
            lambda: self.window.session.current_state is State.PREVIEWING and self.window.session.sampling
        )
        assert self.window.link is not None
        answers: list[str] = []
        self.window.link.replied.connect(
            lambda _n, reply: answers.append(str(reply.data.get("connection", "")))
        )
        self.window.link.request("hello")
        self.until(lambda: bool(answers))
        self.wall = SimControl(answers[0])

    def until(self, condition: Callable[[], bool], limit_s: float = 180.0) -> None:
        """Let the window live until something is so, which is looked at after each of its events."""
        from PySide6.QtCore import QEventLoop

        end = time.monotonic() + limit_s
        while not condition():
            if time.monotonic() > end:
                raise TimeoutError("the window did not get there in time")
            self.app.processEvents(QEventLoop.ProcessEventsFlag.WaitForMoreEvents)

    def wall_clock(self) -> float:
        """When the simulated wall's clock stood at 0, by `time.monotonic`; to half a round trip."""
        best = (np.inf, 0.0)
        for _ in range(20):
            before = time.monotonic()
            stands_s = float(self.wall.command("bench")["time_s"])
            after = time.monotonic()
            best = min(best, (after - before, (before + after) / 2.0 - stands_s))
        return best[1]

    def live_for(self, seconds: float) -> None:
        """Let the window live for some time."""
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() > end, limit_s=seconds + 60.0)

    def close(self) -> None:
        """End window and acquisition."""
        self.window.close()
        self.acquisition.kill()


def frames(bench: Bench, size: tuple[int, int], effort: Effort) -> list[Figure]:
    """Painted frames of the two large plots and of the strips per second, CPU and longest stall."""
    window = bench.window
    window.resize(*size)
    bench.live_for(effort.of(SETTLING_S, 0.2))
    plots = (window.live.motion.rotation, window.live.motion.velocity)
    before = [plot.paints for plot in plots]
    strips = window.live.strips.paints
    window.longest_stall_s = 0.0
    started, cpu = time.monotonic(), time.process_time()
    bench.live_for(effort.of(FRAMES_S, 1.0))
    elapsed, used = time.monotonic() - started, time.process_time() - cpu
    rate = min(plot.paints - count for plot, count in zip(plots, before, strict=True)) / elapsed
    place = f"{size[0]}×{size[1]}"
    return [
        Figure(f"large plots, {place}", rate, "frames/s", aim=60.0, better="high"),
        Figure(
            f"41 strips, {place}",
            (window.live.strips.paints - strips) / elapsed,
            "frames/s",
            aim=5.0,
            better="high",
        ),
        Figure(f"longest stall of the window, {place}", 1e3 * window.longest_stall_s, "ms", aim=200.0),
        Figure(f"CPU of the window, {place}", 100.0 * used / elapsed, "% of a core", aim=25.0, note=_load()),
    ]


def _load() -> str:
    """How busy the machine was beside: other work takes frames away."""
    return f"load {psutil.getloadavg()[0]:.1f} on {psutil.cpu_count()} cores"


def latency(bench: Bench, effort: Effort) -> list[Figure]:
    """From each impact of the simulated wall to the paint of the r that it completes, over some tests."""
    window = bench.window
    assert window.link is not None
    window.link.request("tare")
    bench.until(lambda: bool(window.prepare.zero.record))
    tests = effort.of(LATENCY_TESTS, 1)
    delays = [delay for number in range(1, tests + 1) for delay in _delays(bench, f"FR1-L3-{number}")]
    milliseconds = 1e3 * np.asarray(delays)
    note = f"from the wall's own clock, over {tests} tests; {_load()}"
    return [
        Figure(
            f"impact to r on screen, p{share}",
            float(np.percentile(milliseconds, share)),
            "ms",
            len(delays),
            aim,
            note=note,
        )
        for share, aim in ((50, None), (99, 60.0))
    ]


def _delays(bench: Bench, test: str) -> list[float]:
    """Seconds from impact to paint of r, for each impact of one test that completed an r."""
    window, session, states = bench.window, bench.window.session, bench.states
    assert window.link is not None
    window.link.request("arm", {"test": test})
    bench.until(lambda: session.current_state is states.ARMED)
    window.show_page(window.live)  # the result of the test before was in front
    bench.wall.command("pull", theta0_over_alpha=0.35)
    bench.until(lambda: session.current_state is states.HOLDING)
    bench.live_for(1.0)
    wall_began_s = bench.wall_clock()
    bench.wall.command("release")
    painted: dict[int, tuple[float, float]] = {}  # by the number of impacts so far: impact's sample, paint
    shown = 0
    plot = window.live.restitution.plot

    def watch() -> bool:
        nonlocal shown
        estimate = session.estimate
        points = 0 if estimate is None else len(estimate.eav) + len(estimate.crt)
        drawn = sum(window.live.restitution.shown.values()) == points
        drawn = drawn and plot.painted_s > window.live.estimate_drawn_s
        if estimate is not None and points > shown and drawn:
            shown = points
            painted[len(estimate.impact_samples)] = (estimate.impact_samples[-1], plot.painted_s)
        return session.current_state in (states.SAVING, states.SAVED, states.FAILED)

    bench.until(watch)
    truth = bench.wall.command("status")["truth"]["impact_time_s"]
    if not painted:
        said = [event.text for event in session.events if event.severity != "info"]
        raise RuntimeError(
            f"no r came to the screen after {len(truth)} impacts: {window.header.words}, {session.estimate}, "
            f"{said}"
        )
    # The detected impacts are those of the wall, one by one, or the numbers prove nothing.
    apart = [sample / session.rate_hz - truth[n - 1] for n, (sample, _) in painted.items()]
    if np.ptp(apart) > 0.01:
        raise RuntimeError(f"the impacts found are not the wall's: {apart}")
    # Its analysis must not lie beside the next test.
    bench.until(lambda: (made := window.result.result) is not None and made.test.test == test)
    return [painted_s - (wall_began_s + truth[n - 1]) for n, (_, painted_s) in painted.items()]


def memory(bench: Bench, effort: Effort) -> list[Figure]:
    """Growth of the window's memory on the live page."""
    minutes = float(os.environ.get("ROCKING_MEMORY_MINUTES", effort.of("1", "0.01")))
    warming_up_s = effort.of(WARMING_UP_S, 0.5)
    process = psutil.Process()
    bench.live_for(warming_up_s)
    gc.collect()
    before = process.memory_info().rss
    bench.live_for(60.0 * minutes)
    gc.collect()
    grown = (process.memory_info().rss - before) / 1e6
    note = f"over {minutes:g} min after {warming_up_s:g} s of warming up; rss before {before / 1e6:.0f} MB"
    return [Figure("memory growth of the window", grown, "MB", aim=20.0, note=note)]


def figures(effort: Effort) -> list[Figure]:
    """All figures of the window, on one acquisition."""
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder))
        try:
            found = [figure for size in effort.of(SIZES, SIZES[:1]) for figure in frames(bench, size, effort)]
            found += latency(bench, effort)
            found += memory(bench, effort)
        finally:
            bench.close()
    return found
