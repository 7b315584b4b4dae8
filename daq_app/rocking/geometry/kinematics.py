"""Rotation of the wall from the wire potentiometers and the tiltmeters, by their true geometry.

The map of one wire and its inverse stand in `wires`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from daq_app.config.rig import Channel, Rig
from daq_app.rocking.geometry.wires import WireInverse, lever, wire_shortening
from daq_app.rocking.means import median_of_few, row_means

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_TWIST_PRIOR_RAD = 0.02
"""Plausible twist about the vertical axis: keeps the fit well posed when one end's wire is lost."""
_AGREEMENT_RAD = 1e-3
_AGREEMENT_RELATIVE = 0.03
"""Wires that differ from their median by more than this (plus noise) do not measure this wall."""


@dataclass(frozen=True, slots=True)
class WireRotation:
    """Result of combining the wires; arrays have one value per sample."""

    rotation_rad: Floats
    """(n,) weighted least-squares rotation; NaN where fewer than two wires are usable."""
    twist_rad: Floats
    """(n,) rotation of the top about the vertical axis, from wires at different y."""
    excluded: Bools
    """(wires, n) wires left out, because they are not finite or disagree with the others."""


@dataclass(frozen=True)
class WireGeometry:
    """Where each wire starts and ends, in the frame of the rig; arrays of shape (wires,)."""

    ids: tuple[str, ...]
    half_width_m: float
    position_m: Floats
    """(wires, 3) attachment on the wall, upright."""
    anchor_m: Floats
    """(wires, 3) fixed end."""
    noise_m: Floats
    length0_m: Floats

    @classmethod
    def of(cls, channels: tuple[Channel, ...], half_width_m: float) -> WireGeometry:
        """Geometry of wire channels; `ValueError` for a wire without anchor or of no length."""
        without = [channel.id for channel in channels if channel.anchor_m is None]
        if without:
            raise ValueError(f"wires need anchor_m to be turned into rotation: {', '.join(without)}")
        position = np.array([channel.position_m for channel in channels], dtype=np.float64).reshape(-1, 3)
        anchor = np.array([channel.anchor_m for channel in channels], dtype=np.float64).reshape(-1, 3)
        length = np.linalg.norm(anchor - position, axis=1)
        if np.any(length <= 0):
            raise ValueError("a wire's anchor coincides with its attachment: its length is zero")
        noise = np.array([channel.noise_si for channel in channels], dtype=np.float64)
        return cls(tuple(c.id for c in channels), half_width_m, position, anchor, noise, length)

    def shortening(self, rotation_rad: ArrayLike) -> Floats:
        """(wires, n) wire shortening in m at rotations (n,): the forward map."""
        return wire_shortening(rotation_rad, self.position_m, self.anchor_m, self.half_width_m)

    @cached_property
    def lever_m(self) -> Floats:
        """(wires,) ds/dθ in m/rad at upright, the mean of both sides."""
        return lever(self.position_m, self.anchor_m, self.half_width_m)

    def shortening_per_shift(self) -> Floats:
        """(wires,) ds/du for a small shift u of the whole wall towards +x: the wire's direction."""
        return np.asarray((self.anchor_m - self.position_m)[:, 0] / self.length0_m)

    def rotation_of_each(self, shortening_m: Floats) -> Floats:
        """(wires, n) rotation that each wire alone shows; NaN where no rotation explains the reading."""
        return self._inverse.rotation(shortening_m)

    @cached_property
    def _inverse(self) -> WireInverse:
        return WireInverse(self.position_m, self.anchor_m, self.half_width_m)


class WireWatch:
    """Remembers which wires failed: near upright a dead wire agrees with the others by chance.

    A wire that disagreed is left out for another `hold_off` frames; one that disagreed for
    `for_good` frames in a row does not come back.
    """

    def __init__(self, wires: int, *, hold_off: int = 100, for_good: int = 20) -> None:
        self._hold_off, self._for_good = hold_off, for_good
        self._run = np.zeros(wires, dtype=np.int64)
        self._wait = np.zeros(wires, dtype=np.int64)
        self.lost = np.zeros(wires, dtype=bool)

    def apply(self, agree: Bools) -> Bools:
        """(wires, frames) agreement in, usability out; frames are consecutive over calls."""
        if agree.all() and not (self._wait.any() or self.lost.any()):
            self._run[:] = 0
            return agree
        usable = agree.copy()
        for frame in range(agree.shape[1]):
            now = agree[:, frame]
            if not now.any():
                continue  # a gap in the record says nothing of any wire
            self._run = np.where(now, 0, self._run + 1)
            self._wait = np.where(now, np.maximum(self._wait - 1, 0), self._hold_off)
            self.lost |= self._run >= self._for_good
            usable[:, frame] = now & (self._wait == 0) & ~self.lost
            if np.count_nonzero(usable[:, frame]) < 2:
                usable[:, frame] = now
        return usable


