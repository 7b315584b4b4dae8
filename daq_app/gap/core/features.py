"""Features of a run: numbers with a standard deviation and a label that says what they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Label:
    """Where a feature sits on the map of the gap."""

    channel: str
    """Channel or sensor family."""
    phase: str
    """``held``, ``release``, ``swing``, ``impact``, ``peak``, ``tail``, ``rest`` or the model's own."""
    observable: str
    """What is measured, e.g. ``half-cycle duration``."""
    unit: str = ""
    amplitude: float = 0.0
    """Size of the motion where the feature was read (model's choice of unit), with the sign of its side if it
    has two: trends with size and differences between the sides are looked for by it."""
    order: float = 0.0
    """Position in time within the run, 0 at the start and 1 at the end."""
    band: str = ""
    """Frequency band in words, where it makes sense."""


@dataclass(frozen=True, slots=True)
class FeatureSet:
    """What was measured in one run.

    `values` and `sd` have shape (n,); `sd` is measurement noise alone, without scatter of the
    specimen. `independent_fraction` is the share of the features that are independent of each other:
    1 for separately noisy features, less for samples of an autocorrelated trace; the log likelihood
    is scaled by it.
    """

    values: FloatArray
    sd: FloatArray
    labels: tuple[Label, ...]
    independent_fraction: float = 1.0

    @classmethod
    def of(cls, rows: Sequence[tuple[float, float, Label]]) -> FeatureSet:
        """From (value, sd, label) of each feature."""
        values = np.array([value for value, _, _ in rows], dtype=np.float64)
        sds = np.array([sd for _, sd, _ in rows], dtype=np.float64)
        return cls(values, sds, tuple(label for _, _, label in rows))

    def __post_init__(self) -> None:
        if (
            self.values.shape != self.sd.shape
            or self.values.ndim != 1
            or len(self.labels) != self.values.size
        ):
            raise ValueError(
                f"features need values, sd and labels of one length: "
                f"{self.values.shape}, {self.sd.shape}, {len(self.labels)}"
            )
        if not (np.all(np.isfinite(self.values)) and np.all(np.isfinite(self.sd)) and np.all(self.sd > 0)):
            raise ValueError("features must be finite and their standard deviations positive")
        if not 0 < self.independent_fraction <= 1:
            raise ValueError(f"independent_fraction must be in (0, 1], not {self.independent_fraction}")

    def __len__(self) -> int:
        return int(self.values.size)


@runtime_checkable
class Run(Protocol):
    """One recorded run as the core sees it; models attach more."""

    @property
    def name(self) -> str: ...

    @property
    def level(self) -> str:
        """Runs of one level repeat each other; whole levels can be held out."""
        ...

    @property
    def features(self) -> FeatureSet: ...


def robust_sd(deviations: FloatArray) -> float:
    """Sd of a Gaussian, of which most deviations from its middle, (n,), are, whatever a few others are."""
    return 1.48 * float(np.median(np.abs(deviations)))


def independent_fraction(residual: FloatArray) -> float:
    """Share of independent samples in an autocorrelated residual, (n,): 1/τ, τ = 1 + 2 Σ ρ_k.

    The sum runs to the first negative autocorrelation (Geyer, Practical Markov chain Monte Carlo,
    1992, in its simplest form), so that noise in the far lags does not enter.
    """
    centred = residual - residual.mean()
    n = centred.size
    if n < 4 or not np.any(centred):
        return 1.0
    size = next_fast_len(2 * n - 1, real=True)
    spectrum = np.fft.rfft(centred, size)
    covariance = np.fft.irfft(spectrum * np.conj(spectrum), size)[:n]
    rho = covariance / covariance[0]
    negative = np.flatnonzero(rho < 0)
    end = int(negative[0]) if negative.size else n
    tau = 1.0 + 2.0 * float(rho[1:end].sum())
    return float(min(1.0, 1.0 / tau))
