"""Live figures of the samples: computed by `daq_app.rocking`, published to viewers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from daq_app.acquisition.course.judged_rotation import STILL_RAD_S, JudgedRotation
from daq_app.acquisition.course.unheld_release import UnheldReleaseWatch
from daq_app.acquisition.messages.published import BlockMessage, EstimateMessage, MotionMessage
from daq_app.acquisition.messages.publisher import Publisher
from daq_app.config.rig import Rig
from daq_app.config.scaling import Scaling
from daq_app.rocking.live import Estimate, LiveAnalyser, LiveResult
from daq_app.rocking.motion.phases import Phase, PhaseEvent
from drivers import Block

_MOTION_RATE_HZ: Final = 500.0
"""Rotation and velocity are shown at about this rate: fine enough for the shape of an impact."""
_LEFT_SHARE: Final = 0.98
"""Share of the rotation of a hold below which the wall has left it; lowering it sees a release later."""
_LEAVES_RAD_S: Final = 0.01
"""Speed towards upright with which a wall leaves its hold: ten times the noise of the speed, and what a fall
has after 50 ms."""
_FALLS_RAD_S: Final = 0.06
"""The same of a wall that was not held: simulated pulls sway back with up to 0.05 rad/s, a fall is as fast
after a tenth of a second. Assumed; lowering it stops a jerky pull again and again."""


class LiveView:
    """One analyser and what it publishes. A new one for each zero and for each test."""

    def __init__(self, rig: Rig, rate_hz: float, tare: Mapping[str, float], publisher: Publisher) -> None:
        self._rate_hz = rate_hz
        self._publisher = publisher
        self._scaling = Scaling.of(rig.channels, tare)
        self._analyser: LiveAnalyser | None = LiveAnalyser(rig, rate_hz, tare, self._publish_estimate)
        self._step = max(1, round(rate_hz / _MOTION_RATE_HZ))
        self._unheld = UnheldReleaseWatch(rig, rate_hz)
        self._judged = JudgedRotation(rig)
        self.rotation_rad = math.nan
        """The rotation that a pull is judged by, after the last block."""
        self._inwards_rad_s = 0.0
        """Speed towards upright at that instant."""
        self._held_rad = 0.0
        """Where the wall was held still last."""
        self.held_since: int | None = None
        """Sample from which on the wall has been held still; None while it is not."""
        self.estimate: Estimate | None = None
        """The newest whole estimate of this test, as it was published."""
        self.trouble = ""
        """A sentence on the analysis after the last `show`; empty when all is well."""
        self._excluded: tuple[str, ...] = ()

    def analyse(self, block: Block) -> tuple[PhaseEvent, ...]:
        """Analyse a block and publish what follows from it; answers what happened in it."""
        self.trouble = ""
        if self._analyser is None:
            return ()
        try:
            result = self._analyser.process(block.first_sample, block.readings)
        except Exception as error:
            # The recording does not need the analysis: go on without it, and say so.
            self._analyser = None
            self.trouble = (
                f"The live analysis failed ({type(error).__name__}: {error}). Recording goes on; release and "
                "rest are not detected any more: stop by hand, and analyse the run afterwards"
            )
            return ()
        self.rotation_rad = self._judge(result)
        self._publish(result)
        if result.excluded_wires != self._excluded:
            self._excluded = result.excluded_wires
            if self._excluded:
                self.trouble = f"These wires disagree with the others: {', '.join(self._excluded)}"
        events = result.events + self._follow_unheld(result)
        for event in events:
            if event.kind == "hold":
                self.held_since = round(event.sample)
            elif event.kind in ("hold_lost", "release"):
                self.held_since = None
        if self.held_since is not None and abs(self._inwards_rad_s) < STILL_RAD_S:
            self._held_rad = self.rotation_rad
        return events

    @property
    def goes_back(self) -> bool:
        """Whether the wall moves back from its hold, or faster than one sways that is being pulled."""
        left = self.held_since is not None and abs(self.rotation_rad) < _LEFT_SHARE * abs(self._held_rad)
        return self._inwards_rad_s > (_LEAVES_RAD_S if left else _FALLS_RAD_S)

    def _judge(self, result: LiveResult) -> float:
        if not result.rotation_rad.size:
            return self.rotation_rad
        self._inwards_rad_s = -float(result.velocity_rad_s[-1] * np.sign(result.rotation_rad[-1]))
        return self._judged.of_block(
            float(result.rotation_rad[-1]),
            float(np.max(np.abs(result.velocity_rad_s))),
            result.tilt_rad,
            result.rotation_rad.size / self._rate_hz,
            free=result.phase not in (Phase.WAITING, Phase.HOLDING),
        )

    def _follow_unheld(self, result: LiveResult) -> tuple[PhaseEvent, ...]:
        """A wall that moves freely without having been held: the phase detector knows nothing of it."""
        if result.phase is not Phase.WAITING:
            self._unheld.reset()
            return ()
        return self._unheld.process(result.first_sample, result.rotation_rad, result.velocity_rad_s)

    @property
    def released(self) -> bool:
        """Whether the wall has been let go since this view began: the next test needs a new one."""
        return self.moves or (self._analyser is not None and self._analyser.phase is Phase.AT_REST)

    @property
    def moves(self) -> bool:
        """Whether the wall has been let go and does not rest yet."""
        return self._unheld.rocks or (
            self._analyser is not None and self._analyser.phase in (Phase.FALLING, Phase.ROCKING)
        )

    def publish_block(self, block: Block, overloaded: tuple[str, ...]) -> None:
        """Publish the block itself: after all else, since nobody waits for it."""
        heading = BlockMessage(
            first_sample=block.first_sample,
            n_samples=block.n_samples,
            n_channels=int(block.readings.shape[0]),
            rate_hz=self._rate_hz,
            overloaded=overloaded,
        )
        si = np.ascontiguousarray(self._scaling.to_si(block.readings), dtype="<f4")
        self._publisher.send("block", heading, si.tobytes())

    def _publish_estimate(self, estimate: Estimate) -> None:
        self.estimate = estimate
        self._publisher.send("estimate", EstimateMessage.model_validate(estimate.as_message()))

    def _publish(self, result: LiveResult) -> None:
        if result.estimate is not None and result.estimate != self.estimate:
            self._publish_estimate(result.estimate)
        start = -result.first_sample % self._step
        rotation = result.rotation_rad[start :: self._step]
        if rotation.size:
            motion = MotionMessage(
                first_sample=result.first_sample + start,
                step=self._step,
                rate_hz=self._rate_hz,
                rotation_rad=rotation.tolist(),
                velocity_rad_s=result.velocity_rad_s[start :: self._step].tolist(),
                judged_rad=self.rotation_rad,
            )
            self._publisher.send("motion", motion)
