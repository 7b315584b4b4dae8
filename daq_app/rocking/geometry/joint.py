"""The base joint from the LVDTs on both faces: opening profile, rotation, pivot, contact, twist.

Each face gets a straight line over the wall's length; the two lines give, at every instant, the
rotation (slope across the thickness), the neutral axis (where the opening is zero: the pivot), the
length in contact (from the neutral axis to the edge it turns on) and the twist (how the rotation
changes along the wall). Nothing is assumed about where the pivot is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import Channel, Rig

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_RANGE_MARGIN = 0.005
_PIVOT_FROM_RAD = 4e-3
"""Below this rotation the neutral axis is the quotient of two small numbers."""
_SUSPECT_RATIO = 6.0


@dataclass(frozen=True, slots=True)
class JointMotion:
    """State of the base joint at every sample, arrays (n,); NaN where too few LVDTs are in range."""

    rotation_rad: Floats
    neutral_axis_m: Floats
    """x of zero opening at mid length; NaN below 4 mrad."""
    contact_m: Floats
    """From the neutral axis to the edge on the pivot's side; NaN below 4 mrad."""
    twist_rad_per_m: Floats
    """Change of the rotation along y."""
    suspects: tuple[str, ...]
    """LVDTs left out because they do not fit the line of their face."""
    clipped: tuple[str, ...]
    """LVDTs that reached the end of their range at some time."""


@dataclass(frozen=True)
class BaseJoint:
    """LVDT geometry of a rig."""

    ids: tuple[str, ...]
    x_m: Floats
    y_m: Floats
    noise_m: Floats
    ranges_m: Floats
    """(lvdts, 2)"""
    half_width_m: float

    @classmethod
    def from_rig(cls, rig: Rig, ids: tuple[str, ...] | None = None) -> BaseJoint:
        """LVDTs of a rig; `ValueError` unless each face has at least two at different places."""
        channels: list[Channel] = [c for c in rig.of_family("lvdt") if ids is None or c.id in ids]
        position = np.array([channel.position_m for channel in channels], dtype=np.float64).reshape(-1, 3)
        for face, name in ((position[:, 0] < 0, "−x"), (position[:, 0] > 0, "+x")):
            if np.unique(position[face, 1]).size < 2:
                raise ValueError(f"the base joint needs two LVDTs or more along the face at {name}")
        return cls(
            tuple(channel.id for channel in channels),
            position[:, 0],
            position[:, 1],
            np.array([channel.noise_si for channel in channels]),
            np.array([channel.range_si for channel in channels]),
            rig.specimen.base_width_m / 2.0,
        )

    def motion(self, openings_m: Floats) -> JointMotion:
        """(lvdts, n) openings in m to the joint's motion."""
        low, high = self.ranges_m[:, :1], self.ranges_m[:, 1:]
        margin = _RANGE_MARGIN * (high - low)
        with np.errstate(invalid="ignore"):
            valid = (openings_m > low + margin) & (openings_m < high - margin)
        clipped = np.isfinite(openings_m) & ~valid
        suspects = self._suspects(openings_m, valid)
        valid &= ~suspects[:, None]
        left, right = self.x_m < 0, self.x_m > 0
        at_left, along_left = _line(self.y_m[left], openings_m[left], valid[left])
        at_right, along_right = _line(self.y_m[right], openings_m[right], valid[right])
        x_left, x_right = float(self.x_m[left].mean()), float(self.x_m[right].mean())
        width = x_right - x_left
        sine = (at_left - at_right) / width
        with np.errstate(invalid="ignore", divide="ignore"):
            rotation = np.arcsin(np.clip(sine, -1.0, 1.0))
            axis = np.where(np.abs(rotation) > _PIVOT_FROM_RAD, x_left + at_left / sine, np.nan)
        contact = self.half_width_m - axis * np.sign(rotation)
        return JointMotion(
            rotation_rad=rotation,
            neutral_axis_m=axis,
            contact_m=contact,
            twist_rad_per_m=(along_left - along_right) / width,
            suspects=tuple(np.array(self.ids)[suspects].tolist()),
            clipped=tuple(np.array(self.ids)[clipped.any(axis=1)].tolist()),
        )

    def rotation_noise_rad(self) -> float:
        """Expected white noise of the rotation, one sample, all LVDTs in range."""
        left, right = self.x_m < 0, self.x_m > 0
        variance = sum(
            float(np.sum(self.noise_m[face] ** 2)) / np.count_nonzero(face) ** 2 for face in (left, right)
        )
        return float(np.sqrt(variance) / (self.x_m[right].mean() - self.x_m[left].mean()))

    def _suspects(self, openings_m: Floats, valid: Bools) -> Bools:
        """LVDTs whose misfit to their face's line is far above that of their neighbours."""
        suspects = np.zeros(len(self.ids), dtype=bool)
        step = max(1, openings_m.shape[1] // 2000)
        some, mask = openings_m[:, ::step], valid[:, ::step]
        for face in (np.flatnonzero(self.x_m < 0), np.flatnonzero(self.x_m > 0)):
            good = list(face)
            # One at a time, worst first: a bad one drags the line and makes neighbours look bad.
            for _ in range(len(face) // 4):
                at, along = _line(self.y_m[good], some[good], mask[good])
                misfit = some[good] - at - self.y_m[good][:, None] * along
                misfit = np.where(mask[good], misfit, np.nan)
                seen = np.isfinite(misfit).any(axis=1)
                rms = np.full(len(good), np.inf)
                rms[seen] = np.sqrt(np.nanmean(misfit[seen] ** 2, axis=1))
                worst = int(np.argmax(rms))
                if len(good) <= 3 or rms[worst] <= _SUSPECT_RATIO * max(
                    float(np.median(rms)), self.noise_m[good[worst]]
                ):
                    break
                suspects[good.pop(worst)] = True
        return suspects


def _line(y_m: Floats, openings_m: Floats, valid: Bools) -> tuple[Floats, Floats]:
    """Opening at y = 0 and its slope along y, least squares over the valid LVDTs, per sample."""
    if valid.all():
        count = float(y_m.size)
        mean_y = float(y_m.mean())
        square = float(np.sum((y_m - mean_y) ** 2))
        along = (y_m - mean_y) @ openings_m / square
        return openings_m.sum(axis=0) / count - along * mean_y, along
    weight = valid.astype(np.float64)
    values = np.where(valid, openings_m, 0.0)
    s0, s1, s2 = weight.sum(axis=0), y_m @ weight, (y_m**2) @ weight
    t0, t1 = values.sum(axis=0), y_m @ values
    determinant = s0 * s2 - s1 * s1
    with np.errstate(invalid="ignore", divide="ignore"):
        good = (s0 >= 3) & (determinant > 1e-9)
        along = np.where(good, (s0 * t1 - s1 * t0) / determinant, np.nan)
        at = np.where(good, (s2 * t0 - s1 * t1) / determinant, np.nan)
    return at, along