@dataclass(frozen=True)
class RotationGeometry:
    """Everything that turns readings (SI) of a rig into the wall's rotation."""

    wires: WireGeometry
    tilt_ids: tuple[str, ...]
    """Tiltmeter channels that measure tilt towards x, the rotation."""
    frame_samples: int
    """Wires are checked against each other on means of this many samples."""
    _weights: dict[tuple[bool, ...], Floats] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def from_rig(cls, rig: Rig, *, frame_samples: int = 20) -> RotationGeometry:
        """Geometry of a rig. Raises `ValueError` where it has no wires or a wire without anchor."""
        wires = rig.of_family("wire")
        if not wires:
            raise ValueError("the rig has no wire potentiometers: rotation cannot be computed")
        return cls(
            wires=WireGeometry.of(wires, rig.specimen.base_width_m / 2.0),
            tilt_ids=tuple(c.id for c in rig.of_family("tiltmeter") if c.axis == "x"),
            frame_samples=frame_samples,
        )

    def weights(self, used: tuple[bool, ...] | None = None) -> Floats:
        """(2, wires) rows that give rotation and twist from the wires' own rotations.

        Weighted least squares of θ_i = θ − (y_i/z_i) ψ with the channels' noise, where z_i is the
        wire's lever ds/dθ, and a weak prior on the twist ψ.
        """
        mask = used if used is not None else (True,) * len(self.wires.ids)
        if mask not in self._weights:
            lever = self.wires.lever_m
            design = np.column_stack([np.ones(lever.size), -self.wires.position_m[:, 1] / lever])
            inverse_sigma = np.where(mask, np.abs(lever) / self.wires.noise_m, 0.0)
            weighted = design * inverse_sigma[:, None]
            normal = weighted.T @ weighted + np.diag([0.0, 1.0 / _TWIST_PRIOR_RAD**2])
            self._weights[mask] = np.linalg.solve(normal, weighted.T * inverse_sigma)
        return self._weights[mask]

    def rotation_noise_rad(self) -> float:
        """Expected white noise of the rotation, one sample, all wires good."""
        noise = self.wires.noise_m / np.abs(self.wires.lever_m)
        return float(np.sqrt(np.sum((self.weights()[0] * noise) ** 2)))

    def time_offset_s(self, offsets_s: Mapping[str, float]) -> float:
        """Instant that rotation sample k shows is k/rate plus this: the offsets weighted like the wires."""
        offsets = np.array([offsets_s.get(channel_id, 0.0) for channel_id in self.wires.ids])
        return float(self.weights()[0] @ offsets)

    def watch(self) -> WireWatch:
        """A memory of failed wires for one record."""
        return WireWatch(len(self.wires.ids))

    def rotation(self, shortening_m: Floats, watch: WireWatch | None = None) -> WireRotation:
        """Rotation from the wires' SI readings (wires, n), robust to a wire that fails.

        Wires are compared on whole frames of `frame_samples` (a last, shorter one included), so the
        answer does not depend on how a record is cut, as long as the cuts fall between frames and
        all pieces of the record share one `watch`.
        """
        own = self.wires.rotation_of_each(shortening_m)
        usable = (watch or self.watch()).apply(self._agreeing(own))
        if usable.all():
            rotation, twist = _combine(self.weights(), own)
            return WireRotation(rotation, twist, np.zeros(own.shape, dtype=bool))
        used = np.repeat(usable, self.frame_samples, axis=1)[:, : own.shape[1]]
        combined = np.full((2, own.shape[1]), np.nan)
        for pattern in np.unique(used, axis=1).T:
            columns = np.all(used == pattern[:, None], axis=0)
            if np.count_nonzero(pattern) >= 2:
                weights = self.weights(tuple(bool(flag) for flag in pattern))
                good = np.where(pattern[:, None], own[:, columns], 0.0)
                combined[:, columns] = _combine(weights, good)
        return WireRotation(combined[0], combined[1], ~used)

    def _agreeing(self, own: Floats) -> Bools:
        """(wires, frames) which wires agree with the median of all."""
        frames = -(-own.shape[1] // self.frame_samples)
        missing = frames * self.frame_samples - own.shape[1]
        padded = np.pad(own, ((0, 0), (0, missing)), mode="edge") if missing else own
        mean = row_means(padded.reshape(own.shape[0], frames, self.frame_samples))
        finite = np.isfinite(mean)
        if finite.all():
            middle = median_of_few(mean)
        else:
            middle = np.zeros(frames)
            some = finite.any(axis=0)
            middle[some] = np.nanmedian(mean[:, some], axis=0)
        noise = (self.wires.noise_m / np.abs(self.wires.lever_m))[:, None] / np.sqrt(self.frame_samples)
        tolerance = _AGREEMENT_RAD + _AGREEMENT_RELATIVE * np.abs(middle) + 6.0 * noise
        agree: Bools = finite & (np.abs(np.where(finite, mean, np.inf) - middle) <= tolerance)
        # A median of five needs three that agree; otherwise nobody is accused.
        accused = agree.sum(axis=0) * 2 <= finite.sum(axis=0)
        agree[:, accused] = finite[:, accused]
        return agree

    def tilt(self, tilt_rad: Floats, reference_rad: float | None = None) -> float:
        """Mean tilt towards x over the block (tiltmeters, n).

        Where two tiltmeters differ by more than they should, the one nearer `reference_rad` counts.
        """
        used = self.tilt_levels(tilt_rad, reference_rad)
        return float(used.mean()) if used.size else float("nan")

    def tilt_levels(self, tilt_rad: Floats, reference_rad: float | None = None) -> Floats:
        """(k,) mean over the block of each tiltmeter that counts in `tilt`."""
        means = row_means(tilt_rad) if tilt_rad.size else np.empty(0)
        means = means[np.isfinite(means)]
        if means.size < 2 or reference_rad is None:
            return means
        spread = 3.0 * _AGREEMENT_RAD + _AGREEMENT_RELATIVE * float(np.abs(means).max())
        return (
            means
            if means.max() - means.min() <= spread
            else means[[np.argmin(np.abs(means - reference_rad))]]
        )


def _combine(weights: Floats, own: Floats) -> Floats:
    """Row-by-row weighted sum: unlike a matrix product, the same bits however a record is cut."""
    total = np.zeros((weights.shape[0], own.shape[1]))
    for index in range(own.shape[0]):
        total += weights[:, index : index + 1] * own[index]
    return total
