"""Ideal signals of the 41 sensors, in SI, from the geometry of the rig file and a scene.

Own derivation: world x, z of a wall point at rotation q about the base point c are
x' = c + (x − c) cos q + z sin q and z' = −(x − c) sin q + z cos q.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import cont2discrete, lfilter

from daq_app.config.rig import G_M_S2, Channel
from daq_app.gap.blind.world.arrays import FloatArray
from daq_app.gap.blind.world.events.scene import Scene

_BEND_EXPONENT = 1.5


def ideal(channel: Channel, scene: Scene, anchor_shift_m: float = 0.0) -> FloatArray:
    """Signal of one channel (n,), upright value removed. `anchor_shift_m` raises a wire's anchor."""
    match channel.family:
        case "lvdt":
            return opening(channel, scene)
        case "wire":
            return shortening(channel, scene, anchor_shift_m)
        case "accelerometer":
            return specific_force(channel, scene)
        case "tiltmeter":
            return tilt(channel, scene)
        case _:  # nothing of the wall in it
            return np.zeros_like(scene.theta)


def opening(channel: Channel, scene: Scene) -> FloatArray:
    """Vertical opening of the base joint below the sensor, + = open."""
    return (scene.pivot_x - channel.position_m[0]) * np.sin(scene.theta) + scene.lift


def shortening(channel: Channel, scene: Scene, anchor_shift_m: float = 0.0) -> FloatArray:
    """|A − P0| − |A − P|: + when the point nears its anchor."""
    assert channel.anchor_m is not None
    x, y, z = channel.position_m
    ax, ay, az = channel.anchor_m
    az += anchor_shift_m
    turn, cosine = np.sin(scene.lean), np.cos(scene.lean)
    shape = (max(z, 0.0) / scene.height) ** _BEND_EXPONENT
    px = scene.pivot_x + (x - scene.pivot_x) * cosine + z * turn
    px = px + scene.slip - y * scene.yaw + shape * scene.bend
    pz = -(x - scene.pivot_x) * turn + z * cosine + scene.lift
    py = y + x * scene.yaw
    rest = math.sqrt((ax - x) ** 2 + (ay - y) ** 2 + (az - z) ** 2)
    now = np.sqrt((ax - px) ** 2 + (ay - py) ** 2 + (az - pz) ** 2)
    return np.asarray(rest - now)


def specific_force(channel: Channel, scene: Scene) -> FloatArray:
    """Acceleration minus gravity along the wall-fixed axis, DC coupled, plus the shock of impacts."""
    x, y, z = channel.position_m
    arm = x - scene.pivot_x
    square = scene.omega**2
    if channel.axis == "z":
        value = -scene.theta_dd * arm - square * z + G_M_S2 * (np.cos(scene.lean) - 1.0)
        value = value + scene.ground * np.sin(scene.lean)
        lever = abs(x)
    else:
        value = scene.theta_dd * z - square * arm - G_M_S2 * np.sin(scene.lean)
        value = value + scene.ground * np.cos(scene.lean) - y * scene.yaw_dd
        value = value + (max(z, 0.0) / scene.height) ** _BEND_EXPONENT * scene.bend_dd
        lever = z
    if scene.pivot_dd is not None:
        along, up = scene.pivot_dd
        turn, cosine = np.sin(scene.lean), np.cos(scene.lean)
        value = value + (along * turn + up * cosine if channel.axis == "z" else along * cosine - up * turn)
    return value + _shocks(channel, scene, lever)


def tilt(channel: Channel, scene: Scene) -> FloatArray:
    """Rotation towards the channel's axis through the sensor's first-order response."""
    if channel.axis != "x":
        return np.zeros_like(scene.lean)
    return first_order(scene.lean, channel.time_constant_s, scene.time_s[1] - scene.time_s[0])


def first_order(signal: FloatArray, constant_s: float, step_s: float) -> FloatArray:
    """Exact first-order lag of a signal that is straight between samples; starts settled."""
    if constant_s <= 0.0:
        return signal
    numerator, denominator, _ = cont2discrete(([1.0], [constant_s, 1.0]), step_s, method="foh")
    lag: FloatArray = lfilter(numerator[0], denominator, signal - signal[0])
    return np.asarray(lag + signal[0])


def _shocks(channel: Channel, scene: Scene, lever: float) -> FloatArray:
    """At an impact: the velocity jump as a pulse (unless it is in the motion already), and local ringing of
    the masonry."""
    value = np.zeros_like(scene.time_s)
    shock = scene.shock
    for start, jump in zip(scene.impact_times, scene.impact_jumps, strict=True):
        low, high = np.searchsorted(scene.time_s, [start, start + shock.window_s])
        t = scene.time_s[low:high] - start
        acceleration = shock.ringing(t, channel.id)
        if scene.pivot_dd is None:
            acceleration = acceleration + shock.pulse(t)
        value[low:high] += lever * jump * acceleration
    return value
