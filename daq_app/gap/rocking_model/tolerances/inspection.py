"""Tolerances of the inspection: from what on a channel counts as wired wrongly, stopped or faulty."""

from __future__ import annotations

from daq_app.config.rig import Family

# -- wiring ----------------------------------------------------------------------------------------
REVERSED_BELOW = -0.4
"""Slope of a channel on what it should show, 1, below which it counts as reversed: −1 is, 0 is dead.

Raising it calls dead channels reversed.
"""

EXCHANGE_GAIN = 0.15
"""Share of the misfit, 1, that may be left once plugs are put back for them to count as exchanged (assumed).

Raising it calls channels with other faults exchanged.
"""

EXCHANGE_MISFIT = 0.05
"""Misfit as a share of a signal's power, 1, up to which a channel shows a sensor of its kind (assumed).

At 0.3 m, where inertia takes gravity away, impacts leave 0.03 of an accelerometer's power unexplained in a
large test, and 0.07 in a small one.
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

WITHIN_RANGE = 0.8
"""Share of a channel's range, 1, within which its sign is judged: beyond it, it may stand at its stop.

Raising it takes what a stop makes of a reading for its slope.
"""

FLAT_TOP = 0.985
"""Share of its largest reading, 1, from which a channel may be at its end (assumed).

Raising it leaves too few samples of a top to be called flat.
"""

ACCELEROMETER_STEP = 1e-3
"""Step of an accelerometer's reading over its range, 1, up to which it is the converter's own: ten bits.

Raising it overlooks fine steps.
"""

STANDS_BETWEEN_STEPS = 0.5
"""Share of samples, 1, at which a reading in coarse steps stays (assumed).

Raising it overlooks steps that noise takes now and then.
"""

CLIPPED_SAMPLES = 3
"""Samples in a row, 1, within a step of its largest reading that make a top of an accelerometer flat.

Shocks of 2 ms and more lie a per cent and more below their top on both sides of it. Raising it passes over
sensors that clip the very tops of their shocks.
"""

CLIPPED_TOPS = 5
"""Flat tops in a run, 1, from which an accelerometer clips (assumed).

Raising it passes over sensors that clip in the hardest impacts alone.
"""

SHOCK_IN_NOISE = 10.0
"""Largest reading of an accelerometer over its noise, 1, below which it has no shocks that could be clipped.

Raising it passes over sensors that clip at a few tenths of a metre per second squared.
"""

INSIDE_RANGE = 0.9
"""Share of its range, 1, from which an accelerometer may end (assumed): beyond it shocks clip in any sensor.

Raising it blames accelerometers that go as far as their data sheet says.
"""

SHORTEST_TOP_S = 0.05
"""Time, s, that a channel must be at its top for it to be looked at (assumed).

Raising it overlooks channels that are stopped at the first peak only.
"""

TOP_OF_REACH = 0.98
"""Share of the samples of a top, 1, above which the rotation may reach as far by chance (assumed).

Raising it takes the noise of the rotation for motion that goes on.
"""

TRAVELS_ON = (0.02, 3.0)
"""Share of a channel's largest reading and of its noise, 1, by which the rotation must go on at its top.

Raising either overlooks limits just below the largest rotation.
"""

STANDS_STILL = (0.5, 2.0)
"""Share of that travel and of the noise, 1, within which a channel that is stopped moves.

Raising either takes a gain that is low at the top for a stop.
"""

AS_FAR = 0.9
"""Share of the furthest limit of a family, 1, from which a channel's limit stands for it (assumed)."""

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

BEYOND_HUM = 4.0
"""Size over that of noise and hum together, 1, from which a sample belongs to an impact and not to the hum.

Raising it takes the share that an impact has of the mains frequency for hum.
"""

STEP_SD = 0.02
"""Relative sd, 1, of the step of a reading (assumed)."""

GOES_ON_STEPS = 2.5
"""Steps of its converter, 1, by which a reading goes on after it stood still for it to have been frozen.

A sound one goes on by one, or two with noise. Raising it overlooks drop-outs in slow motion.
"""

