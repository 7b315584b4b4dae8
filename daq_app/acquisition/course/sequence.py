"""The course of one test: armed → holding → released → rocking → at rest → ended. No threads, no files."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from daq_app.acquisition.messages.items import End, Outcome
from daq_app.acquisition.messages.published import State
from daq_app.config.rig import Acquisition
from daq_app.rocking.motion.phases import PhaseEvent


@dataclass(frozen=True, slots=True)
class Change:
    """A new state, and since which sample."""

    state: State
    sample: int
    text: str


class Sequence:
    """One test, from its arming on. Feed it the phase events of each block, in order."""

    def __init__(
        self,
        settings: Acquisition,
        rate_hz: float,
        armed_sample: int,
        release_within_s: float,
        *,
        armed: bool = True,
    ) -> None:
        """`armed` False: the run of a release that nobody armed; it begins with that release."""
        self.armed = armed
        self._settings = settings
        self._rate_hz = rate_hz
        self._armed_sample = armed_sample
        self._release_limit = armed_sample + release_within_s * rate_hz
        self.state = State.ARMED
        self.release_sample: int | None = None
        self.rest_sample: int | None = None
        self._held = False

    def advance(self, events: Iterable[PhaseEvent], sample: int) -> list[Change | End]:
        """What follows from these events and from samples having been read up to `sample`."""
        changes: list[Change | End] = []
        for event in events:
            changes.extend(self._after(event))
        end = self._due_end(sample)
        if end is not None:
            changes.append(end)
        return changes

    def arm(self, armed_sample: int) -> None:
        """The order to arm came just after the release: the run counts as armed."""
        self.armed, self._armed_sample = True, armed_sample

    def end(self, outcome: Outcome, sample: int, text: str) -> End:
        """The end that somebody asked for."""
        return End(outcome, sample, text)

    @property
    def before_release(self) -> bool:
        """Whether the wall has not been released yet: a test can still be aborted without being spent."""
        return self.release_sample is None

    def _after(self, event: PhaseEvent) -> list[Change | End]:
        sample = round(event.sample)
        match event.kind:
            case "hold" if self.state in (State.ARMED, State.HOLDING):
                self._held = True
                return [self._go(State.HOLDING, sample, event.text)]
            case "hold_lost" if self.state is State.HOLDING:
                return [self._go(State.ARMED, sample, f"{event.text}; still armed and recording")]
            case "release":
                self.release_sample = sample
                return [self._go(State.RELEASED, sample, self._release_text(event, sample))]
            case "caught" if self.state is State.RELEASED and not self.armed:
                return [End("aborted", sample, f"{event.text}; nobody had armed")]
            case "caught" if self.state is State.RELEASED:
                self.release_sample = None
                return [self._go(State.ARMED, sample, f"{event.text}; still armed and recording")]
            case "impact" if self.state in (State.RELEASED, State.HOLDING, State.ARMED):
                if self.release_sample is None:
                    self.release_sample = sample
                return [self._go(State.ROCKING, sample, "rocking")]
            case "rest" if self.release_sample is not None:
                self.rest_sample = sample
                return [self._go(State.AT_REST, sample, event.text)]
        return []

    def _release_text(self, event: PhaseEvent, sample: int) -> str:
        if not self.armed:
            return f"{event.text}; nobody had armed: kept from the ring"
        before_s = (sample - self._armed_sample) / self._rate_hz
        if before_s < self._settings.pre_trigger_s:
            return (
                f"{event.text}, only {before_s:.1f} s after arming: less than the "
                f"{self._settings.pre_trigger_s:g} s asked for lie before the release"
            )
        return event.text

    def _go(self, state: State, sample: int, text: str) -> Change:
        self.state = state
        return Change(state, sample, text)

    def _due_end(self, sample: int) -> End | None:
        settings = self._settings
        if self.rest_sample is not None:
            if sample >= self.rest_sample + settings.post_rest_s * self._rate_hz:
                return End("complete", sample, "The wall has come to rest")
        elif self.release_sample is not None:
            if sample >= self.release_sample + settings.max_duration_s * self._rate_hz:
                return End(
                    "timeout",
                    sample,
                    f"The wall has not come to rest within {settings.max_duration_s:g} s of its release",
                )
        elif sample >= self._release_limit:
            waited_s = (sample - self._armed_sample) / self._rate_hz
            return End("aborted", sample, f"No release within {waited_s:.0f} s of arming")
        return None
