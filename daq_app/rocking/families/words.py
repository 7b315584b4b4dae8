"""The sentences that say what was found about an instrument, and what it usually means."""

from __future__ import annotations

from dataclasses import replace
from typing import Final, Literal

from daq_app.config.families import FAMILY_NAMES, Family
from daq_app.rocking.families.channels.compared_channels import ComparedChannels, DeviationKind
from daq_app.rocking.families.channels.hum import MAINS_SHARE
from daq_app.rocking.families.finding import FamilyFinding
from daq_app.rocking.families.scales import factor_words

_IN_UNIT: Final[dict[str, tuple[float, str]]] = {
    "m": (1e3, "mm"),
    "rad": (1e3, "mrad"),
    "m/s²": (1.0, "m/s²"),
}


def families_by_name() -> dict[str, Family]:
    """The rig's word of each family by the word for the reader."""
    return {name: family for family, name in FAMILY_NAMES.items()}


def hum(
    family: str,
    channels: tuple[str, ...],
    amplitude: float,
    unit: str,
    frequency_hz: float,
    *,
    notable: bool,
) -> FamilyFinding:
    """Hum that was taken out; a warning where it is `notable`, a remark where it is little above noise."""
    severity: Literal["info", "warning"] = "warning" if notable else "info"
    scale, shown = _IN_UNIT.get(unit, (1.0, unit))
    many = f"{len(channels)} channels" if len(channels) > 1 else channels[0]
    text = (
        f"{family}: mains hum of up to {amplitude * scale:.3g} {shown} at {frequency_hz:.2f} Hz in {many}; "
        "it was taken out. Usual causes: a missing shield, an earth loop, a cable beside mains"
    )
    return FamilyFinding(family, channels, "hum", amplitude, unit, "removed", severity, text)


def with_wrong_rate(hum_found: FamilyFinding, share: float) -> FamilyFinding:
    """The finding of a hum that no mains have, with what that says of the sampling rate."""
    text = (
        f"{hum_found.text}. Mains keep their frequency to {MAINS_SHARE:.1%}: the sampling rate may be "
        f"{share:+.1%} off the true one, and all times, periods and speeds with it. r is not"
    )
    return replace(hum_found, text=text)


def scale(family: str, factor: float) -> FamilyFinding:
    kind: Literal["reversed", "unit"] = "reversed" if factor == -1.0 else "unit"
    text = (
        f"all {family} are {factor_words(factor)}, as the other families show; they were put right for this "
        "analysis. Correct the rig file or the import map"
    )
    return FamilyFinding(family, (), kind, factor, "1", "put right", "warning", text)


def single_wire(name: str, kind: DeviationKind, wires: ComparedChannels, place: int) -> FamilyFinding:
    """A wire that deviates from the other wires; it is left out of the rotation."""
    if kind == "gain":
        size, unit = float(wires.gain[place]), "1"
        what = f"wire {name} shows {size:+.2%} more rotation than the others: a wrong gain or a misplaced end"
    elif kind == "late":
        size, unit = float(wires.lag_s[place]), "s"
        what = f"wire {name} is {size * 1e3:+.1f} ms late against the others: slow, or an unknown delay"
    else:
        size, unit = float(wires.drift_rad[place]), "rad"
        what = f"wire {name} drifts by {size * 1e3:+.2f} mrad against the others: a zero or a fixture moves"
    text = what + "; it is left out of the rotation"
    return FamilyFinding("wires", (name,), kind, size, unit, "left out", "warning", text)


def sticks(name: str, width_m: float) -> FamilyFinding:
    """A wire that lags behind the others by a length, whatever the speed; it is left out of the rotation."""
    text = (
        f"wire {name} sticks: where the others show the same rotation, it differs by {width_m * 1e3:.2f} mm "
        "between the way out and the way back; it is left out of the rotation. Usual causes: a drum or "
        "pulley that jams, a wire that rubs, play in its end"
    )
    return FamilyFinding("wires", (name,), "hysteresis", width_m, "m", "left out", "warning", text)


def sticks_while_live(name: str, width_m: float) -> str:
    """The same, said during the test: r of the wires has it."""
    return (
        f"wire {name} sticks: it differs by {width_m * 1e3:.2f} mm between the way out and the way back; "
        "r is off by it, and the analysis after the test leaves it out"
    )


def slow(family: str, time_constant_s: float, *, left_out: bool) -> FamilyFinding:
    done = (
        "r is taken from the other family"
        if left_out
        else "EAV is too low and α too large: the other family does not reach far enough to take its place"
    )
    text = (
        f"{family} are slow: they follow like a first-order instrument of {time_constant_s * 1e3:.1f} ms "
        f"(a filter, a weak wire spring); {done}"
    )
    return FamilyFinding(
        family, (), "slow", time_constant_s, "s", "left out" if left_out else "none", "warning", text
    )


