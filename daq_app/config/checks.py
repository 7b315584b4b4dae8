"""Checks of what a rig says about itself, whatever hardware it is wired to."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import get_args

from daq_app.config.connection import parse_connection
from daq_app.config.errors import Problem
from daq_app.config.families import AUXILIARY
from daq_app.config.hardware.wiring import channel_key
from daq_app.config.rig import Channel, Family, Rig, Specimen
from daq_app.config.units import SENSITIVITY_TO_SI, sensitivity_units
from daq_app.config.validation import nearest

_P_TOLERANCE = 0.01
_OUTPUT_TOLERANCE = 1e-6
_FAR_M = 1.0
"""A sensor further than this outside the wall is a slip of units, not a sensor of the wall."""
_A_SENSOR: Mapping[str, str] = {
    "lvdt": "an LVDT",
    "wire": "a wire potentiometer",
    "accelerometer": "an accelerometer",
    "tiltmeter": "a tiltmeter",
    **{name: family.sensor for name, family in AUXILIARY.items()},
}
_MEASUREMENT_FAMILY: Mapping[str, tuple[Family, ...]] = {
    "iepe": ("accelerometer",),
    "lvdt_native": ("lvdt", "displacement"),
    "thermocouple": ("temperature",),
}


def rig_problems(
    rig: Rig, channels: Mapping[int, Channel], families: Mapping[str, int], file: str
) -> list[Problem]:
    """Problems of a rig. `channels` (rig index → channel) are those that could be read at all;
    `families` counts what the file lists, readable or not."""
    problems = list(_specimen_problems(rig.specimen, file))
    try:
        parse_connection(rig.hardware.connection)
    except ValueError as error:
        wrong = f"`{rig.hardware.connection}` is no connection"
        problems.append(Problem(file, "hardware.connection", wrong, str(error)))
    problems += _count_problems(rig, families, file)
    problems += _duplicate_ids(channels, file)
    for index, channel in channels.items():
        problems += _channel_problems(rig, index, channel, file)
    return problems


def _specimen_problems(specimen: Specimen, file: str) -> Iterator[Problem]:
    p = math.sqrt(specimen.weight_n * specimen.r0_m / specimen.rotational_inertia_kg_m2)
    if abs(p - specimen.p_rad_s) > _P_TOLERANCE * p:
        wrong = f"{specimen.p_rad_s:g} rad/s is not sqrt(weight · r0 / rotational inertia) = {p:.3f} rad/s"
        right = (
            "One of weight_n, r0_m, rotational_inertia_kg_m2 (about the base corner) and p_rad_s is mistyped"
        )
        yield Problem(file, "specimen.p_rad_s", wrong, right)
    inertia_g = specimen.rotational_inertia_kg_m2 - specimen.mass_kg * specimen.r0_m**2
    if inertia_g <= 0:
        wrong = f"is smaller than mass · r0² = {specimen.mass_kg * specimen.r0_m**2:.0f} kg m²"
        right = "Give the inertia about the base corner, not about the centre of mass"
        yield Problem(file, "specimen.rotational_inertia_kg_m2", wrong, right)
    if specimen.centroid_height_m >= specimen.height_m:
        wrong = f"puts the centre of mass {specimen.centroid_height_m:.2f} m high, above the wall's top"
        yield Problem(file, "specimen.r0_m", wrong, "r0_m is the distance from the base corner, in metres")


def _count_problems(rig: Rig, families: Mapping[str, int], file: str) -> Iterator[Problem]:
    expected = rig.expected_channels
    for family in get_args(Family):
        want, have = getattr(expected, family), families.get(family, 0)
        if want != have:
            total = sum(families.values())
            wrong = f"{have} {family} channels are listed, and {want} are expected"
            wrong += f" ({total} of {expected.total} channels in all)"
            right = "Add the missing [[channels]]" if have < want else "Remove what is too much"
            yield Problem(file, "channels", wrong, f"{right}, or correct expected_channels.{family}")


def _duplicate_ids(channels: Mapping[int, Channel], file: str) -> Iterator[Problem]:
    seen: dict[str, int] = {}
    for index, channel in channels.items():
        first = seen.setdefault(channel.id.casefold(), index)
        if first != index:
            wrong = f"`{channel.id}` is the id of channels[{first}] already"
            yield Problem(
                file, channel_key(index, channel, "id"), wrong, "Give each channel an id of its own"
            )


def _channel_problems(rig: Rig, index: int, channel: Channel, file: str) -> Iterator[Problem]:
    def problem(key: str, wrong: str, right: str) -> Problem:
        return Problem(file, channel_key(index, channel, key), wrong, right)

    low, high = channel.range_si
    if low >= high:
        yield problem("range_si", f"[{low:g}, {high:g}] is empty", "Give the smaller value first")
    in_low, in_high = channel.input_range_v
    if in_low >= in_high:
        yield problem("input_range_v", f"[{in_low:g}, {in_high:g}] is empty", "Give the smaller value first")
    certificate = channel.certificate
    if certificate.due < certificate.calibrated:
        wrong = f"is due on {certificate.due}, before it was calibrated ({certificate.calibrated})"
        yield problem("certificate", wrong, "Correct one of the two dates")
    yield from _geometry_problems(rig, index, channel, file)
    families = _MEASUREMENT_FAMILY.get(channel.measurement, (channel.family,))
    if channel.family not in families:
        wrong = f"{_A_SENSOR[channel.family]} cannot be measured as `{channel.measurement}`"
        yield problem("measurement", wrong, f'"{channel.measurement}" is for family "{families[0]}"')
    if (channel.family == "other") != bool(channel.unit.strip()):
        if channel.unit:
            yield problem("unit", f"{_A_SENSOR[channel.family]} has a unit already", "Remove it")
        else:
            yield problem("unit", "is missing", 'Write the unit of its quantity: unit = "N m"')
        return
    unit_fault = _unit_problem(index, channel, file)
    if unit_fault:
        yield unit_fault
    elif low < high and in_low < in_high and channel.measurement != "thermocouple":
        yield from _output_problems(index, channel, file)


def _geometry_problems(rig: Rig, index: int, channel: Channel, file: str) -> Iterator[Problem]:
    specimen = rig.specimen
    limits = (
        (-specimen.base_width_m / 2, specimen.base_width_m / 2),
        (-specimen.length_m / 2, specimen.length_m / 2),
        (0.0, specimen.height_m),
    )
    for axis, value, (low, high) in zip("xyz", channel.position_m, limits, strict=True):
        if channel.auxiliary:  # a rope's load cell, a laser on its frame
            break
        if not low - _FAR_M <= value <= high + _FAR_M:
            wrong = (
                f"{axis} = {value:g} m is more than {_FAR_M:g} m outside the wall ({low:.3f} to {high:.3f} m)"
            )
            yield Problem(
                file,
                channel_key(index, channel, "position_m"),
                wrong,
                "Positions are metres from the centre of the base: x thickness, y length, z up",
            )
    key = channel_key(index, channel, "anchor_m")
    if channel.family == "wire":
        if channel.anchor_m is None:
            right = "Add `anchor_m = [x, y, z]`, the fixed end of the wire in metres"
            yield Problem(file, key, "a wire potentiometer needs its anchor", right)
        elif not 0.05 <= math.dist(channel.anchor_m, channel.position_m) <= 50.0:
            length = math.dist(channel.anchor_m, channel.position_m)
            wrong = f"the wire would be {length:g} m long"
            yield Problem(file, key, wrong, "Give the fixed end of the wire, in metres, in the wall's frame")
    elif channel.anchor_m is not None:
        yield Problem(
            file, key, f"{_A_SENSOR[channel.family]} has no anchor", "Remove it, or correct `family`"
        )
    if channel.family == "lvdt" and channel.axis != "z":
        wrong = f"an LVDT of the base joint measures along z, not {channel.axis}"
        right = 'Write axis = "z"; axis = "x" or "y" in so many words for one that measures sideways'
        yield Problem(file, channel_key(index, channel, "axis"), wrong, right)
    if channel.family == "tiltmeter" and channel.axis == "z":
        right = 'Write axis = "x" for the rotation of the rocking motion, "y" for the one along the length'
        yield Problem(
            file, channel_key(index, channel, "axis"), "a tiltmeter cannot sense rotation towards z", right
        )


def _unit_problem(index: int, channel: Channel, file: str) -> Problem | None:
    unit = channel.sensitivity_unit
    fitting = sensitivity_units(channel.measurement, channel.si_unit)
    if unit in fitting:
        return None
    near = nearest(unit, fitting)
    hint = f"Did you mean `{near[0]}`? " if near and unit not in SENSITIVITY_TO_SI else ""
    kind = _A_SENSOR[channel.family]
    if channel.measurement not in ("voltage", "iepe"):
        kind += {
            "lvdt_native": " on a native LVDT module",
            "current": " with a current output",
            "bridge": " on a bridge module",
            "thermocouple": ", which the NI driver scales",
        }[channel.measurement]
    wrong = f"`{unit}` is no sensitivity unit for {kind}"
    right = f"{hint}Use {', '.join(fitting)}"
    return Problem(file, channel_key(index, channel, "sensitivity_unit"), wrong, right)


def _output_problems(index: int, channel: Channel, file: str) -> Iterator[Problem]:
    """The sensor's electrical output over its whole range must fit the input range."""
    low, high = electrical_range_v(channel)
    in_low, in_high = channel.input_range_v
    volts = {"current": "A", "bridge": "V/V"}.get(channel.measurement, "V")
    slack = _OUTPUT_TOLERANCE * max(1.0, in_high - in_low)
    if low < in_low - slack or high > in_high + slack:
        wrong = (
            f"over range_si the sensor gives {low:.4g} to {high:.4g} {volts}, beyond {in_low:g} to "
            f"{in_high:g} {volts}"
        )
        right = (
            f"Widen input_range_v, or correct sensitivity, offset, range_si ({channel.si_unit}) or polarity"
        )
        yield Problem(file, channel_key(index, channel, "input_range_v"), wrong, right)


def electrical_range_v(channel: Channel) -> tuple[float, float]:
    """Smallest and largest voltage at the terminals over the sensor's range."""
    ends = []
    for quantity in channel.range_si:
        if not channel.scaled_by_driver:
            ends.append(channel.offset + channel.polarity * quantity * channel.sensitivity_reading_per_si)
        elif channel.measurement == "iepe":  # AC-coupled: an offset in m/s² adds no voltage
            ends.append(channel.polarity * quantity * channel.sensitivity_v_per_si)
        else:
            reading_m = channel.offset + channel.polarity * quantity
            ends.append(reading_m * channel.sensitivity_v_per_si * channel.excitation.value)
    return min(ends), max(ends)