FROZEN_SD = 1e-3
"""Sd, 1, of a share of frozen samples: that of reading it off one record. A sound channel never freezes.

It is not that of what a few moments say of other records: each run has a share of its own. Raising it hides
rare drop-outs.
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

SPIKES_SD_PER_S = 0.05
"""Sd, 1/s, of the rate of lone samples in one run (assumed). Raising it hides contacts seldom loose."""

STILL = 0.01
"""Share, 1, of what it moves by in a record that a channel of a wall at rest moves by within 0.1 s (assumed).

Raising it takes small half-cycles for rest, so that what impacts do to a channel is taken for a fault.
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

LOUD = 2.0
"""Noise of a channel over that of its family, 1, from which it is told.

Sound channels of one family differ by less (development laboratories). Raising it hides loud channels.
"""

LOUD_SD = 0.1
"""Sd of that factor, over it, 1 (assumed)."""

# -- single channels -------------------------------------------------------------------------------
SUSPECT: dict[Family, float] = {"lvdt": 3.5, "wire": 2.0, "accelerometer": 3.0}
"""What a channel must be off by, in what sound ones differ by (`channel_shapes.TOLERANCE`), to be suspect, 1.

What LVDTs differ by among themselves is their unit where that is more. Each wire is told from few others,
so its tolerance is wide already. Raising it hides single channels.
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

SOUND_WIRE = 1.0
"""The same for the curvature and the side of a wire, 1, which its anchor and its sag decide.

Anchors are measured by tape: to a centimetre at the lowest wire, to one and a half at the highest, which show
as much (assumed). Raising it hides wrong anchors of single wires, most of all of the lowest, which is
predicted from those above.
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

IN_PHASE = 35.0
"""Gain, nats, of a ring that begins in one phase at all impacts over any phases, from which a channel rings.

In development laboratories what walls do reaches 26 in single channels, loose brackets 46 and more. It takes
as many impacts, of several runs. Raising it hides loose brackets.
"""

LONE = 0.8
"""Share of a ring in all channels of a family, 1, that one of them must explain to ring by itself.

A wall that bends moves all. Lowering it blames one wire for what the wall does.
"""

BY_ITSELF = 3.0
"""Times what the accelerometers show of the wall, 1, that a channel must ring by to ring by itself (assumed).

Raising it hides brackets that come loose on a wall that rings too.
"""

PLAY_M = 5e-4
"""Least play of a wire, m, that is looked for: twice what the drum of a sound one has.

Raising it hides a drum that is loose.
"""

PLAY_GAIN = 0.5
"""Share, 1, of what gain, lag, curvature, side and drift leave of a wire that its play must explain.

In development laboratories sound wires stay below 0.2. Raising it hides loose drums in noise.
"""

PLAY_STEPS = 2.0
"""Play over the step of a reading, 1, up to which it is none: a reading in steps stands still as well.

Raising it hides loose drums in coarse readings.
"""

TURNED = 0.03
"""Share of the rotation, 1, that a second axis may show: a mount that is turned by 1.7° (assumed).

Raising it hides crosstalk of the instrument below it.
"""

MOUNT_SD = 0.01
"""Sd of that share, 1, for an instrument that is mounted with care (assumed)."""

TILT_UNLIKE = 0.03
"""Rms of what a response of first order leaves over all that a tiltmeter shows, 1, from which it is odd.

Sound ones leave 0.011 at most in development laboratories, where a time constant is free. Raising it hides
tiltmeters that feel a few hundredths of the acceleration.
"""

TILT_UNLIKE_SD = 0.01
"""Sd of that share, 1: what a sound one leaves."""

FEELS_SHARE = 0.5
"""Share of what remains of an odd tiltmeter, 1, that may remain beside the acceleration for it to be felt.

Raising it says of other faults that they are felt acceleration.
"""

FEELS_SD = 0.01
"""Sd of the share of the acceleration, 1, that a sound tiltmeter feels: 0.009 at most in development
laboratories."""

COUNT_SD = 0.05
"""Sd of a count of channels, 1: far below one, so that one channel is significant."""