def bending(frequency_hz: float, rms_rad: float, *, left_out: bool) -> FamilyFinding:
    """Wires that ring with a wall that bends; LVDTs at its base do not."""
    done = (
        "r and θ0 are taken from the LVDTs"
        if left_out
        else "r is off by it: the LVDTs cannot take their place"
    )
    text = (
        f"wires ring at {frequency_hz:.1f} Hz about the LVDTs at the base, {rms_rad * 1e3:.2f} mrad rms: the "
        f"wall bends, and tiltmeters follow that as well; {done}"
    )
    return FamilyFinding(
        "wires", (), "bending", rms_rad, "rad", "left out" if left_out else "none", "warning", text
    )


def not_done(finding: FamilyFinding) -> FamilyFinding:
    """The finding where nothing could be done about it: in what was left, no test is found."""
    text = f"{finding.text}. That way no test is found in the recording: it was not done"
    return replace(finding, treatment="none", text=text)


def late(family: str, by_s: float, others: str, *, left_out: bool = False) -> FamilyFinding:
    """A delay that no plan tells; `left_out`: the family's motion has another form, too."""
    word = "late" if by_s > 0 else "early"
    text = f"{family} are {abs(by_s) * 1e3:.1f} ms {word} against {others}: a delay unknown to the task plan"
    if family == "accelerometers":
        if by_s < 0:
            text += f", or a filter that {others} have in common and that makes r by EAV too low"
        return FamilyFinding(family, (), "late", by_s, "s", "none", "warning", text)
    if left_out:
        done = "; what makes them late (a filter, a drum that swings) bends their motion too: r is not theirs"
        return FamilyFinding(family, (), "late", by_s, "s", "left out", "warning", text + done)
    return FamilyFinding(
        family, (), "late", by_s, "s", "put in step", "warning", text + "; they were put in step"
    )


def one_of_two_late(later: str, by_s: float) -> FamilyFinding:
    text = (
        f"{later} are {by_s * 1e3:.1f} ms later than the other family, and nothing tells which is right: "
        "impact times may be off by as much"
    )
    return FamilyFinding("wires or LVDTs", (), "late", by_s, "s", "none", "warning", text)


def drift(family: str, by_rad: float) -> FamilyFinding:
    text = (
        f"{family}: wires and LVDTs drift apart by {by_rad * 1e3:+.2f} mrad over the motion: a zero moves "
        "(temperature, a slipping fixture)"
    )
    return FamilyFinding(family, (), "drift", by_rad, "rad", "none", "warning", text)


def gain(family: str, share: float) -> FamilyFinding:
    text = (
        f"{family}: wires show {share:+.2%} of rotation against LVDTs: a calibration is wrong, a fixture "
        "slips, or the wall is not rigid"
    )
    return FamilyFinding(family, (), "gain", share, "1", "none", "warning", text)


def disagreement(text: str) -> FamilyFinding:
    """Wires and LVDTs give different r, and nothing simpler explains it."""
    return FamilyFinding("wires or LVDTs", (), "motion", 0.0, "1", "none", "warning", text)


def not_housner(text: str) -> FamilyFinding:
    """EAV and CRT differ."""
    return FamilyFinding("wires or LVDTs", (), "motion", 0.0, "1", "none", "warning", text)


def r_by_speed(r_fast: float, r_slow: float) -> FamilyFinding:
    """r changes with the size of the motion."""
    text = (
        f"r changes from {r_fast:.3f} at the fastest impacts to {r_slow:.3f} at the slowest, beyond its "
        "scatter: the wall bounces, twists or rolls on its edges, and no one r holds for its impacts"
    )
    return FamilyFinding("wall", (), "speed", r_slow - r_fast, "1", "none", "warning", text)


def r_perhaps_by_speed(r_fast: float, r_slow: float, sigma: float, *, notable: bool) -> FamilyFinding:
    """r may change with the size of the motion; the errors hold it. A warning where it is `notable`."""
    severity: Literal["info", "warning"] = "warning" if notable else "info"
    text = (
        f"r may change with speed: {r_fast:.3f} at the fastest impacts, {r_slow:.3f} at the slowest. The "
        f"change is known to ± {sigma:.3f}, and scatter alone may make it; the error of r holds it"
    )
    return FamilyFinding("wall", (), "speed", r_slow - r_fast, "1", "none", severity, text)


def alpha_of_survey(share: float, shift: float, *, notable: bool) -> FamilyFinding:
    """The wall rocks with another α than the survey's; a warning where CRT is off by what is `notable`."""
    severity: Literal["info", "warning"] = "warning" if notable else "info"
    text = (
        f"{_alpha_off(share, shift)}; its error holds that. Usual causes: round or broken edges, pivots "
        "inside them, a survey of another wall"
    )
    return FamilyFinding("survey", (), "alpha", shift, "1", "none", severity, text)


