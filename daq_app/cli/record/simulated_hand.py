"""The people at the simulated wall: pull it once the test is armed, hold it, let it go."""

from __future__ import annotations

from daq_app.acquisition.messages.published import HealthMessage, Message, State, StateMessage
from daq_app.config.rig import Rig
from sim_hardware.control import SimControl, SimControlError


class SimulatedHand:
    """Feed it the messages of the acquisition; times are samples, so that any speed is right."""

    def __init__(self, address: str, rig: Rig, theta0_over_alpha: float | None) -> None:
        self._control = SimControl(address)
        self._plan = rig.simulation
        self._level = theta0_over_alpha
        self._state = State.IDLE
        self._since = 0
        self._rate_hz = rig.acquisition.rate_hz
        self._pulled = self._released = False
        self.trouble = ""
        """What the simulator refused; empty when all is well."""

    def take(self, message: Message) -> None:
        """Act on what has become of the test."""
        match message:
            case StateMessage(state=state, since_sample=since, sample=sample):
                if state is not self._state:
                    self._state, self._since = state, since
                self._act(sample)
            case HealthMessage(sample=sample):
                self._act(sample)

    def _act(self, sample: int) -> None:
        waited_s = (sample - self._since) / self._rate_hz
        if self._state is State.ARMED and not self._pulled and waited_s >= self._plan.upright_s:
            self._pulled = True
            level = {} if self._level is None else {"theta0_over_alpha": self._level}
            self._tell("pull", duration_s=self._plan.pull_s, **level)
        elif self._state is State.HOLDING and not self._released and waited_s >= self._plan.hold_s:
            self._released = True
            self._tell("release")

    def _tell(self, name: str, **arguments: float | str) -> None:
        try:
            self._control.command(name, **arguments)
        except SimControlError as error:
            self.trouble = f"The simulated wall cannot be commanded: {error}"

    def close(self) -> None:
        """Hang up."""
        self._control.close()
