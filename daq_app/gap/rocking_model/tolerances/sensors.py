"""Tolerances of sensors: how well channels are calibrated, mounted and in time with each other."""

from __future__ import annotations

# -- calibration and mounts ------------------------------------------------------------------------
CALIBRATION = 3e-3
"""Relative sd of one channel's calibration. A certificate of 0.3 % (assumed, as in the rig file's remarks).

Raising it hides gain errors of single channels and of families below three times its value.
"""

CERTIFIED = 8.0
"""Channels of a family, 1, whose agreement says as much of their calibration as the certificate (assumed).

Raising it blames a gain where a whole family is calibrated worse than its certificate says.
"""

OTHER_WIRES = 2e-3
"""Relative sd of the calibration of the mean of some wires against that of all, 1 (assumed).

Raising it hides gain errors of the wires in runs in which one of them does not read.
"""

CROSSTALK = 5e-3
"""Relative sd of what a channel shows of the one that is scanned before it, both in shares of their ranges.

Multiplexed modules leave 0.1–1 % behind long cables (assumed). Raising it hides single channels that are off
in the shape of another family's signal.
"""

LEAKS_DIFFER = 0.25
"""Relative sd of one channel's crosstalk against that of others of the same modules, 1 (assumed).

It goes with the impedance of the source, which is alike for sensors of one make. Raising it hides anchors of
a wire that is scanned after an LVDT.
"""

LVDT_STRAIGHT = 2e-3
"""Sd, over half of the range, 1, of the square and of the cube by which one LVDT is not straight.

Assumed: 0.1 % of the range, where data sheets state 0.25 % at most. It counts where too few LVDTs read to
show how straight they are. Raising it hides springs, cables and edges that change the times of large swings
by less than a thousandth.
"""

STRAIGHTEST_LVDT = 5e-4
"""The same sd, 1, that one LVDT has at least, however little those of a face differ (assumed: 0.025 % of the
range).

Raising it hides the same, and edges of which one is round.
"""

PLAY_RAD = 1e-4
"""Prior sd of the play of the wires' drums in the rotation that they show together, rad.

Assumed: 0.02 % of a travel of 0.9 m, at a height of 2 m. Raising it hides small differences between the times
of fall and rise where the motion is read from the wires.
"""

MOUNT_RAD = 0.02
"""Sd of the angle, rad, by which an accelerometer is turned on its mount: a degree by eye (assumed).

Raising it hides gain errors of accelerometers along z and low on the wall, whose own signals are small.
"""

# -- tiltmeters ------------------------------------------------------------------------------------
TILT_CONSTANT = 0.25
"""Relative prior sd of a tiltmeter's time constant: data sheets leave it open by a half (two sd; assumed).

Raising it costs next to nothing: the runs tell the constant to some per cent.
"""

SHORTEST_TILT_S = 0.05
"""Least time constant, s, of a tiltmeter to which `TILT_CONSTANT` is relative: ten intervals of the grid.

Raising it leaves prompt tiltmeters more room than they need.
"""

# -- LVDTs that the joint is read from -------------------------------------------------------------
FEWEST_LVDTS = 6
"""LVDTs, 1, from which the joint is read: with fewer a wrong channel looks like a wall that twists.

Raising it refuses rigs with few LVDTs.
"""

LVDT_MISFIT = 0.02
"""Rms misfit of an LVDT over the rms opening of all, 1, up to which it stays in the joint (assumed).

What is off by less is named by the inspection. Raising it lets a bad channel turn the rotation.
"""

# -- time ------------------------------------------------------------------------------------------
SKEW_S = 1.5e-4
"""Sd of the time, s, by which channels of a family are sampled apart beyond what the task plan says.

Assumed: a module that is started by its own clock edge, or filters more than its neighbour. Raising it hides
restoring that differs between the sides of a wall below it.
"""

ELECTRONICS_S = 1.4e-3
"""Sd of the time, s, by which the electronics of one sound family are later than those of another.

Carrier amplifiers and filters of 100 to 500 Hz are late by 0.3 to 2.2 ms (assumed). Raising it hides late
families below three times its value.
"""

LATE_S = 2.5e-3
"""Delay, s, of one family against another from which a record is put in step before it is looked at closer.

Half a sample of the grid. Raising it leaves the shapes of late sensors in what is read beside them.
"""

RING_LATE_S = 5e-3
"""Delay, s, of a family from which the shock of an impact is left out that much longer.

Raising it takes the shock in late accelerometers for a ring-down.
"""

MOST_LATE_S = 0.08
"""Largest delay, s, of one family against another that is looked for (assumed).

Raising it costs time, and takes neighbouring half-cycles for each other at the end of a test.
"""

DELAY_FORM = 0.02
"""Share of a delay, 1, that a response of another form than a pure delay is told wrong by (assumed).

Raising it leaves long delays open.
"""

ACCELEROMETER_SPREAD_M = 0.5
"""Heights, m, over which accelerometers must be spread to tell rotation from what all of them show.

Raising it gives up the delay of accelerometers on low walls.
"""

SPREAD_ALONG_M = 0.2
"""Length along the wall, m, over which sensors must be spread to tell turning from bending (assumed).

Raising it gives up the turning of short walls.
"""

DELAY_WITHOUT_ONE = 3.0
"""Standard deviations, 1, by which a delay may change without one accelerometer.

Raising it lets one bad accelerometer decide.
"""
