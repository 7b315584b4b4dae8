"""The flat parameter vector of the dynamics kernel: one place that says what each index means.

The kernel takes float64 of shape (N_PARAMETERS,), so that a fit may call it thousands of times a
second with no Python in between.  An effect whose parameters are all 0 is off.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_hardware.dynamics.body import Body

# the block
ALPHA: Final = 0  # rad
P: Final = 1  # rad/s
R0: Final = 2  # m
# the run
RESTITUTION: Final = 3  # velocity ratio
THETA0: Final = 4  # rad, signed
DURATION: Final = 5  # s from release
REST_AMPLITUDE: Final = 6  # rad: the wall is at rest when the coming peak would be below this
TOLERANCE: Final = 7  # local error per step, relative to the amplitude of the half-cycle
IMPACTS_BEFORE: Final = 8  # impacts that this wall has had in earlier tests
SCATTER: Final = 9  # relative standard deviation of r, multiplies the impact's own deviate
# interface
PIVOT_SHIFT: Final = 10  # m inwards
WINKLER: Final = 11  # θc, rad
EDGE_RADIUS: Final = 12  # m
CRUSH_ALPHA: Final = 13  # relative loss of α per 100 impacts
CRUSH_R: Final = 14  # relative loss of r per 100 impacts
# restitution
R_SLOPE: Final = 15  # s/rad
R_SLOPE_SPEED: Final = 16  # rad/s
R_ASYMMETRY: Final = 17  # added to r of impacts that end a swing to +x, taken from the others
# dissipation
ZETA: Final = 18
COULOMB: Final = 19
QUADRATIC: Final = 20  # 1/rad
# geometry
ALPHA_ASYMMETRY: Final = 21  # rad, α(+x) − mean
BASE_TILT: Final = 22  # rad, towards +x
ECCENTRICITY: Final = 23  # m, centre of mass towards +x
CUBIC: Final = 24  # −κ p² α (θ/α)³
# contact
DWELL: Final = 25  # s
BOUNCE: Final = 26  # s at BOUNCE_SPEED
BOUNCE_SHARE: Final = 27  # share of ln r lost in the first of the two impacts
# release
CABLE: Final = 28  # stiffness relative to p²
CABLE_SLACK: Final = 29  # rad
OMEGA0: Final = 30  # rad/s, positive away from upright
SLOW_RELEASE: Final = 31  # s
# ambient
AMBIENT: Final = 32  # m/s², amplitude of the base's acceleration along x
AMBIENT_HZ: Final = 33
AMBIENT_PHASE: Final = 34  # rad at release
# second degrees of freedom, driven by the motion (sim_hardware.sensors.scene)
MODE_HZ: Final = 35
MODE_ZETA: Final = 36
MODE_GAIN: Final = 37  # top displacement (m) per (rad/s) of velocity jump, times 2πf
TWIST_HZ: Final = 38
TWIST_ZETA: Final = 39
TWIST_KICK: Final = 40  # rad/m per rad: twist rate per velocity jump
TWIST_FOLLOW: Final = 41  # rad/m per rad: twist in step with the rotation
YAW_KICK: Final = 42  # rad per rad: yaw rate per velocity jump
COMPLIANCE: Final = 43  # rad: rotation of the base under the moment m g R sin α
SLIDE: Final = 44  # m per (rad/s): base slip at an impact
RELEASE_EVEN: Final = 45  # 0: the holding force dies away as exp(−t/τ); 1: it falls evenly to nothing
TURN: Final = 46  # rad per (rad/s): turn about the vertical that stays after an impact
TURN_ALTERNATION: Final = 47  # rad: 0 turns on and on, ±π/2 back and forth, ±π/4 on one side alone
UNEVEN_IMPACT: Final = 48  # 1: unequal levers make r of the two sides differ as at a plastic impact; 0: not
SLIDE_ON: Final = 49  # m per (rad/s): base slip at an impact towards +x, from either side
# a cable that is taut while the wall stands upright
STAY: Final = 50  # stiffness relative to p²
STAY_LOOSE: Final = 51  # rad: rotation at which it hangs loose, which has the sign of its pull
STAY_RELEASE: Final = 52  # rad: what is added to that towards the side of the release
# how far a base slips at faster impacts
SLIDE_SQUARE: Final = 53  # share of the slip that goes with the square of the speed, told at SLIDE_SPEED
SLIDE_ON_SQUARE: Final = 54  # the same of slips to one side
N_PARAMETERS: Final = 55

ODD_IN_TIME: Final = (ZETA, COULOMB, QUADRATIC, AMBIENT_HZ)
"""Parameters that change their sign where time runs backwards: losses become gains."""

BOUNCE_SPEED: Final = 0.2
"""Approach speed (rad/s) at which a bounce takes `BOUNCE` seconds; the flight grows with the speed."""
SLIDE_SPEED: Final = 0.2
"""Approach speed (rad/s) at which slips in proportion to the speed and to its square are told alike."""
REST_AMPLITUDE_RAD: Final = 2e-5
"""Default rest criterion: 0.02 mrad is 0.06 mm at the top of a 3 m wall, far below any sensor's noise."""
STEP_TOLERANCE: Final = 1e-10


def base_vector(body: Body) -> NDArray[np.float64]:
    """Parameters of a perfect Housner block with r = 1 and no effect, 30 s long, released at 0 rad."""
    vector = np.zeros(N_PARAMETERS)
    vector[ALPHA], vector[P], vector[R0] = body.alpha_rad, body.p_rad_s, body.r0_m
    vector[RESTITUTION] = 1.0
    vector[DURATION] = 30.0
    vector[REST_AMPLITUDE] = REST_AMPLITUDE_RAD
    vector[TOLERANCE] = STEP_TOLERANCE
    return vector
