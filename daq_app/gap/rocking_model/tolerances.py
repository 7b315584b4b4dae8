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

MOUNT_RAD = 0.02
"""Sd of the angle, rad, by which an accelerometer is turned on its mount: a degree by eye (assumed).

Raising it hides gain errors of accelerometers along z and low on the wall, whose own signals are small.
"""

SKEW_S = 1.5e-4
"""Sd of the time, s, by which channels of a family are sampled apart beyond what the task plan says.

Assumed: a module that is started by its own clock edge, or filters more than its neighbour. Raising it hides
restoring that differs between the sides of a wall below it.
"""

# -- LVDTs that the joint is read from ------------------------------------------------------------
FEWEST_LVDTS = 6
"""LVDTs, 1, from which the joint is read: with fewer a wrong channel looks like a wall that twists.

Raising it refuses rigs with few LVDTs.
"""

LVDT_MISFIT = 0.02
"""Rms misfit of an LVDT over the rms opening of all, 1, up to which it stays in the joint (assumed).

What is off by less is named by the inspection. Raising it lets a bad channel turn the rotation.
"""

# -- release ---------------------------------------------------------------------------------------
RELEASE_SPEED_RAD_S = 1e-3
"""Speed, rad/s, that the form of the first motion (a cable that gives way, a slow sensor) may feign
(assumed).

Raising it hides walls that are pushed or thrown up at the release.
"""

PUSH_RAD_S = 3e-4
"""Speed, rad/s, that a clean release may leave: sd of the prior of each run (assumed).

Raising it hides releases with a speed.
"""

# -- delays of sensors -----------------------------------------------------------------------------
LATE_S = 2.5e-3
"""Delay, s, of one family against another from which a record is put in step before it is looked at closer.

Half a sample of the grid. Raising it leaves the shapes of late sensors in what is read beside them.
"""

DELAY_FORM = 0.02
"""Share of a delay, 1, that a response of another form than a pure delay is told wrong by (assumed).

Raising it leaves long delays open.
"""

ACCELEROMETER_SPREAD_M = 0.5
"""Heights, m, over which accelerometers must be spread to tell rotation from what all of them show.

Raising it gives up the delay of accelerometers on low walls.
"""

DELAY_WITHOUT_ONE = 3.0
"""Standard deviations, 1, by which a delay may change without one accelerometer.

Raising it lets one bad accelerometer decide.
"""

# -- wiring ----------------------------------------------------------------------------------------
REVERSED_BELOW = -0.4
"""Slope of a channel on what it should show, 1, below which it counts as reversed: −1 is, 0 is dead.

Raising it calls dead channels reversed.
"""

EXCHANGE_GAIN = 0.15
"""Share of the misfit, 1, that may be left once plugs are put back for them to count as exchanged (assumed).

Raising it calls channels with other faults exchanged.
"""

EXCHANGE_MISFIT = 0.03
"""Misfit of channels as a share of a signal, 1, from which an exchange is looked for.

Ten calibrations. Raising it overlooks neighbours that show nearly the same.
"""

EXCHANGE_EACH = 1e-3
"""Misfit, 1, that a channel must lose to count as moved: channels that show the same stay where they are."""

FAR_FROM_UPRIGHT = 0.25
"""Share of the largest rotation, 1, from which a reading is far enough from an impact to tell its channel."""

# -- ends of a range -------------------------------------------------------------------------------
IN_PROPORTION = (0.3, 0.85)
"""Part of a channel's travel, from … to, 1, over which it must be in proportion to the rotation.

Widening it takes the bend of a limit for a gain.
"""

LIMIT_SD = 0.01
"""Relative sd, 1, of the reading at which a channel stops."""

GOES_ON = 1.025
"""How much further than a channel the rotation must go on for it to be stopped, 1.

Above what gains differ by. Raising it overlooks limits just below the largest rotation.
"""

BEYOND_FAMILY = 1.02
"""How much further than those of its family that stop a channel may go that stops where they do, 1."""

# -- single channels -------------------------------------------------------------------------------
TURNED = 0.03
"""Share of the rotation, 1, that a second axis may show: a mount that is turned by 1.7° (assumed).

Raising it hides crosstalk of the instrument below it.
"""

MOUNT_SD = 0.01
"""Sd of that share, 1, for an instrument that is mounted with care (assumed)."""

COUNT_SD = 0.05
"""Sd of a count of channels, 1: far below one, so that one channel is significant."""

# -- floor -----------------------------------------------------------------------------------------
FLOOR_GAIN = 6.0
"""Gain in ln likelihood per run, 1, below which there is no vibration of the floor to speak of.

Raising it hides weak vibration; lowering it finds some in noise.
"""

# -- survey ----------------------------------------------------------------------------------------
FAR_FROM_SURVEY = 4.0
"""Prior sd, 1, by which α, p or the base may differ from the survey before the rig file is doubted.

Raising it lets a diagnosis with a wrong rig file name an effect.
"""
EITHER = 0.5
"""Probability, 1, of something unknown that far from the survey: the rig file is as likely wrong."""
