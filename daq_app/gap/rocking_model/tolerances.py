"""Tolerances of the rocking model: quantity, unit, source, and what raising each does."""

from __future__ import annotations

CALIBRATION = 3e-3
"""Relative sd of one channel's calibration. A certificate of 0.3 % (assumed, as in the rig file's remarks).

Raising it hides gain errors of single channels and of families below three times its value.
"""

TILT_CONSTANT = 0.25
"""Relative prior sd of a tiltmeter's time constant: data sheets leave it open by a half (two sd; assumed).

Raising it costs next to nothing: the runs tell the constant to some per cent.
"""

CROSSTALK = 5e-3
"""Relative sd of what a channel shows of the one that is scanned before it, both in shares of their ranges.

Multiplexed modules leave 0.1–1 % behind long cables (assumed). Raising it hides single channels that are off
in the shape of another family's signal.
"""

SKEW_S = 1.5e-4
"""Sd of the time, s, by which channels of a family are sampled apart beyond what the task plan says.

Assumed: a module that is started by its own clock edge, or filters more than its neighbour. Raising it hides
restoring that differs between the sides of a wall below it.
"""
