"""While the test runs: whether LVDTs, tiltmeters and accelerometers speak against the r of the wires.

Looked at after impacts, on what the other families showed meanwhile. Nothing is corrected: the analysis
after the test does that.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import Rig
from daq_app.config.wording import true_minus
from daq_app.rocking.estimators import RestitutionEstimate
from daq_app.rocking.families import words
from daq_app.rocking.families.block_checks import pattern_findings, survey_off
from daq_app.rocking.families.body import body_of
from daq_app.rocking.families.channels.compared_channels import ChannelMeans
from daq_app.rocking.families.channels.hysteresis import sticking_wire
from daq_app.rocking.families.levels import level_outlier
from daq_app.rocking.families.response import DRIFT_RAD, LATE_S, SLOW_S, Response, compare
from daq_app.rocking.families.shocks import LATE_SHOCKS_S, shock_timing
from daq_app.rocking.families.verdict import compare_series, families_apart, methods_apart
from daq_app.rocking.geometry.joint import BaseJoint
from daq_app.rocking.geometry.kinematics import RotationGeometry
from daq_app.rocking.motion.bending import find_bending
from daq_app.rocking.motion.impact_pattern import impact_pattern
from daq_app.rocking.motion.rolling import RollingArray
from daq_app.rocking.motion.swings import MotionTrack
from daq_app.rocking.motion.transients import Accelerations

Floats = NDArray[np.float64]

_MEMORY_S: Final = 8.0
"""How far back the families are kept: hold and first impacts are compared at once."""
_FOLLOWED_AT: Final = (1, 3, 5, 8, 11, 14, 17)
"""Impacts after which the LVDTs' half-cycles since the last of them are fitted: before values of r are
compared, and while their beginning is still kept. Several at once cost little more than one."""
_TIMED_AT: Final = (6, 12)
"""Impacts after which timing is looked at: it costs more than all else, and six impacts tell it."""
_COMPARED_AT: Final = (5, 8, 11, 14, 17)
"""Impacts after which values of r are compared; later half-cycles are small and tell little more."""
_SURVEYED_AT: Final = (8, 14)
"""Impacts after which α of the survey is asked about: fewer half-cycles know it worse than what is named."""
_HOLD_S: Final = 1.0
"""So much of the hold is shown to the other families."""


class LiveFamilies:
    """Doubts about the r of one motion after another, in sentences. Times in s, sample / rate."""

    def __init__(self, rig: Rig, rate_hz: float) -> None:
        self._rate = rate_hz
        self._joint: BaseJoint | None
        try:
            self._joint = BaseJoint.from_rig(rig)
        except ValueError:
            self._joint = None  # too few LVDTs for a profile: said after the test
        lvdts = () if self._joint is None else self._joint.ids
        self.ids = (*lvdts, *(channel.id for channel in rig.of_family("accelerometer")))
        """Channels that are looked at beside the wires and tiltmeters."""
        self._geometry = RotationGeometry.from_rig(rig).wires
        before = 1 + len(self._geometry.ids)
        self._wires = slice(1, before)
        self._lvdts = slice(before, before + len(lvdts))
        self._shaken = slice(before + len(lvdts), before + len(self.ids))
        self._log = RollingArray(round(_MEMORY_S * rate_hz), before + len(self.ids))
        self._first = 0
        self.forget()

    def forget(self) -> None:
        """A new release: what was found about the last one is gone."""
        self._track: MotionTrack | None = None
        self._release: tuple[str, ...] = ()
        self._level: tuple[str, ...] = ()
        self._bends = self._base_follows_badly = False
        self._timing: tuple[str, ...] = ()
        self._sticking: tuple[str, ...] = ()
        self._survey: tuple[str, ...] = ()
        self._values: tuple[str, ...] = ()

    def append(self, first_sample: int, rotation_rad: Floats, wires_m: Floats, values: Floats) -> None:
        """Rotation (n,) of the wires, what each shows (wires, n), SI values (ids, n) from a sample on."""
        if not self._log.end:
            self._first = first_sample
        self._log.append(rotation_rad[None], wires_m, values)

    def look(
        self, wires: MotionTrack, tilt_rad: float, eav: RestitutionEstimate, crt: RestitutionEstimate
    ) -> None:
        """Look for doubts after the last impact of `wires`, which gives these r.

        `tilt_rad`: θ0 of the tiltmeters, NaN without. Families that cannot be compared are told and do not
        stop the test's own analysis.
        """
        try:
            self._compare(wires, tilt_rad, eav, crt)
        except (ValueError, np.linalg.LinAlgError) as error:
            self._values = (f"the other families could not be compared with the wires ({error})",)

    @property
    def doubts(self) -> tuple[str, ...]:
        """What speaks against r, as far as was looked."""
        said = (*self._release, *self._level, *self._timing, *self._sticking, *self._survey, *self._values)
        return tuple(true_minus(sentence) for sentence in said)

    def _compare(
        self, wires: MotionTrack, tilt_rad: float, eav: RestitutionEstimate, crt: RestitutionEstimate
    ) -> None:
        """What is due after this impact."""
        impacts = len(wires.crossings_s)
        if impacts == 1 and not wires.fell_freely:
            self._release = (words.slow_release(wires.misfit_of_fall).text,)
        if self._joint is not None and impacts in _FOLLOWED_AT:
            self._follow(wires, tilt_rad, self._joint)
        if impacts in _TIMED_AT:
            self._timing = self._between_families(wires)
            if not self._bends:  # ringing moves the crossings of the wires: shocks then tell no delay
                self._timing += self._lag_of_shocks(wires)
            self._sticking = () if self._bends else self._stuck(wires)
        if impacts in _SURVEYED_AT:
            self._survey = self._alpha(self._wall(wires))
        if impacts in _COMPARED_AT:
            self._values = self._restitution(wires, eav, crt)

    def _follow(self, wires: MotionTrack, tilt_rad: float, joint: BaseJoint) -> None:
        """The half-cycles that ended, as the LVDTs show them; at the first, the level of the hold as well."""
        known = 0 if self._track is None else len(self._track.arcs)
        start_s = wires.crossings_s[known - 1] if known else wires.release.time_s - _HOLD_S
        time, kept = self._between(start_s, wires.crossings_s[-1])
        if time.size < 2:
            return
        rotation = joint.motion(kept[self._lvdts]).rotation_rad
        if self._track is None:
            if len(wires.crossings_s) > 1:
                return  # the release could not be looked at
            self._track = MotionTrack.begin(
                wires.settings, time, rotation, wires.release.time_s, wires.theta0_rad
            )
            levels = {"wires": wires.theta0_rad, "LVDTs": self._track.theta0_rad, "tiltmeters": tilt_rad}
            finding = level_outlier({name: level for name, level in levels.items() if math.isfinite(level)})
            self._level = () if finding is None else (finding.text,)
        self._track.add_impacts(wires.crossings_s[known:], time, rotation)

    def _restitution(
        self, wires: MotionTrack, eav: RestitutionEstimate, crt: RestitutionEstimate
    ) -> tuple[str, ...]:
        """Where wires and LVDTs, or EAV and CRT, give r that differ beyond their errors, and impacts do."""
        found = pattern_findings(impact_pattern(self._wall(wires)))
        # A nominal p or α that is 1 % off makes crossings look like a hop's: it is asked after the test.
        said = [methods_apart(eav, crt), *(f.text for f in found if f.kind != "hop")]
        lvdts = self._track
        if lvdts is not None and len(lvdts.arcs) == len(wires.arcs):
            pairs = (
                ("EAV", wires.eav_series(), lvdts.eav_series()),
                ("CRT", wires.crt_series(), lvdts.crt_series()),
            )
            said += [families_apart(method, compare_series(own, other)) for method, own, other in pairs]
        return tuple(sentence for sentence in said if sentence is not None)

    def _wall(self, wires: MotionTrack) -> MotionTrack:
        """The motion that the wall itself is judged by: wires on a wall that bends ring with it."""
        lvdts = self._track
        followed = lvdts is not None and len(lvdts.arcs) == len(wires.arcs)
        judge = self._bends and not self._base_follows_badly
        return lvdts if judge and followed and lvdts is not None else wires

    def _alpha(self, wall: MotionTrack) -> tuple[str, ...]:
        """A survey whose α is not that of the motion, where CRT is off by much."""
        off = survey_off(body_of(wall, 0.0), wall)
        return (words.alpha_while_live(off.share, off.shift),) if off is not None and off.is_notable else ()

    def _between_families(self, wires: MotionTrack) -> tuple[str, ...]:
        """Wires that ring about the LVDTs; wires and LVDTs that are slow or late, or drift apart."""
        if self._joint is None:
            return ()
        time, kept = self._between(wires.release.time_s - 0.3, wires.crossings_s[-1])
        rotation = self._joint.motion(kept[self._lvdts]).rotation_rad
        inside = [crossing for crossing in wires.crossings_s if crossing >= time[0]]
        bending, found = find_bending(time, kept[0], rotation, inside), None
        if bending is None:
            # A family that is slow or late leaves more between the two than ringing wires do.
            found = compare(time, rotation, kept[0])
            alike = None if found is None else found.made_alike(self._rate, rotation, kept[0])
            bending = None if alike is None else find_bending(time, alike[1], alike[0], inside)
        named = None if found is None else _slow_or_late(found)
        self._bends, self._base_follows_badly = bending is not None, named is not None and named[0] == "LVDTs"
        said = [] if named is None else [named[1]]
        if bending is not None:
            follow = not self._base_follows_badly
            text = words.bending_while_live(bending.frequency_hz, bending.rms_rad, lvdts_follow=follow)
            said.insert(0, text)
        elif found is not None and abs(found.drift_rad_s * found.span_s) > DRIFT_RAD:
            said.append(words.drift_while_live(found.drift_rad_s * found.span_s))
        return tuple(said)

    def _stuck(self, wires: MotionTrack) -> tuple[str, ...]:
        """One wire that lags behind the others by a length, whatever the speed."""
        _, kept = self._between(wires.release.time_s - 0.3, wires.crossings_s[-1])
        means = ChannelMeans.of(self._geometry.rotation_of_each(kept[self._wires]), self._rate)
        if means is None:
            return ()
        found = sticking_wire(means.means_rad, self._geometry.lever_m, self._geometry.noise_m)
        if found is None:
            return ()
        return (words.sticks_while_live(self._geometry.ids[found[0]], found[1].width_m),)

    def _lag_of_shocks(self, wires: MotionTrack) -> tuple[str, ...]:
        """Shocks that come elsewhere than the zero crossings of the wires."""
        start = self._log.start

        def read(low: int, high: int) -> Floats:
            return self._log.slice(start + low, start + high)[self._shaken]

        first_s = (self._first + start) / self._rate
        inside = [crossing for crossing in wires.crossings_s if crossing > first_s + 0.2]
        offsets = [0.0] * (self._shaken.stop - self._shaken.start)
        shown = Accelerations(read, self._log.end - start, self._rate, first_s, offsets)
        found = shock_timing(shown, inside)
        if found is None or abs(found.lag_s) <= LATE_SHOCKS_S:
            return ()
        if found.lag_s < 0:
            return (words.after_shocks_while_live(-found.lag_s),)
        return (words.late_while_live("accelerometers", found.lag_s, "the wires"),)

    def _between(self, start_s: float, stop_s: float) -> tuple[Floats, Floats]:
        """Times (n,) and rows (1 + wires + ids, n) from one time to another, cut to what is kept."""
        start = max(math.floor(start_s * self._rate) - self._first, self._log.start)
        stop = min(math.ceil(stop_s * self._rate) - self._first + 1, self._log.end)
        time = (self._first + np.arange(start, stop)) / self._rate
        return time, self._log.slice(start, stop)


def _slow_or_late(found: Response) -> tuple[str, str] | None:
    """The family that is slow or late against the other, and the sentence for it; None where none is."""
    if abs(found.response_s) > SLOW_S:
        slow = "wires" if found.response_s > 0 else "LVDTs"
        return slow, words.slow_while_live(slow, abs(found.response_s))
    if abs(found.delay_s) > LATE_S:
        later = "wires" if found.delay_s > 0 else "LVDTs"
        return later, words.late_while_live(later, abs(found.delay_s), "the other family")
    return None
