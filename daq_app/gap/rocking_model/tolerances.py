"""Tolerances of the rocking model: quantity, unit, source, and what raising each does."""

from __future__ import annotations

from daq_app.config.rig import Family

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

OTHER_WIRES = 2e-3
"""Relative sd of the calibration of the mean of some wires against that of all, 1 (assumed).

Raising it hides gain errors of the wires in runs in which one of them does not read.
"""

# -- motion ----------------------------------------------------------------------------------------
SMALLEST_RAD = 2e-3
"""Peak, rad, from which half-cycles are used (assumed).

Raising it refuses records of low levels, and leaves fewer half-cycles of the others.
"""

AS_FROM_REST = 0.01
"""Relative difference, 1, of the first fall's speed up to which it counts as a fall from rest (assumed).

Raising it takes a slow release for a clean one where kicks at impacts are looked for.
"""

SWAY_SHARE = 0.005
"""Acceleration of the sway over that of gravity, 1, up to which a held wall shows gravity alone (assumed).

Raising it takes the sway of a held wall for a gain of the accelerometers.
"""

SHORTEST_TILT_S = 0.05
"""Least time constant, s, of a tiltmeter to which `TILT_CONSTANT` is relative: ten intervals of the grid.

Raising it leaves prompt tiltmeters more room than they need.
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

# -- impacts ---------------------------------------------------------------------------------------
MIDDLE_OF_IMPACT_S = 1.5e-3
"""Time, s, from the contact to the middle of an impact, by which accelerometers seem late that are not.

Assumed. Raising it makes accelerometers seem prompter.
"""

IMPACT_FORM_S = 3e-4
"""Sd, s, of that middle: how well the shape of an impact is known at all (assumed).

Raising it hides delays of accelerometers below it.
"""

VAGUE_DAMPING = 0.4
"""Relative error, 1, of a ring-down's damping from which the runs do not say how fast it decays (assumed).

Raising it takes a vibration of the floor that follows impacts by chance for the wall's own.
"""

RING_SD = 0.07
"""Relative sd, 1, of a ring-down in one run: kicks differ from impact to impact (assumed).

It is no free scatter, which would grow until an effect that nobody named hides in it. Raising it hides
weak bending and turning.
"""

# -- delays of sensors -----------------------------------------------------------------------------
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
"""Misfit as a share of a signal's power, 1, up to which a channel shows a sensor of its kind (assumed).

Raising it takes channels with other faults for witnesses of where the plugs are.
"""

EXCHANGE_LEAST = 5e-3
"""Misfit of the channels that would move, in the same, 1, from which an exchange is looked for (assumed).

Wires at 2.1 and 2.8 m leave 0.03 together once each has its gain. Raising it overlooks neighbours that show
nearly the same.
"""

EXCHANGE_EACH = 1e-3
"""Misfit, 1, that a channel must lose to count as moved: channels that show the same stay where they are."""

EXCHANGE_GAINS = (0.85, 1.15)
"""Gain, from … to, 1, with which a channel may show the sensor of its place: gain errors are 10 % at most.

Widening it takes the next sensor up the wall for the one that is due.
"""

LIVELY = 0.05
"""Power that a channel should show over the median of all, 1, from which its sign can be judged (assumed).

Raising it overlooks reversed leads of sensors low on the wall.
"""

FAR_FROM_UPRIGHT = 0.25
"""Share of the largest rotation, 1, from which a reading is far enough from an impact to tell its channel."""

# -- ends of a range -------------------------------------------------------------------------------
IN_PROPORTION = (0.3, 0.85)
"""Part of a channel's travel, from … to, 1, over which it must be in proportion to the rotation.

Widening it takes the bend of a limit for a gain.
"""

FLAT_TOP = 0.985
"""Share of its largest reading, 1, from which a channel may be at its end (assumed).

Raising it leaves too few samples of a top to be called flat.
"""

SAME_LIMIT = 0.97
"""Share of the furthest reading of all runs, 1, below which a stop is none (assumed): it went beyond.

Raising it overlooks limits that move with the zero.
"""

LIMIT_SD = 0.01
"""Relative sd, 1, of the reading at which a channel stops."""

GOES_ON = 1.025
"""How much further than a channel the rotation must go on for it to be stopped, 1.

Above what gains differ by. Raising it overlooks limits just below the largest rotation.
"""

BEYOND_FAMILY = 1.02
"""How much further than those of its family that stop a channel may go that stops where they do, 1."""

# -- electronics -----------------------------------------------------------------------------------
USUAL_HUM = 0.45
"""Amplitude of hum over the rms noise of a reading, 1, up to which it is no fault: long cables have some.

