"""Tolerances of the motion: from what on a wall counts as held, released, rocking and at rest."""

from __future__ import annotations

# -- hold and release ------------------------------------------------------------------------------
MAY_BE_HELD = 0.85
"""Share of the largest rotation, 1, from which a wall may be held: a quick pull overshoots (assumed).

Raising it misses the hold of walls that are pulled quickly.
"""

AT_ROTATION = 0.98
"""Share of a rotation, 1, from which a wall is at it (assumed).

Raising it takes the sway of a held wall for its release.
"""

STILL_PULLED = 0.93
"""Share of the rotation at which a wall is held, 1, below which it is still pulled (assumed).

Raising it takes a sway of the hold for the pull, and leaves less of the hold.
"""

AFTER_PULL_S = 0.1
"""Time, s, that a wall needs to come to its hold after the pull (assumed).

Raising it leaves less of short holds.
"""

FALLEN = 0.9
"""Share of the largest rotation, 1, below which the wall is falling.

Raising it takes a sway of the hold for the fall.
"""

WITHIN_SWAY = 6.0
"""Standard deviations of the held rotation, 1, within which a level may be passed by swaying alone.

Raising it gives up the levels nearest to the hold.
"""

SWAYS_ON = 5e-4
"""Rms sway of a hold over the held rotation, 1, from which the start of the fall is hidden by it (assumed).

Raising it takes a sway for the start of the fall.
"""

RISES = 6.0
"""Rise of a wall beyond its hold over the rms sway of the hold, 1, from which it was thrown up (assumed).

Raising it times the release of weakly thrown walls at the top of their rise.
"""

HARDLY_RISES = 1e-3
"""The same over the held rotation, 1, up to which a cable and the noise of readings may make it (assumed).

Raising it times the release of weakly thrown walls at the top of their rise.
"""

RISEN = 0.3
"""Share of its rise, 1, from which on the motion of such a wall is fitted (assumed).

Raising it leaves fewer readings, lowering it lets the sway and the noise of the hold into the fit.
"""

START_LEAVES = 0.01
"""Variance that a start of the fall leaves over the most that any leaves, 1, up to which it may be the
release (assumed).

Raising it takes swings of the sway for the release.
"""

SURELY_HELD_S = 0.25
"""Time before the release, s, up to which a wall does nothing but sway (assumed).

Raising it leaves less of the hold from which the size and the time scale of the sway are told.
"""

STILL_HELD_S = 0.015
"""Time before the release, s, from which nothing is taken for the hold, as the release is timed (assumed).

Raising it makes the state in which the wall is let go less certain.
"""

LEFT_ITS_HOLD = 3.0
"""Standard deviations of what the sway predicts, 1, beyond which a wall has left its hold (assumed).

Raising it takes the first motion of a slow release for sway.
"""

HELD_UNTIL_S = 0.1
"""Time before the release, s, up to which a wall is held for certain (assumed).

Raising it leaves less of the hold for what gravity alone shows.
"""

HELD_STILL = 0.01
"""Share of the held rotation, 1, by which a wall that is held may move.

Raising it takes the start of the fall for the hold.
"""

SHORTEST_HOLD_S = 0.05
"""Duration, s, that any hold counts as, where its sway says how far its mean acceleration is off (assumed).

Raising it takes the sway of a short hold for a gain of the accelerometers.
"""

FREE_FROM_S = 0.05
"""Time after the release, s, from which the wall moves freely (assumed): a cable may give way slowly.

Raising it leaves less of the first fall.
"""

# -- half-cycles -----------------------------------------------------------------------------------
SHORTEST_HALF_CYCLE_S = 0.04
"""Time between two crossings of upright, s, below which they bound no half-cycle but noise (assumed).

Raising it loses the last half-cycles of low walls.
"""

SMALLEST_RAD = 2e-3
"""Peak, rad, from which half-cycles are used (assumed).

Raising it refuses records of low levels, and leaves fewer half-cycles of the others.
"""

SMALLEST_GRID_RAD = 8e-4
"""Rotation between two impacts, rad, below which half-cycles are not told apart any more (assumed).

Raising it takes the last impacts out of what rings, slips and turns at each.
"""

AS_FROM_REST = 0.01
"""Relative difference, 1, of the first fall's speed up to which it counts as a fall from rest (assumed).

Raising it takes a slow release for a clean one where kicks at impacts are looked for.
"""

# -- rest ------------------------------------------------------------------------------------------
AT_REST_RAD = 2e-4
"""Rotation, rad, below which the wall is at rest (assumed).

Raising it takes the last swings for rest, from which zeros and noise are read.
"""

AROUND_TEST_S = 0.2
"""Time before the release and after the rest, s, that is looked at with the swings (assumed).

Raising it gives the zero of every channel more weight beside its motion.
"""

# -- shocks ----------------------------------------------------------------------------------------
KNOCK = 2.5
"""Spread of an accelerometer over an interval of the grid, over that at rest, 1, from which it rings.

Raising it takes a step on the floor or a knock for quiet.
"""

KNOCK_S = 0.12
"""Time around such an interval, s, that is left out with it (assumed).

Raising it leaves less of the hold and of the rest to look for the floor in.
"""

# -- noise -----------------------------------------------------------------------------------------
LEAST_INDEPENDENT = 0.01
"""Least share of independent samples, 1, in what a regression leaves: slow residuals are a walk (assumed).

Raising it makes coefficients surer than slow residuals let them be.
"""
