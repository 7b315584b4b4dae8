"""Orders of the operator during a test: choose a plan, stop, abort, set a mark, write a note."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from daq_app.acquisition.course.sequence import Sequence as Course
from daq_app.acquisition.course.voice.state_voice import StateVoice
from daq_app.acquisition.messages.items import Ask, End, RequestRefused


@dataclass(frozen=True, slots=True)
class Orders:
    """Carries an order out, or says why not (`RequestRefused`)."""

    voice: StateVoice
    finish: Callable[[End], None]
    """Ends the recording."""
    judge: Callable[[], None]
    """Judges the situation anew, and publishes it."""
    note: Callable[[str, str], None]
    """Writes (kind, text) into the journal."""

    def answer(self, ask: Ask, course: Course | None) -> tuple[str, dict[str, Any]]:
        """What the operator is told, and its data; `course` is that of the test being recorded."""
        match ask.name:
            case "plan":
                return self._choose(ask, course)
            case "stop":
                running = _recording(course)
                self.finish(running.end("stopped", self.voice.sample, "Stopped by the operator"))
                return "Stopped; the run is being saved", {}
            case "abort":
                return self._abort(_recording(course))
            case "marker" | "note":
                text = str(ask.arguments.get("text", "")).strip() or ask.name
                self.note(ask.name, text[:2000])
                return f"{ask.name} at sample {self.voice.sample}", {"sample": self.voice.sample}
        raise RequestRefused(f"There is no request '{ask.name}'")

    def _choose(self, ask: Ask, course: Course | None) -> tuple[str, dict[str, Any]]:
        if course is not None:
            raise RequestRefused(
                f"{self.voice.test} is being recorded: its plan is locked. Choose the next test then"
            )
        self.voice.plan = ask.arguments["plan"]
        self.judge()
        return f"{self.voice.plan.test or 'No test'} is chosen", {}

    def _abort(self, course: Course) -> tuple[str, dict[str, Any]]:
        if not course.before_release:
            raise RequestRefused(
                "The wall has been released: the test counts. Use stop to end the recording now"
            )
        self.finish(course.end("aborted", self.voice.sample, "Aborted by the operator before release"))
        return "Aborted; what was recorded is kept as an aborted run", {}


def _recording(course: Course | None) -> Course:
    if course is None:
        raise RequestRefused("No test is being recorded")
    return course
