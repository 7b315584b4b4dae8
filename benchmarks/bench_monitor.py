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

from benchmarks.figure import Figure

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

RIG = Path(__file__).parents[1] / "configs" / "fr1.toml"
SIZES = ((1366, 768), (1920, 1080))
FRAMES_S = 10.0


class Bench:
    """A window, its acquisition and its wall."""

    def __init__(self, folder: Path) -> None:
        from daq_app.acquisition.launcher import AcquisitionProcess
        from daq_app.acquisition.messages import State
        from daq_app.monitor.app import application, open_window
        from daq_app.monitor.settings import WindowSettings
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

    def until(self, condition: Callable[[], bool], limit_s: float = 180.0, step_s: float = 0.001) -> None:
        """Let the window live until something is so."""
        end = time.monotonic() + limit_s
        while not condition():
            if time.monotonic() > end:
                raise TimeoutError("the window did not get there in time")
            self.app.processEvents()
            time.sleep(step_s)

    def live_for(self, seconds: float) -> None:
        """Let the window live for some time."""
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() > end, limit_s=seconds + 60.0)

    def close(self) -> None:
        """End window and acquisition."""
        self.window.close()
        self.acquisition.kill()


def frames(bench: Bench, size: tuple[int, int]) -> list[Figure]:
    """Painted frames of the two large plots and of the strips per second, CPU and longest stall."""
    window = bench.window
    window.resize(*size)
    bench.live_for(2.0)
    plots = (window.live.motion.rotation, window.live.motion.velocity)
    before = [plot.paints for plot in plots]
    strips = window.live.strips.paints
    window.longest_stall_s = 0.0
    started, cpu = time.monotonic(), time.process_time()
    bench.live_for(FRAMES_S)
    elapsed, used = time.monotonic() - started, time.process_time() - cpu
    rate = min(plot.paints - count for plot, count in zip(plots, before, strict=True)) / elapsed
    place = f"{size[0]}×{size[1]}"
    return [
        Figure(f"large plots, {place}", rate, "frames/s", aim=30.0, better="high"),
        Figure(
            f"41 strips, {place}",
            (window.live.strips.paints - strips) / elapsed,
            "frames/s",
            aim=5.0,
            better="high",
        ),
        Figure(f"longest stall of the window, {place}", 1e3 * window.longest_stall_s, "ms", aim=200.0),
        Figure(f"CPU of the window, {place}", 100.0 * used / elapsed, "% of a core", note=_load()),
    ]


def _load() -> str:
    """How busy the machine was beside: other work takes frames away."""
    return f"load {psutil.getloadavg()[0]:.1f} on {psutil.cpu_count()} cores"


def latency(bench: Bench) -> list[Figure]:
    """From each impact of a release test to the paint of the r that it completes."""
    window, session = bench.window, bench.window.session
    assert window.link is not None
    window.link.request("tare")
    bench.until(lambda: bool(window.prepare.zero.record))
    window.link.request("arm", {"test": "FR1-L3-1"})
    bench.until(lambda: session.current_state is bench.states.ARMED)
    bench.wall.command("pull", theta0_over_alpha=0.35)
    # The hold is recognised by itself; what was sampled earliest after its instant sets the clock.
    offset = np.inf
    seen = -1

    def clock() -> None:
        nonlocal offset, seen
        if session.newest_sample != seen:
            seen = session.newest_sample
            offset = min(offset, time.monotonic() - seen / session.rate_hz)

    def held() -> bool:
        clock()
        return session.current_state is bench.states.HOLDING

    bench.until(held)
    bench.live_for(1.0)
    bench.wall.command("release")
    delays: list[float] = []
    shown = 0
    plot = window.live.restitution.plot

    def watch() -> bool:
        nonlocal shown
        clock()
        estimate = session.estimate
        points = 0 if estimate is None else len(estimate.eav) + len(estimate.crt)
        drawn = sum(window.live.restitution.shown.values()) == points
        if (
            estimate is not None
            and points > shown
            and drawn
            and plot.painted_s > window.live.estimate_drawn_s
        ):
            shown = points
            impact_s = estimate.impact_samples[-1] / session.rate_hz + offset
            delays.append(plot.painted_s - impact_s)
        return session.current_state in (bench.states.SAVING, bench.states.SAVED)

    bench.until(watch)
    if not delays:
        raise RuntimeError(f"no r came to the screen; the window says {window.header.words}")
    milliseconds = 1e3 * np.asarray(delays)
    note = "clock set by the earliest block: includes the 100 ms read period, not the few ms of its way"
    return [
        Figure(
            "impact to r on screen, p50",
            float(np.percentile(milliseconds, 50)),
            "ms",
            len(delays),
            300.0,
            note=note,
        ),
        Figure(
            "impact to r on screen, p99",
            float(np.percentile(milliseconds, 99)),
            "ms",
            len(delays),
            300.0,
            note=note,
        ),
    ]


def memory(bench: Bench) -> list[Figure]:
    """Growth of the window's memory on the live page."""
    minutes = float(os.environ.get("ROCKING_MEMORY_MINUTES", "1"))
    process = psutil.Process()
    bench.live_for(15.0)
    gc.collect()
    before = process.memory_info().rss
    bench.live_for(60.0 * minutes)
    gc.collect()
    grown = (process.memory_info().rss - before) / 1e6
    note = f"over {minutes:g} min after 15 s of warming up; rss before {before / 1e6:.0f} MB"
    return [Figure("memory growth of the window", grown, "MB", aim=20.0, note=note)]


def figures() -> list[Figure]:
    """All figures of the window, on one acquisition."""
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder))
        try:
            found = [figure for size in SIZES for figure in frames(bench, size)]
            found += latency(bench)
            found += memory(bench)
        finally:
            bench.close()
    return found
