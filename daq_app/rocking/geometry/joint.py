"""The base joint from the LVDTs on both faces: rotation, opening, pivot, contact, twist.

At every instant a point (x, y) of the joint is open by u − x sin θ − x y κ: u is the opening in the middle, θ
the rotation, κ its change along the wall. Where the opening is zero lies the neutral axis (the pivot), and
the joint is in contact from there to the edge that the wall turns on; where the pivot is, nobody assumes.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import Channel, Rig

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_RANGE_MARGIN = 0.005
"""Share of the range, at either end, in which a reading counts as cut off: calibrations are off by 1 %."""
_PIVOT_FROM_RAD = 4e-3
"""Below this rotation the neutral axis is the quotient of two small numbers."""
_OUTLIER_RATIO = 6.0
"""Times the median misfit of the others from which an LVDT is left out (assumed).

Raising it lets a loose one turn the joint."""
_FEWEST = 6
"""LVDTs that always stay: of fewer nobody can say which one is wrong."""


@dataclass(frozen=True, slots=True)
class JointMotion:
    """State of the base joint at every sample, arrays (n,); NaN where too few LVDTs are in range."""

    rotation_rad: Floats
    lift_m: Floats
    """Opening at the middle of the base."""
    neutral_axis_m: Floats
    """x of zero opening at mid length; NaN below 4 mrad."""
    contact_m: Floats
    """From the neutral axis to the edge on the pivot's side; NaN below 4 mrad."""
    twist_rad_per_m: Floats
    """Change of the rotation along y."""
    suspects: tuple[str, ...]
    """LVDTs left out because they do not fit the plane through the others."""
    clipped: tuple[str, ...]
    """LVDTs that reached the end of their range at some time."""


