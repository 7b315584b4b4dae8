"""The seam between the simulated device server and whatever is wired to its terminals."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class SignalSource(Protocol):
    """Analogue world behind the terminals, as a function of time since power-on of the simulation.

    Deterministic: the same source asked twice for the same samples answers the same volts, in
    whatever pieces it is asked.
    """

    def volts(self, terminals: tuple[str, ...], times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Ideal (unquantised) volts of shape (len(terminals), len(times_s)).

        `terminals` are physical channels such as ``cDAQ1Mod1/ai0``; a terminal with nothing wired
        to it floats near 0 V, or is NaN throughout: the device then shows what NI's simulated devices
        show. `times_s` ascend. For native LVDT and IEPE terminals too the value is
        the electrical one (volts; volts per volt of excitation for LVDTs): the device scales.
        """
        ...

    def advance(self, time_s: float) -> None:
        """The clock has reached `time_s`: scripted and commanded changes up to then may be fixed."""
        ...

    def command(self, name: str, arguments: dict[str, float | str]) -> dict[str, object]:
        """Act on the simulated world (pull, release, hammer, fault …) and answer with its state.

        Raises `ValueError` in words for a command or argument that is not known.
        """
        ...


class NothingWired:
    """No world at all: every terminal is open. Keeps `SignalSource`."""

    def volts(self, terminals: tuple[str, ...], times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """NaN throughout, shape (len(terminals), len(times_s))."""
        return np.full((len(terminals), len(times_s)), np.nan)

    def advance(self, time_s: float) -> None:
        """Nothing here depends on commands."""

    def command(self, name: str, arguments: dict[str, float | str]) -> dict[str, object]:
        """`status` and `reset` do nothing; `ValueError` for all others."""
        if name in ("status", "reset"):
            return {"state": "nothing wired"}
        raise ValueError(f"nothing is wired to this bench: it cannot {name}")
