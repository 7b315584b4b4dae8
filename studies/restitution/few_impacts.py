"""``python -m studies.restitution.few_impacts``: r from few peaks, by how much it may scatter beforehand.

Decays are drawn with an r of 0.82 to 0.94 that scatters from impact to impact, released at 0.15 to 0.4 of α,
with peaks known to 0.02 % of α. Counted is how often the 95 % interval of CRT holds r, and how wide it is,
for weights of the scatter that fall beyond the usual one more or less fast.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking import estimators
from daq_app.rocking.theory import classic

Floats = NDArray[np.float64]

_ALPHA_RAD: Final = 0.215
_PEAK_SHARE: Final = 2e-4
_USUAL: Final = 0.004
_SCATTERS: Final = (None, 0.01, 0.02)
"""Relative scatters of r; None: any from 0.1 to 0.6 %."""
WEIGHTS: Final[dict[str, Callable[[Floats], Floats]]] = {
    "power 1": lambda scatter: 1.0 / np.maximum(1.0, scatter / _USUAL),
    "power 1.5": lambda scatter: 1.0 / np.maximum(1.0, scatter / _USUAL) ** 1.5,
    "half-Cauchy": lambda scatter: 1.0 / (1.0 + (scatter / _USUAL) ** 2),
}


def scatter_weights(name: str) -> Floats:
    """Weights of `estimators.SCATTERS`, (k,), before the values are seen, by name."""
    return np.asarray(np.gradient(estimators.SCATTERS) * WEIGHTS[name](estimators.SCATTERS))


def decay(
    rng: np.random.Generator, points: int, scatter: float | None
) -> tuple[float, estimators.DecaySeries]:
    """True r of a drawn decay, and its CRT with so many points."""
    r, phi0 = float(rng.uniform(0.82, 0.94)), float(rng.uniform(0.15, 0.4))
    sigma = float(rng.uniform(0.001, 0.006)) if scatter is None else scatter
    falls = 2.0 * (math.log(r) + sigma * rng.standard_normal(points))
    log_energy = math.log(float(classic.energy(np.array(phi0)))) + np.concatenate(([0.0], np.cumsum(falls)))
    peaks = _ALPHA_RAD * (1.0 - np.sqrt(1.0 - np.exp(log_energy)))
    sigmas = np.full(peaks.size, _PEAK_SHARE * _ALPHA_RAD)
    seen = peaks + sigmas * rng.standard_normal(peaks.size)
    return r, estimators.crt_series(seen.tolist(), sigmas.tolist(), _ALPHA_RAD)


def main() -> None:
    """Print the share that holds and the median half width, a line for each weight and number of points."""
    parser = argparse.ArgumentParser(prog="python -m studies.restitution.few_impacts", description=__doc__)
    parser.add_argument("--points", type=int, nargs="*", default=(4, 6, 8, 12, 20))
    parser.add_argument("--decays", type=int, default=2000, help="of each scatter and number of points")
    parser.add_argument("--seed", type=int, default=2)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    for points in options.points:
        drawn = {
            scatter: [decay(rng, points, scatter) for _ in range(options.decays)] for scatter in _SCATTERS
        }
        for name in WEIGHTS:
            told = []
            for scatter, decays in drawn.items():
                estimates = estimators.estimate_all([series for _, series in decays], scatter_weights(name))
                intervals = [estimate.interval95() for estimate in estimates]
                known = [(r, i) for (r, _), i in zip(decays, intervals, strict=True) if i is not None]
                holds = float(np.mean([low <= r <= high for r, (low, high) in known]))
                half = float(np.median([(high - low) / 2.0 for _, (low, high) in known]))
                what = "0.1 to 0.6 %" if scatter is None else f"{scatter:.0%}"
                told.append(f"{what}: {holds:.1%} ± {half:.4f}")
            print(f"{points:2d} points, {name:12s} {'   '.join(told)}")


if __name__ == "__main__":
    main()