@dataclass(frozen=True)
class BaseJoint:
    """LVDT geometry of a rig."""

    ids: tuple[str, ...]
    position_m: Floats
    """(lvdts, 3) points of the wall that the LVDTs touch; z above the joint."""
    noise_m: Floats
    """(lvdts,)"""
    ranges_m: Floats
    """(lvdts, 2)"""
    half_width_m: float
    _inverses: dict[bytes, Floats] = field(default_factory=dict, repr=False, compare=False)
    """Those of `_inverse`, which cost a short stretch more than all else."""

    @classmethod
    def from_rig(cls, rig: Rig, ids: tuple[str, ...] | None = None) -> BaseJoint:
        """LVDTs of a rig; `ValueError` unless each face has at least two at different places."""
        channels: list[Channel] = [c for c in rig.of_family("lvdt") if ids is None or c.id in ids]
        position = np.array([channel.position_m for channel in channels], dtype=np.float64).reshape(-1, 3)
        joint = cls(
            tuple(channel.id for channel in channels),
            position,
            np.array([channel.noise_si for channel in channels]),
            np.array([channel.range_si for channel in channels]).reshape(-1, 2),
            rig.specimen.base_width_m / 2.0,
        )
        for side, name in ((-1, "−x"), (1, "+x")):
            if joint.places_on_face(side) < 2:
                raise ValueError(f"the base joint needs two LVDTs or more along the face at {name}")
        return joint

    @property
    def x_m(self) -> Floats:
        """(lvdts,) across the wall: negative on one face, positive on the other."""
        return self.position_m[:, 0]

    def places_on_face(self, side: int, used: Bools | slice = slice(None)) -> int:
        """Different y at which LVDTs stand on the face at −x (−1) or +x (1)."""
        position = self.position_m[used]
        return int(np.unique(position[np.sign(position[:, 0]) == side, 1]).size)

    def motion(self, openings_m: Floats) -> JointMotion:
        """(lvdts, n) openings in m to the joint's motion, from the LVDTs that are in range at each sample."""
        low, high = self.ranges_m[:, :1], self.ranges_m[:, 1:]
        margin = _RANGE_MARGIN * (high - low)
        valid = (openings_m > low + margin) & (openings_m < high - margin)
        partly = np.flatnonzero(~valid.all(axis=1))
        at_end = at_range_end(openings_m[partly], low[partly], high[partly])
        step = max(1, openings_m.shape[1] // 2000)
        left_out = self.find_outliers(openings_m[:, ::step], valid[:, ::step], self.noise_m)
        valid[left_out] = False
        lift, sine, twist = self._plane_of_valid(openings_m, valid)
        with np.errstate(invalid="ignore", divide="ignore"):
            rotation = np.arcsin(np.clip(sine, -1.0, 1.0))
            axis = np.where(np.abs(rotation) > _PIVOT_FROM_RAD, lift / sine, np.nan)
        ids = np.array(self.ids)
        return JointMotion(
            rotation_rad=rotation,
            lift_m=lift,
            neutral_axis_m=axis,
            contact_m=self.half_width_m - axis * np.sign(rotation),
            twist_rad_per_m=twist,
            suspects=tuple(ids[left_out].tolist()),
            clipped=tuple(ids[partly[at_end.any(axis=1)]].tolist()),
        )

    def _plane_of_valid(self, openings_m: Floats, valid: Bools) -> Floats:
        """(u, sin θ, κ), (3, n), each sample from the LVDTs that are valid (lvdts, n) at it."""
        if valid.all():
            return self.plane(openings_m)  # the usual case, at a third of the cost
        plane = np.full((3, openings_m.shape[1]), np.nan)
        changes = np.flatnonzero(np.any(valid[:, 1:] != valid[:, :-1], axis=0)) + 1
        starts = np.concatenate(([0], changes))[: plane.shape[1]]
        patterns, pattern_of_start = np.unique(valid[:, starts], axis=1, return_inverse=True)
        pattern = np.repeat(pattern_of_start, np.diff(starts, append=plane.shape[1]))
        for k, used in enumerate(patterns.T):
            if min(self.places_on_face(side, used) for side in (-1, 1)) >= 2:
                samples, openings = np.flatnonzero(pattern == k), openings_m[used]
                if samples.size < plane.shape[1]:
                    openings = openings.take(samples, axis=1)
                plane[:, samples] = self.plane(openings, used)
        return plane

    def plane(self, openings_m: Floats, used: Bools | slice = slice(None)) -> Floats:
        """(u, sin θ, κ), (3, n), least squares through the openings (k, n) of the k LVDTs `used`.

        A point at the height z above the joint sinks by z (1 − cos θ) as the wall turns, which is put back.
        """
        inverse = self._inverse(used)
        plane = inverse @ openings_m
        height = self.position_m[used, 2]
        if height.any():
            cosine = np.sqrt(1.0 - np.clip(plane[1], -1.0, 1.0) ** 2)
            plane += np.outer(inverse @ height, 1.0 - cosine)
        return plane

    def rotation_weights(self, used: Bools | slice = slice(None)) -> Floats:
        """d(sin θ)/d(opening) of the LVDTs `used`, (k,), 1/m."""
        return np.asarray(self._inverse(used)[1])

    def misfit(self, openings_m: Floats, used: Bools) -> Floats:
        """(k, n) what the plane through the openings (k, n) of the LVDTs `used` leaves of each, m."""
        return np.asarray(openings_m - self._design(used) @ (self._inverse(used) @ openings_m))

    def find_outliers(self, openings_m: Floats, valid: Bools, tolerated_m: Floats | float) -> list[int]:
        """Places of the LVDTs that do not fit the plane through the others.

        `openings_m`, `valid`: (lvdts, n); an LVDT that is never valid is not judged. `tolerated_m`: rms
        misfit, m, up to which an LVDT stays, whatever the others leave.
        """
        tolerated = np.broadcast_to(tolerated_m, len(self.ids))
        good = np.flatnonzero(valid.any(axis=1))
        found: list[int] = []
        # One at a time, worst first: a bad one turns the plane and makes its neighbours look bad.
        while good.size > _FEWEST:
            whole = valid[good].all(axis=0)
            if not whole.any():
                break
            openings = openings_m[good][:, slice(None) if whole.all() else whole]
            moments = openings @ openings.T / openings.shape[1]
            # Each beside what the others alone make of it.
            fitting = self._design(good) @ self._inverse(good)
            off = _rms_left(fitting, moments) / np.maximum(1.0 - np.diag(fitting), 1e-9)
            worst = int(np.argmax(off))
            others = np.delete(np.arange(good.size), worst)
            fitting = self._design(good[others]) @ self._inverse(good[others])
            usual = float(np.median(_rms_left(fitting, moments[np.ix_(others, others)])))
            if off[worst] <= max(_OUTLIER_RATIO * usual, tolerated[good[worst]]):
                break
            found.append(int(good[worst]))
            good = good[others]
        return found

    def _design(self, used: Bools | NDArray[np.intp] | slice) -> Floats:
        x, y, _ = self.position_m[used].T
        return np.column_stack([np.ones_like(x), -x, -x * y])

    def _inverse(self, used: Bools | NDArray[np.intp] | slice) -> Floats:
        """(3, k) from the openings of the k LVDTs `used` to (u, sin θ, κ), found once for each set."""
        key = np.arange(len(self.ids))[used].tobytes()
        if key not in self._inverses:
            self._inverses[key] = np.linalg.pinv(self._design(used)).astype(np.float64)
        return self._inverses[key]


def _rms_left(fitting: Floats, moments: Floats) -> Floats:
    """(k,) rms of what the plane through k openings leaves of each.

    `fitting` (k, k) makes the plane's openings of them; `moments` (k, k): their mean products.
    """
    leaves = np.eye(fitting.shape[0]) - fitting
    return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", leaves, moments, leaves).clip(min=0.0)))


def at_range_end(readings: Floats, low: Floats | float, high: Floats | float) -> Bools:
    """Whether readings, not zeroed, are at the end of their channel's range `low` … `high`; False for NaN."""
    margin = _RANGE_MARGIN * np.subtract(high, low)
    with np.errstate(invalid="ignore"):
        return np.asarray((readings <= low + margin) | (readings >= high - margin))
