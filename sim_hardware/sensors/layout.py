"""Columns of the tables that the sensor kernels work on."""

from __future__ import annotations

from typing import Final

# scene events: impacts, and knocks by people and tools
EV_TIME: Final = 0  # s since power-on
EV_BEFORE: Final = 1  # θ̇⁻, rad/s
EV_AFTER: Final = 2  # θ̇⁺, rad/s
EV_SIDE: Final = 3  # side that the wall came from; 0 for a knock
EV_INTENSITY: Final = 4  # what the accelerometers' ringing is proportional to, rad/s
EV_JUMP: Final = 5  # what kicks the oscillators, rad/s
EV_SLIP: Final = 6  # m, slip of the base at this event
EV_MODE: Final = 7  # state just after the event: value, rate
EV_TWIST: Final = 9
EV_YAW: Final = 11
EV_SLID: Final = 13  # m, slip so far
EV_TURN: Final = 14  # rad, turn about the vertical at this event
EV_TURNED: Final = 15  # rad, turned so far
N_EVENT: Final = 16

# scene epochs: what holds from a time on
EP_TIME: Final = 0
EP_RIGHT: Final = 1  # distance of the pivot from the middle of the base for θ > 0, m
EP_LEFT: Final = 2
EP_EDGE: Final = 3  # ρ, m
EP_WINKLER: Final = 4  # θc, rad
EP_COMPLIANCE: Final = 5  # rad
EP_ALPHA: Final = 6
EP_MODE_W: Final = 7  # rad/s, undamped
EP_MODE_ZETA: Final = 8
EP_MODE_GAIN: Final = 9
EP_TWIST_W: Final = 10
EP_TWIST_ZETA: Final = 11
EP_TWIST_KICK: Final = 12
EP_TWIST_FOLLOW: Final = 13
EP_YAW_KICK: Final = 14
EP_AMBIENT: Final = 15  # m/s²
EP_AMBIENT_W: Final = 16
EP_AMBIENT_PHASE: Final = 17  # at power-on
EP_HEIGHT: Final = 18  # of the wall, m
N_EPOCH: Final = 19

# state of the wall at one instant
ST_THETA: Final = 0  # of the joint
ST_OMEGA: Final = 1
ST_ALPHA: Final = 2  # θ̈
ST_SIDE: Final = 3
ST_SIN: Final = 4  # of the joint's rotation
ST_TOTAL: Final = 5  # θ with the base's own rotation
ST_SIN_TOTAL: Final = 6
ST_COS_TOTAL: Final = 7
ST_UX: Final = 8  # displacement of the middle of the base, m
ST_UZ: Final = 9
ST_PIVOT: Final = 10  # x of the pivot, m
ST_MODE: Final = 11  # top displacement, m, and its acceleration
ST_MODE_ACC: Final = 12
ST_TWIST: Final = 13
ST_TWIST_ACC: Final = 14
ST_YAW: Final = 15
ST_YAW_ACC: Final = 16
ST_GROUND: Final = 17  # m/s²
N_STATE: Final = 18

# rows: one per sensor
RW_FAMILY: Final = 0
RW_X: Final = 1
RW_Y: Final = 2
RW_Z: Final = 3
RW_ANCHOR: Final = 4  # x, y, z
RW_AXIS: Final = 7
RW_SLOPE: Final = 8  # electrical per SI, with polarity
RW_ZERO: Final = 9  # electrical value at zero
RW_NOISE: Final = 10  # rms, SI
RW_OFFSET: Final = 11  # SI, of this specimen of the sensor
RW_GAIN: Final = 12  # 1 + error
RW_LOW: Final = 13  # range of the sensor, SI
RW_HIGH: Final = 14
RW_FILTER: Final = 15  # kind of dynamic response
RW_TABLE: Final = 16  # its row in the filter tables, −1 for none
RW_RING: Final = 17  # two modes: amplitude m/s² per rad/s, rad/s, 1/s
RW_DELAY: Final = 23  # s
RW_QUADRATIC: Final = 24  # 1/SI
RW_DRIFT: Final = 25  # SI/s
RW_HUM: Final = 26  # SI
RW_HUM_W: Final = 27
RW_HUM_PHASE: Final = 28
RW_QUANTUM: Final = 29  # SI
RW_DROP_SHARE: Final = 30
RW_DROP_S: Final = 31
RW_CLOCK: Final = 32  # 1 + error of the sample clock
RW_CROSS: Final = 33  # share of the rotation that a y tiltmeter sees
RW_SAG: Final = 34  # 1/m²: κ of a sagging wire, whose length is d + κ d³
RW_FILTER_A: Final = 35  # τ (s), or ω (rad/s)
RW_FILTER_B: Final = 36  # ζ
RW_STUCK: Final = 37  # s: the value stays from then on; inf never
N_ROW: Final = 38

FLOATING: Final = 0
LVDT: Final = 1
WIRE: Final = 2
ACCELEROMETER: Final = 3
TILTMETER: Final = 4
LASER: Final = 5
CONSTANT: Final = FLOATING  # nothing of the wall in it: forces, strains, temperatures, voltages
FAMILY_CODE: Final = {
    "lvdt": LVDT,
    "wire": WIRE,
    "accelerometer": ACCELEROMETER,
    "tiltmeter": TILTMETER,
    "laser": LASER,
}

AXIS_X: Final = 0
AXIS_Y: Final = 1
AXIS_Z: Final = 2

NO_FILTER: Final = 0
LOW_PASS: Final = 1  # first order
RESONANCE: Final = 2  # second order
HIGH_PASS: Final = 3  # first order, AC coupling

PULSE_S: Final = 0.006
"""Duration of the contact at an impact: the velocity jump of a rigid wall is spread over a raised cosine."""
RING_S: Final = 0.06
"""After this the ringing of an impact is lost in the noise."""
FILTER_DT_S: Final = 1.0 / 4000.0
"""Grid on which dynamic responses are integrated."""
