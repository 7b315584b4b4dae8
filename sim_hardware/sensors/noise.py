"""Noise as a function: the deviate of a terminal at an instant depends on nothing else.

Instants are counted in whole microseconds since power-on, k = round(10⁶ t); the deviate is a hash of
(key, k) turned into a normal one.  A sample asked for twice, alone or in a block, is the same.
"""

from __future__ import annotations

import hashlib
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from sim_hardware.jit import part

GRID_HZ: Final = 1e6
_BITS: Final = 12
_SIZE: Final = 1 << _BITS


def _quantiles() -> NDArray[np.float32]:
    """Normal quantiles at the middles of equal shares, scaled so that the sum of two has variance 1."""
    values = ndtri((np.arange(_SIZE) + 0.5) / _SIZE)
    return np.asarray(values / np.sqrt(2.0 * np.mean(values**2)), dtype=np.float32)


_TABLE: Final = _quantiles()
_MASK: Final = np.uint64(_SIZE - 1)


def key_of(seed: int, name: str, purpose: str = "noise") -> np.uint64:
    """64-bit key of a named stream."""
    digest = hashlib.blake2b(f"{seed}\0{name}\0{purpose}".encode(), digest_size=8).digest()
    return np.uint64(int.from_bytes(digest, "little"))


def generator(seed: int, name: str, purpose: str) -> np.random.Generator:
    """A generator for choices that are made once."""
    return np.random.Generator(np.random.Philox(key=int(key_of(seed, name, purpose))))


@part
def scramble(key: np.uint64, k: np.int64) -> np.uint64:
    """SplitMix64's finaliser of key + k·golden ratio: 64 bits that look random."""
    z = key + np.uint64(k) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@part
def deviate(key: np.uint64, t: float) -> float:
    """Standard normal deviate of the stream at `t` s (sum of two 12-bit ones: to 5.2 σ)."""
    z = scramble(key, np.int64(np.floor(t * GRID_HZ + 0.5)))
    return float(_TABLE[np.int64(z & _MASK)]) + float(_TABLE[np.int64((z >> np.uint64(_BITS)) & _MASK)])


@part
def share(key: np.uint64, k: np.int64) -> float:
    """Uniform number in [0, 1) of the stream at count `k`."""
    return float(scramble(key, k) >> np.uint64(11)) * (1.0 / 9007199254740992.0)
