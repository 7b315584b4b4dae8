"""What an ordinary laboratory does to a recording, one by one: none of it is a cause that anyone wants named.

The size of an imperfection is one number for each case, in the unit given here; what each channel or run has
of it is drawn around that number.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Imperfection:
    """One ordinary imperfection. `unit` is that of its size; "noises" counts in rms noise of the channel."""

    name: str
    unit: str
    meaning: str


_ELECTRONICS: Final = (
    Imperfection("mains_pick_up", "noises", "amplitude at 50 ± 0.03 Hz and harmonics, own phases"),
    Imperfection("slow_noise", "noises", "first-order noise that forgets 5 % with each sample"),
    Imperfection("pink_noise", "noises", "1/f noise from 0.05 Hz to 300 Hz"),
    Imperfection("unequal_noise", "factor", "noise of families and channels lies within 1/size to size"),
    Imperfection("zero_walk", "noises", "random walk of a zero from the start of a record to its end"),
    Imperfection("zero_start", "noises", "zero of a channel at the start of each run"),
    Imperfection("cable_shake", "noises", "burst of a shaken cable after an impact of 0.1 rad/s"),
    Imperfection("cable_step", "noises", "what a moved cable keeps after an impact of 0.1 rad/s"),
    Imperfection("spikes", "1/s", "single wrong samples of 5 to 25 noises, in each tenth channel"),
    Imperfection("crosstalk", "1", "share of the channel that the module scanned before, in volts"),
    Imperfection("coarse_steps", "bit", "bits of 16 that a module lacks, at most"),
    Imperfection("skew", "s", "a module samples later or earlier, at most"),
    Imperfection("calibration", "1", "standard deviation of a channel's gain"),
)
_INSTALLATION: Final = (
    Imperfection("mount_angle", "rad", "standard deviation of the turn of accelerometers and tiltmeters"),
    Imperfection("anchor_error", "m", "standard deviation of a wire's anchor along each axis"),
    Imperfection("tilt_constant", "1", "a tiltmeter's time constant is off by this share at most"),
    Imperfection("wire_backlash", "m", "play of a wire's drum, at most"),
    Imperfection("wire_sag", "1/m", "share of a wire's travel that sag takes for each metre, at most"),
    Imperfection("impact_shock", "s", "length of an impact's shock in the accelerometers; 0.002 in `own`"),
)
_TEST: Final = (
    Imperfection("sway", "rad", "amplitude of the held wall's sway at 0.4 to 3 Hz"),
    Imperfection("release_scatter", "1", "standard deviation of the release rotation; 0.01 in `own`"),
    Imperfection("impact_scatter", "1", "standard deviation of r from impact to impact"),
    Imperfection(
        "survey", "factor", "errors of centroid height (0.8 %) and inertia (3 %) are this many times larger"
    ),
    Imperfection("record_length", "s", "records begin 1.5 s to this much before the release and end as late"),
)

IMPERFECTIONS: Final[dict[str, Imperfection]] = {
    imperfection.name: imperfection for imperfection in (*_ELECTRONICS, *_INSTALLATION, *_TEST)
}
