"""Tolerances of walls: their hold, release and impacts, the floor below them, and their survey."""

from __future__ import annotations

# -- hold ------------------------------------------------------------------------------------------
SWAY_SHARE = 0.005
"""Acceleration of the sway over that of gravity, 1, up to which a held wall shows gravity alone (assumed).

Raising it takes the sway of a held wall for a gain of the accelerometers.
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

# -- a base that friction does not hold ------------------------------------------------------------
SLIP_LEFT_OPEN = 0.3
"""Share, 1, of what slips do in a test, and of how far a half-cycle slips, that the law of friction leaves
open (assumed).

Raising it hides causes in slips, and lets noise of the wires into small ones.
"""

SLIP_TO_FIRST_ORDER = 0.25
"""Share, 1, by which what slips do differs from half-cycle to half-cycle: the law is to first order in the
slip, and an edge that slips bounces. With 0.1 two of sixteen walls of the contact engine have a cause beside
their slip.

Raising it hides causes in slips.
"""

BASE_NOISE_M = 1e-4
"""Noise, m, of the motion of the base by the wires on the grid, for the law of friction (assumed).

Raising it fits the law to fast slips alone.
"""

FEWEST_WIRES = 4
"""Wires, 1, from which slip, turn and rotation are told apart with one to spare, and from which their scatter
says what their mean is off by.

Raising it finds no slip on walls with few wires.
"""

SLIP_GUARD_S = 0.008
"""Time beside an impact, s, in which no slip is looked for: its shock and its steps are over then (assumed).

Raising it leaves less of short half-cycles.
"""

SLIP_WINDOW_S = 0.03
"""Time after and before an impact, s, whose means are compared for a slip between two impacts (assumed).

Raising it makes slips surer, and smaller than they are.
"""

SLIP_WINDOW_SHARE = 0.2
"""Share of a half-cycle, 1, that such a window takes at most (assumed).

Raising it makes slips of short half-cycles surer, and smaller than they are.
"""

SHORTEST_SLIP_S = 0.1
"""Duration of the shortest half-cycle, s, in which a slip is looked for: both windows fit into it.

Raising it tells slips from fewer half-cycles.
"""

BASE_SETTLED_S = 0.3
"""Time before the release, s, from which on the walk of the base is looked at (assumed).

Raising it takes the end of the pull for a walk.
"""

SLIP_SCATTER = 2e-4
"""What the slips of a part of a test repeat by, m s/rad: 0.2 mm over a part in which the impacts' speeds add
up to 1 rad/s. LVDTs whose zeros walk by 0.03 mm seem to move all wires by 0.1 mm.

Raising it hides slides.
"""

TURN_SCATTER_S = 1e-4
"""What a turn about the vertical at an impact repeats by, s, from a pair of wires a metre apart (assumed).

Raising it hides turns about a corner.
"""

BENDING_OF_MEAN = 2.0
"""What a bending with z² moves the mean of wires over a wall's height by, over what it moves them apart, 1.

Raising it takes slides for bending.
"""

# -- the wall as it was built ----------------------------------------------------------------------
BED_ROOT = 6e-4
"""Sd, √rad, of the root of the rotation at which the joint of a sound wall begins to open, √θ_c.

Beds of mortar of 1e11 N/m³ below a metre of wall begin at 0.4 microradian (assumed). Raising it hides springs
below a base that begin to open below nine times its square.
"""

LEAN_RAD = 3e-4
"""Sd, rad, of a sound wall's lean: what a builder's level leaves of the base, and bricklaying of the centre
of mass and of its edges (assumed: 0.3 mm in a metre, each).

Raising it hides tilted bases, masses off centre and unequal edges below three times its value.
"""

SLOPE_S_RAD = 3e-3
"""Sd, s/rad, of the slope of r over the approach speed that no law of impact excludes: a tenth of a per cent
of r from the slow to the fast impacts of a test (assumed).

