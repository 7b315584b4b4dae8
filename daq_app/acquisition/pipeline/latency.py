"""How long a block takes from the device to the disk."""

from __future__ import annotations

import threading
from collections import deque

import numpy as np


class Latency:
    """Milliseconds from the return of a read to its acknowledged place on disk; thread-safe."""

    def __init__(self, window: int = 3000) -> None:
        self._values_ms: deque[float] = deque(maxlen=window)
        self._lock = threading.Lock()
        self._worst_ms = 0.0

    def add(self, seconds: float) -> None:
        """Count one block."""
        with self._lock:
            self._values_ms.append(1e3 * seconds)
            self._worst_ms = max(self._worst_ms, 1e3 * seconds)

    def percentile_ms(self, percent: float) -> float:
        """Over the window (five minutes at ten reads a second); 0 before the first block."""
        with self._lock:
            values = list(self._values_ms)
        return float(np.percentile(values, percent)) if values else 0.0

    @property
    def worst_ms(self) -> float:
        return self._worst_ms
