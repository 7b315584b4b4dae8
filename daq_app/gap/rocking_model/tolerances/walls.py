"""Tolerances of walls: their motion, release and impacts, the floor below them, and their survey."""

from __future__ import annotations

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
