"""The sentences about channels and families that are not fit to be used, and about floor and base."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from daq_app.rocking.families.channels.compared_channels import DeviationKind
from daq_app.rocking.families.finding import FamilyFinding, Treatment


def coarse_steps(family: str, name: str, step_m: float) -> FamilyFinding:
    """A channel whose reading goes in steps; it is left out."""
    text = (
        f"{name} ({family}) reads in steps of {step_m * 1e3:.2g} mm: between them it shows no motion; it is "
        "left out. Usual causes: a wire-wound potentiometer, a digital sensor, a range that is far too wide"
    )
    return FamilyFinding(family, (name,), "steps", step_m, "m", "left out", "warning", text)


def stands_still(family: str, name: str, time_s: float) -> FamilyFinding:
    """A channel that stands still; it is left out."""
    text = (
        f"{name} ({family}) stands still for {time_s:.1f} s, without even its noise; it is left "
        "out. Usual causes: a sensor that is stuck or at its stop, a range that ends before the rig file's"
    )
    return FamilyFinding(family, (name,), "still", time_s, "s", "left out", "warning", text)


def leaps(family: str, name: str, count: int) -> FamilyFinding:
    """A channel that freezes and leaps; it is left out."""
    text = (
        f"{name} ({family}) leaps within one sample, as no wall does, {count} times; it is left out. Usual "
        "causes: a loose contact, missed conversions, interference"
    )
    return FamilyFinding(family, (name,), "leaps", float(count), "1", "left out", "warning", text)


def odd_lvdt(name: str, kind: DeviationKind, size: float) -> FamilyFinding:
    """An LVDT that deviates from the others of its face; it is left out."""
    what, unit = {
        "gain": (f"shows {size:+.1%} of opening against", "1"),
        "late": (f"is {size * 1e3:+.1f} ms late against", "s"),
        "drift": (f"drifts by {size * 1e3:+.2f} mrad against", "rad"),
    }[kind]
    text = (
        f"{name} (LVDTs) {what} the others of its face: its calibration, its filter or its holder is not the "
        "rig file's; it is left out"
    )
    return FamilyFinding("LVDTs", (name,), kind, size, unit, "left out", "warning", text)


def whole_family_unfit(channels: Sequence[FamilyFinding], of: int) -> FamilyFinding:
    """A family of `of` channels, too many of which are unfit for any to be left out; nothing is done yet."""
    kinds = [finding.kind for finding in channels]
    kind = max(dict.fromkeys(kinds), key=kinds.count)
    worst = max((finding for finding in channels if finding.kind == kind), key=lambda finding: finding.size)
    named = ", ".join(name for finding in channels for name in finding.channels)
    names = named if len(channels) < of else f"all {of}"
    what = {
        "steps": f"read in steps of up to {worst.size * 1e3:.2g} mm",
        "still": f"stand still for up to {worst.size:.1f} s, without even their noise",
    }.get(kind, f"leap within one sample, up to {worst.size:.0f} times")
    text = f"{worst.family} {what} ({names})"
    return replace(worst, channels=(), treatment="none", text=text)


def instead_of(finding: FamilyFinding, *, left_out: bool) -> FamilyFinding:
    """The finding of a whole family that is unfit, with what became of it."""
    if finding.family == "LVDTs":
        return replace(finding, treatment="left out", text=f"{finding.text}: nothing is compared with them")
    if left_out:
        return replace(finding, treatment="left out", text=f"{finding.text}: r is taken from the LVDTs")
    far = "the LVDTs do not reach far enough to take their place"
    return replace(finding, text=f"{finding.text}: r is off by it, and {far}")


def noisy(family: str, channels: tuple[str, ...], times: float) -> FamilyFinding:
    """Noise far above the rig file's; the errors of r hold it."""
    what = f"{channels[0]} ({family}) has" if channels else f"{family} have"
    text = (
        f"{what} {times:.1f} times the noise of the rig file: the errors of r hold it. Usual causes: a "
        "supply, a shield, a wrong range or gain"
    )
    return FamilyFinding(family, channels, "noise", times, "1", "none", "warning", text)


def shows_no_test(family: str) -> FamilyFinding:
    """A family that contradicts the two others, which show a test."""
    others = "LVDTs and tiltmeters" if family == "wires" else "wires and LVDTs"
    done = "r is taken from the LVDTs" if family == "wires" else "they are not asked"
    text = (
        f"{others} show a test, and the {family} something else: exchanged plugs, a wrong rig file, a sensor "
        f"at its stop or a cable that came off; {done}"
    )
    return FamilyFinding(family, (), "motion", 0.0, "1", "left out", "warning", text)


def shaking_floor(rms_m_s2: float) -> FamilyFinding:
    """The accelerometers shake while the wall stands at rest."""
    text = (
        f"the floor shakes: after the wall has come to rest its accelerometers show {rms_m_s2:.2g} m/s² rms "
        "together. It drives the rocking wall as well, and r is off by it. Usual causes: machines, a crane, "
        "traffic, an actuator that runs on"
    )
    return FamilyFinding("floor", (), "vibration", rms_m_s2, "m/s²", "none", "warning", text)


def slides(largest_m: float, *, left_out: bool) -> FamilyFinding:
    """The wall slides on its base at impacts, or its base gives way, and the wires go with it."""
    what = "r is taken from the LVDTs" if left_out else "r is off by it"
    text = (
        f"at its impacts the wall slides on its base, or the base gives way, by up to {largest_m * 1e3:.1f} "
        f"mm: the wires step together, the LVDTs do not; {what}. Usual causes: a wet bed, a base that rocks"
    )
    treatment: Treatment = "left out" if left_out else "none"
    return FamilyFinding("wires", (), "slide", largest_m, "m", treatment, "warning", text)


def slips(largest_m: float, friction: float, *, left_out: bool) -> FamilyFinding:
    """Friction does not hold the base of a wall that is nearly upright, and the wires go with it."""
    what = "r is taken from the LVDTs" if left_out else "r is off by it"
    text = (
        f"friction of {friction:.2f} does not hold the base: it slips by {largest_m * 1e3:.1f} mm between "
        f"impacts, while the wall is nearly upright, and slow impacts lose more speed by it; {what}. Usual "
        "causes: a wet or dusty bed, a corner without contact"
    )
    treatment: Treatment = "left out" if left_out else "none"
    return FamilyFinding("wires", (), "slip", largest_m, "m", treatment, "warning", text)


def turns(largest_rad: float) -> FamilyFinding:
    """The wall turns about the vertical at impacts."""
    text = (
        f"the wall turns about the vertical at its impacts, by up to {largest_rad * 1e3:.2f} mrad: wires "
        "step apart, the LVDTs do not. Usual causes: a corner that strikes first, an uneven bed"
    )
    return FamilyFinding("wall", (), "turn", largest_rad, "rad", "none", "warning", text)