It is taken out all the same. Raising it hides weak pick-up.
"""

HUM_SD = 6.0
"""Amplitude of a hum over its error, 1, from which it is none of chance, in hundreds of channels.

Raising it leaves weak hum in the readings.
"""

FEWEST_STEPS = 0.004
"""Share of samples, 1, at which a reading in steps goes on by a step at least.

Raising it overlooks steps that are so coarse that the reading seldom goes on.
"""

SMALLEST_STEP = 5e-4
"""Step over the span of the reading, 1, from which it matters: below, it is the converter's own.

Raising it overlooks fine steps.
"""

CONVERTER_STEP = 3.0
"""Step over the declared noise of a reading, 1, up to which it is the converter's own (assumed).

Raising it overlooks fine steps.
"""

GOES_ON_STEPS = 2.5
"""Steps of its converter, 1, by which a reading goes on after it stood still for it to have been frozen.

A sound one goes on by one, or two with noise. Raising it overlooks drop-outs in slow motion.
"""

FROZEN_S = 0.008
"""Time, s, beyond which equal readings in a row are no chance (assumed).

Raising it overlooks short drop-outs.
"""

RANGE_MARGIN = 0.03
"""Share of the range, 1, next to its end where a reading may stand still: the sensor is at its stop.

Raising it overlooks drop-outs near the end of the travel.
"""

SPIKE_NOISE = 9.0
"""Distance of a lone sample from its neighbours over the noise, 1, from which it is a spike.

No white noise goes so far. Raising it overlooks small spikes.
"""

SPIKY_PER_S = 0.3
"""Lone samples, 1/s, on the mean of all runs, from which a channel has a fault (assumed: 0.2 at most).

Raising it overlooks a contact that is seldom loose.
"""

LOUD_NOISE = 4.0
"""Distance of a sample from its neighbours over the noise, 1, from which an accelerometer is loud.

Raising it takes the shock of weak impacts for spikes.
"""

LOUD_TOGETHER = 3
"""Accelerometers, 1, that are loud at once at an impact; spikes of single channels do not meet.

Raising it takes impacts for spikes on rigs with few accelerometers.
"""

STANDS_OUT = 2.0
"""Times what any other channel of its family has of a condition, 1, from which one stands for itself.

Pick-up of sound channels differs by less (development laboratories). Raising it hides one among many.
"""

# -- single channels -------------------------------------------------------------------------------
SUSPECT: dict[Family, float] = {"lvdt": 4.0, "wire": 2.0, "accelerometer": 3.0}
"""What a channel must be off by, in what sound ones differ by (`channel_shapes.TOLERANCE`), to be suspect, 1.

Each wire is told from few others, so its tolerance is wide already. Raising it hides single channels.
"""

OTHERS_AGREE = 0.4
"""What the others of a family may be off by, over what a faulty channel is, 1, beside which they agree.

Assumed: a faulty one is in the prediction of its neighbours. Raising it names a channel where two are
wrong.
"""

SOUND = 0.5
"""Sd of what a sound channel is off by, in the same, 1.

Raising it hides effects on a single channel that is suspect.
"""

REMAINS = 0.5
"""Excess, 1, of the logarithm of what remains over noise from which a channel is suspect for it alone.

Raising it overlooks channels that show something no shape has.
"""

REMAINS_SD = 0.2
"""Sd of that logarithm, 1, from channel to channel (assumed). Raising it does the same."""

AS_SINGLE = 2
"""Channels of one family, 1, that are examined one by one (assumed).

Raising it lets effects on single channels stand for what many of them have together.
"""

VERTICAL_OTHERS = 0.4
"""Share of the worst accelerometer along z, 1, below which the others along z must be for it to be odd.

What the wall does otherwise (an edge that is not where the survey has it) is in all of them. Raising it
blames one accelerometer for what the wall does.
"""

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

SHAKEN_POWER = 4.0
"""Power over the usual one, 1, averaged over a second, from which the floor shook: twice the amplitude.

Raising it hides weak bursts.
"""

BURST_SD = 0.1
"""Relative sd, 1, of the size of a burst (assumed). Raising it makes bursts less certain."""

# -- effects ---------------------------------------------------------------------------------------
NEGLIGIBLE = 0.5
"""Share of the weakest strength of an effect's range, 1, up to which sound walls and sensors have it.

Raising it hides weak effects; lowering it names what every wall has.
"""

# -- survey ----------------------------------------------------------------------------------------
FAR_FROM_SURVEY = 4.0
"""Prior sd, 1, by which α, p or the base may differ from the survey before the rig file is doubted.

Raising it lets a diagnosis with a wrong rig file name an effect.
"""
EITHER = 0.5
"""Probability, 1, of something unknown that far from the survey: the rig file is as likely wrong."""
