"""What the sensors see of a wall that a contact engine moved."""

from __future__ import annotations

import numpy as np

from daq_app.gap.blind.world.arrays import FloatArray
from daq_app.gap.blind.world.contact.motion import ContactMotion
from daq_app.gap.blind.world.events.mechanics import Effects
from daq_app.gap.blind.world.events.scene import Scene, corner_twist
from daq_app.gap.blind.world.wall import Wall


def contact_stage(motion: ContactMotion, wall: Wall, effects: Effects, time_s: FloatArray) -> Scene:
    """Evaluate a run at rising times: the wall turns about the middle of its base, and that moves."""
    theta, omega, theta_dd = motion.sample(time_s)
    x, z, x_dd, z_dd = motion.base(time_s)
    zero = np.zeros_like(theta)
    return Scene(
        time_s=time_s,
        theta=theta,
        omega=omega,
        theta_dd=theta_dd,
        lean=theta,
        pivot_x=zero,
        lift=z,
        slip=x,
        yaw=zero + corner_twist(effects, time_s, motion.impacts),
        yaw_dd=zero,
        bend=zero,
        bend_dd=zero,
        ground=zero,
        impact_times=np.array([impact.time for impact in motion.impacts]),
        impact_jumps=np.array([impact.after - impact.before for impact in motion.impacts]),
        height=wall.height,
        pivot_dd=(x_dd, z_dd),
    )
