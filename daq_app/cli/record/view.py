"""A running test in the terminal: a live panel on a terminal, one line per event elsewhere."""

from __future__ import annotations

import math
from types import TracebackType
from typing import Any, Final, Self

from rich.console import Group
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from daq_app.acquisition.course.tare import UNZEROED
from daq_app.acquisition.messages.published import (
    EstimateMessage,
    EventMessage,
    HealthMessage,
    Message,
    MotionMessage,
    State,
    StateMessage,
)
from daq_app.cli.terminal import Console

_BAR_CELLS: Final = 61
_SHOWN_IMPACTS: Final = 12
_STYLE: Final = {
    State.ARMED: "yellow",
    State.HOLDING: "bold yellow",
    State.RELEASED: "bold magenta",
    State.ROCKING: "bold magenta",
    State.AT_REST: "bold green",
    State.SAVED: "bold green",
    State.FAILED: "bold red",
}


class RunView:
    """Feed it messages; use as a context manager."""

    def __init__(self, console: Console, test: str, about: dict[str, Any]) -> None:
        self._console = console
        self._test = test
        self._rate_hz = float(about.get("rate_hz") or 0.0)
        self.state = State.IDLE
        self.last_text = ""
        """The newest sentence of the state."""
        self._health: HealthMessage | None = None
        self._estimate: EstimateMessage | None = None
        self._rotation_rad = math.nan
        self.zeroed = bool(about.get("tare"))
        """Whether the live r rests on a zero."""
        self._told_impacts = 0
        self._live = Live(console=console, refresh_per_second=8) if console.is_terminal else None

    def __enter__(self) -> Self:
        if self._live is not None:
            self._live.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live is not None:
            self._live.update(self._panel())
            self._live.__exit__(kind, error, trace)

    def say(self, text: str, style: str = "") -> None:
        """One line above the panel."""
        self._console.print(Text(text, style=style))

    def take(self, message: Message) -> None:
        """Take in one message and show what it changes."""
        match message:
            case StateMessage():
                self._on_state(message)
            case HealthMessage():
                self._health = message
            case MotionMessage(judged_rad=rotation_rad, rate_hz=rate):
                self._rate_hz = rate
                self._rotation_rad = rotation_rad
            case EstimateMessage():
                self._on_estimate(message)
            case EventMessage(kind="tare"):
                self.zeroed = True
            case EventMessage(severity="warning" | "error" as severity, text=text):
                self.say(text, "bold red" if severity == "error" else "yellow")
        if self._live is not None:
            self._live.update(self._panel())

    def _on_state(self, message: StateMessage) -> None:
        if message.state is not self.state or message.text != self.last_text:
            if message.state is State.RELEASED and self.state is not State.RELEASED:
                self._warn_without_zero()
            self.state, self.last_text = message.state, message.text
            if self._live is None:
                at = f"{message.since_sample / self._rate_hz:8.2f} s  " if self._rate_hz else ""
                self.say(f"{at}{message.state.value}: {message.text}")

    def _on_estimate(self, message: EstimateMessage) -> None:
        told = self._estimate.doubts if self._estimate is not None else ()
        self._estimate = message
        count = len(message.impact_samples)
        if self._live is None and count > self._told_impacts:
            self._told_impacts = count
            at = message.impact_samples[-1] / self._rate_hz
            self.say(f"{at:8.2f} s  impact {count}: r EAV {_r(message.eav_mean)}  CRT {_r(message.crt_mean)}")
            for doubt in message.doubts:
                if doubt not in told:
                    self.say(f"r is in doubt: {doubt}", "yellow")

    # -- the panel -------------------------------------------------------------------------------

    def _panel(self) -> Panel:
        heading = Text.assemble(
            (self.state.value.replace("_", " ").upper(), _STYLE.get(self.state, "cyan")),
            f"  {self.last_text}",
        )
        parts: list[Text | Table] = [heading, self._bar(), self._figures()]
        if self._estimate is not None and self._estimate.impact_samples:
            parts.append(self._impacts(self._estimate))
            parts += [Text(doubt, style="yellow") for doubt in self._estimate.doubts]
            if not self.zeroed:
                parts.append(Text(UNZEROED, style="yellow"))
        return Panel(Group(*parts), title=Text(self._test), title_align="left")

    def _bar(self) -> Text:
        """Rotation as a mark on a scale of ± θ0 (or 100 mrad before the release)."""
        theta0 = abs(self._estimate.theta0_rad) if self._estimate else 0.1
        reach = 1.1 * theta0 if math.isfinite(theta0) and theta0 > 0 else 0.1
        cells = ["·"] * _BAR_CELLS
        middle = _BAR_CELLS // 2
        cells[middle] = "│"
        if math.isfinite(self._rotation_rad):
            share = max(-1.0, min(1.0, self._rotation_rad / reach))
            cells[middle + round(share * middle)] = "█"
        return Text(f"θ {_mrad(self._rotation_rad)}  {''.join(cells)}")

    def _figures(self) -> Text:
        health = self._health
        if health is None:
            return Text("waiting for samples")
        at = f"{health.sample / self._rate_hz:.1f} s" if self._rate_hz else f"{health.sample} samples"
        if not health.recording:
            return Text(f"{at} sampled, not recording")
        safe = f"{health.acknowledged_sample / self._rate_hz:.1f} s" if self._rate_hz else "?"
        lost = f"  LOST {health.lost_samples} samples" if health.lost_samples else "  none lost"
        return Text(
            f"{at} sampled, safe on disk to {safe}{lost}, in {health.block_to_disk_ms_p99:.0f} ms (99 %)"
        )

    def _impacts(self, estimate: EstimateMessage) -> Table:
        table = Table(box=None, padding=(0, 2, 0, 0))
        for column in ("impact", "time s", "speed rad/s", "peak after mrad", "r EAV", "r CRT"):
            table.add_column(column, justify="right")
        eav = {point.impact: point.r for point in estimate.eav}
        crt = {point.impact: point.r for point in estimate.crt}
        count = len(estimate.impact_samples)
        for index in range(max(0, count - _SHOWN_IMPACTS), count):
            speeds, peaks = estimate.impact_velocities_rad_s, estimate.peaks_rad
            table.add_row(
                str(index + 1),
                f"{(estimate.impact_samples[index] - estimate.release_sample) / self._rate_hz:.3f}",
                f"{speeds[index]:+.4f}" if index < len(speeds) else "",
                f"{1e3 * peaks[index + 1]:+.2f}" if index + 1 < len(peaks) else "",
                _r(eav.get(index + 1)),
                _r(crt.get(index + 1)),
            )
        table.add_section()
        table.add_row("", "", "", "mean", _r(estimate.eav_mean), _r(estimate.crt_mean))
        return table

    def _warn_without_zero(self) -> None:
        if not self.zeroed:
            self.say(UNZEROED, "yellow")


def _r(value: float | None) -> str:
    return "–" if value is None or not math.isfinite(value) else f"{value:.4f}"


def _mrad(value: float) -> str:
    return f"{1e3 * value:+8.2f} mrad" if math.isfinite(value) else "       – mrad"