def p_of_survey(share: float, p_rad_s: float, survey_rad_s: float, *, notable: bool) -> FamilyFinding:
    """The wall rocks faster or slower than the survey's block; a warning where it is `notable`."""
    severity: Literal["info", "warning"] = "warning" if notable else "info"
    text = (
        f"the wall rocks with p = {p_rad_s:.3f} rad/s, {share:+.1%} off the survey's {survey_rad_s:.3f}: "
        "its size, inertia or pivots are others, or the sampling rate is "
        f"{share:+.1%} off the true one, and all times, periods and speeds with it. r is not"
    )
    return FamilyFinding("survey", (), "p", share, "1", "none", severity, text)


def r_by_side(r_right: float, r_left: float) -> FamilyFinding:
    """r differs between the edges."""
    text = (
        f"r is {r_right:.3f} where a lean to +x ends and {r_left:.3f} where one to −x ends, beyond its "
        "scatter: the edges differ, and the r of the decay is the mean of two"
    )
    return FamilyFinding("wall", (), "side", r_right - r_left, "1", "none", "warning", text)


def lost_between(share: float) -> FamilyFinding:
    """Speed is lost where a block on its edge loses none."""
    text = (
        f"half-cycles end {share:.1%} slower than they begin: friction or drag acts between the impacts, "
        "and r from the decay holds it as well"
    )
    return FamilyFinding("wall", (), "loss", -share, "1", "none", "warning", text)


def pause_at_impacts(pause_s: float, share: float) -> FamilyFinding:
    """The wall is longer at its base than an impact takes."""
    text = (
        f"impacts take {pause_s * 1e3:.2f} ms: the wall bounces or its joint yields, and r is of all that "
        f"happens meanwhile ({share:.1%} of the speed), not of an impact"
    )
    return FamilyFinding("wall", (), "pause", share, "1", "none", "warning", text)


def hop_at_impacts(hop_s: float, share: float) -> FamilyFinding:
    """The wall leaves the ground at its impacts."""
    text = (
        f"the wall hops at its impacts, for about {hop_s * 1e3:.0f} ms at a time: off the ground nothing "
        f"slows its turning, and r by the decay is too large by about {share:.1%}. Usual causes: a hard or "
        "uneven bed, mortar or grit under an edge, a twist of the base"
    )
    return FamilyFinding("wall", (), "hop", share, "1", "none", "warning", text)


def r_scatters(share: float, standard_error: float) -> FamilyFinding:
    """Single impacts differ more than those of walls that strike the same way each time."""
    text = (
        f"r scatters by {share:.1%} from impact to impact, more than that of a wall which strikes the same "
        f"way each time: this test knows it to ± {standard_error:.4f} only, its single impacts tell nothing. "
        "Usual causes: grit in the joint, a twist, edges that crumble"
    )
    return FamilyFinding("wall", (), "scatter", share, "1", "none", "warning", text)


def not_housner_motion(residual_rad: float, noise_rad: float, *, notable: bool) -> FamilyFinding:
    """The fit of the whole motion leaves more than noise; a warning where it is `notable`."""
    severity: Literal["info", "warning"] = "warning" if notable else "info"
    text = (
        f"Housner's motion leaves {residual_rad * 1e3:.2f} mrad rms, noise is {noise_rad * 1e3:.3f}: the "
        "wall does more than the model, and r by the fit of the whole motion is that of the nearest block. "
        "Usual causes: a base that is not level, a cable that still pulls, a wall that bends"
    )
    return FamilyFinding("wall", (), "misfit", residual_rad, "rad", "none", severity, text)


def alpha_by_side(lean_rad: float) -> FamilyFinding:
    """α of one side is larger than that of the other, by twice `lean_rad`, which is signed as θ."""
    side = "θ > 0" if lean_rad > 0.0 else "θ < 0"
    text = (
        f"α is {2e3 * abs(lean_rad):.1f} mrad larger where {side} than to the other side: the fit of the "
        "whole motion counts with both, CRT with their mean. Usual causes: a base that is not level, a mass "
        "off the middle, unequal edges, a cable to one side"
    )
    return FamilyFinding("wall", (), "lean", lean_rad, "rad", "none", "warning", text)


def edges_yield(inset_m: float, sigma_m: float) -> FamilyFinding:
    """The weight of the upright wall rests `inset_m` inside the edges, with this standard error."""
    text = (
        f"the edges yield: the weight rests {inset_m * 1e3:.1f} ± {sigma_m * 1e3:.1f} mm inside them where "
        "the wall is upright, and further out the more it leans. p and α of the fit are those of sharp edges "
        "and hold this in their errors; those by durations and peaks are the nearest block's. Usual causes: "
        "crushed or soft edges, mortar that is pressed out, packing under the edges"
    )
    return FamilyFinding("wall", (), "edge", inset_m, "m", "none", "warning", text)