Raising it hides slopes of r below three times its value.
"""

SIDES_R = 3e-4
"""Sd, 1, of half the difference of r between the sides of a sound wall (assumed).

Raising it hides differences of r between the sides below three times its value.
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

ALONE = 1.6
"""Windows, 1, that an impact must be from its neighbours for its time to be read (assumed).

Raising it leaves fewer impacts.
"""

SHARP_S = 8e-3
"""Half width of the misfit's dip, s, up to which accelerometers are late by what the impacts themselves say.

Prompt ones reach 6 ms, those behind a filter of 20 ms 17. Raising it reads the form of a filter for a delay.
"""

# -- oscillations ----------------------------------------------------------------------------------
OSCILLATION_INDEPENDENT = 0.05
"""Least share of independent samples, 1, in what a ring-down or a vibration of the floor leaves (assumed).

Raising it makes weak ones surer than they are.
"""

SCANNED_INDEPENDENT = 0.2
"""The same while frequency and damping are sought: one slow signal must not decide them (assumed)."""

VAGUE_FREQUENCY = 0.3
"""Largest relative sd, 1, of a ring-down's frequency (assumed): the scan has found it somewhere.

Raising it lets a frequency go from the one that was found.
"""

SURE_DAMPING = 0.02
"""Least relative sd, 1, of a ring-down's damping (assumed): no wall dies away by one oscillator's law.

Raising it tells the damping less well.
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

DISPLACEMENT_MASK_S = 0.02
"""Time after an impact, s, in which wires and LVDTs tell no ring-down: a base that gives way takes
milliseconds to turn, a quick decay but no ring (assumed).

Raising it loses rings that die away quickly.
"""

ACCELERATION_MASK_S = 0.035
"""The same of accelerometers, s: their mounts ring after the shock (assumed)."""

RINGING_GAIN = 50.0
"""Gain in ln likelihood per run, 1, from which a wall rings so that wires tell no slide of its base.

Walls that ring have 400 and more, sound ones 11 at most. Raising it takes a ring for a slide.
"""

# -- floor -----------------------------------------------------------------------------------------
FLOOR_GAIN = 6.0
"""Gain in ln likelihood per run, 1, below which there is no vibration of the floor to speak of.

Raising it hides weak vibration; lowering it finds some in noise.
"""

SHAKEN_POWER = 4.0
"""Power over the usual one, 1, averaged over a second, from which the floor shook: twice the amplitude.

Raising it hides weak bursts.
"""

USUAL_POWER = 3.0
"""The same, 1, of one half-cycle, up to which that half-cycle says what is usual (assumed).

Raising it takes bursts for what is usual.
"""

BURST_SD = 0.1
"""Relative sd, 1, of the size of a burst (assumed). Raising it makes bursts less certain."""

FLOOR_RMS_M_S2 = 0.02
"""Irregular acceleration of the floor, m/s² rms, from which it counts in the errors of the motion.

Sound laboratories show 0.005; one of 0.035 moves r by up to 0.005. Raising it takes what a weak one does to
the motion for an effect.
"""

FLOOR_EFFECT = 0.2
"""Relative sd, 1, of what an irregular floor does to the motion: of its rms, of the survey's wall (assumed).

Raising it lets an effect hide in the floor; lowering it takes what the floor does for something unknown.
"""

FLOOR_STANDS_OUT = 4.0
"""The same, squared, over the standard error of its mean over the parts at rest.

Lowering it takes a wall that rings on after its last impact for a floor.
"""

FEWEST_PARTS = 6
"""Parts at rest, 1, from which their differences say how sure the mean of the floor is (assumed).

Raising it finds no irregular floor in short records.
"""

LEAST_KEPT = 0.7
"""Share of a band's power, 1, that counts as left where sway and offsets take more than the rest (assumed).

Raising it makes floors look quieter at the lowest frequencies.
"""

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