def slow_release(misfit_share: float) -> FamilyFinding:
    """The wall was let go slowly, or pushed: its fall is not that of a block from rest at θ0."""
    text = (
        "the release was no clean one: the fall does not start from rest at the hold, so that r by the peaks "
        "is taken from the first peak after it. Usual causes: a release that opens slowly, a rope that drags"
    )
    return FamilyFinding("wall", (), "release", misfit_share, "1", "removed", "warning", text)


def perhaps_hops(hop_s: float, share: float) -> FamilyFinding:
    """The wall may leave the ground at its impacts; the stated errors hold it."""
    text = (
        f"the wall may hop at its impacts, for about {hop_s * 1e3:.0f} ms at a time: r by the decay would be "
        f"too large by about {share:.1%}. Noise may make it; the error of r holds it"
    )
    return FamilyFinding("wall", (), "hop", share, "1", "none", "info", text)


def not_housner_durations(family: str, sigmas: float) -> FamilyFinding:
    """Durations of half-cycles do not follow from their peaks."""
    text = (
        f"half-cycles by {family} last longer or shorter than those of any rigid block with their peaks "
        f"({sigmas:.0f} σ rms): the wall yields, bounces or twists, or an instrument bends its motion"
    )
    return FamilyFinding(family, (), "duration", sigmas, "1", "none", "warning", text)


def pivots_inside(left_m: float, right_m: float, r_max: float, r_max_edges: float) -> FamilyFinding:
    """The wall turns about points inside its edges: r stands, its largest value is another one."""
    text = (
        f"the wall turns about points {left_m * 1e3:.1f} mm (−x) and {right_m * 1e3:.1f} mm (+x) inside its "
        f"edges: the largest r of a rigid block on them is {r_max:.4f}, on its edges {r_max_edges:.4f}"
    )
    return FamilyFinding("wall", (), "pivot", 0.5 * (left_m + right_m), "m", "none", "info", text)


def level(family: str, by_rad: float, share: float) -> FamilyFinding:
    """θ0 of one family is off while the others agree."""
    text = (
        f"{family} show θ0 by {by_rad * 1e3:+.2f} mrad ({share:+.2%}) off what the other families agree on: "
        "a gain or a zero is wrong, or a fixture slipped"
    )
    return FamilyFinding(family, (), "gain", share, "1", "none", "warning", text)


def slow_while_live(family: str, time_constant_s: float) -> str:
    """A family that follows slowly, said during the test."""
    return (
        f"{family} are slow: they follow like a first-order instrument of {time_constant_s * 1e3:.1f} ms; "
        "r by EAV from them is too low, and the analysis after the test leaves them out"
    )


def late_while_live(family: str, by_s: float, others: str) -> str:
    """A family that is late, said during the test: r is not off by it, times are."""
    late = f"{family} are {by_s * 1e3:.1f} ms late against {others}"
    return f"{late}: impact times are off by as much, r is not"


def after_shocks_while_live(by_s: float) -> str:
    """Wires that show the impacts after the accelerometers, said during the test."""
    return (
        f"wires are {by_s * 1e3:.1f} ms late against the accelerometers: times are off by as much, and "
        "r by EAV is too low if a filter makes them so"
    )


def drift_while_live(by_rad: float) -> str:
    """Wires and LVDTs that drift apart, said during the test."""
    return (
        f"wires and LVDTs drift apart by {by_rad * 1e3:+.2f} mrad: a zero moves; if that of the wires "
        "does, r is off by it, above all by the last small half-cycles"
    )


def bending_while_live(frequency_hz: float, rms_rad: float, *, lvdts_follow: bool) -> str:
    """Wires that ring with a wall that bends, said during the test."""
    return (
        f"wires ring at {frequency_hz:.1f} Hz about the LVDTs at the base, {rms_rad * 1e3:.2f} mrad rms: the "
        "wall bends; r from the wires is off by it"
        + (", and the analysis after the test takes r from the LVDTs" if lvdts_follow else "")
    )


def alpha_while_live(share: float, shift: float) -> str:
    """A survey whose α is not that of the motion, said during the test."""
    return f"{_alpha_off(share, shift)}, r by EAV is not"


def _alpha_off(share: float, shift: float) -> str:
    return (
        f"the wall rocks like a block whose α is {share:+.1%} off the survey's: r by the peaks (CRT) counts "
        f"with the survey's and is {shift:+.4f} off that with the wall's own"
    )
