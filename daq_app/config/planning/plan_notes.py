"""What the operator should know of a plan though nothing in it is wrong."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator, Mapping, Sequence

from daq_app.config.hardware import catalogue
from daq_app.config.hardware.inventory import Device
from daq_app.config.hardware.reach import LARGEST_LEVEL, range_ends_at
from daq_app.config.hardware.wiring import MAX_SOURCE_IMPEDANCE_OHM, terminal_of
from daq_app.config.planning.geometry_notes import geometry_notes
from daq_app.config.planning.plan import PlannedTask, PlanNote
from daq_app.config.rig import Channel, Rig, names

_DUE_SOON_DAYS = 30


def plan_notes(
    rig: Rig, tasks: Sequence[PlannedTask], devices: Mapping[str, Device], today: dt.date
) -> tuple[PlanNote, ...]:
    """All notes of a plan: warnings first."""
    notes = [
        *_rate_notes(rig, tasks, devices),
        *_skew_notes(tasks, devices),
        *_delay_notes(tasks, devices),
        *_rotation_notes(rig),
        *_auxiliary_notes(rig, devices),
        *_coupling_notes(rig),
        *_impedance_notes(rig, devices),
        *_potentiometer_notes(rig),
        *_range_notes(rig),
        *geometry_notes(rig),
        *_certificate_notes(rig, today),
        *_task_notes(tasks, devices),
        *_clock_notes(tasks, devices),
    ]
    return tuple(sorted(notes, key=lambda note: note.severity != "warning"))


def _info(where: str, text: str) -> PlanNote:
    return PlanNote("info", where, text)


def _warning(where: str, text: str) -> PlanNote:
    return PlanNote("warning", where, text)


def _device(channel: Channel, devices: Mapping[str, Device]) -> Device:
    return devices[terminal_of(channel)[0]]


def _rate_notes(rig: Rig, tasks: Sequence[PlannedTask], devices: Mapping[str, Device]) -> Iterator[PlanNote]:
    asked, rate = rig.acquisition.rate_hz, tasks[0].rate_hz
    if abs(rate - asked) <= 1e-6 * asked:
        return
    products = {_device(p.channel, devices).product for task in tasks for p in task.channels}
    causes = sorted(p.name for p in products if p.delta_sigma) or sorted(p.name for p in products)
    yield _warning(
        "acquisition.rate_hz",
        f"{asked:g} Hz becomes {rate:.2f} Hz for all {len(rig.channels)} channels: {', '.join(causes)} "
        "makes only certain rates and clocks the whole run. Every time axis uses the rate read back",
    )


def _skew_notes(tasks: Sequence[PlannedTask], devices: Mapping[str, Device]) -> Iterator[PlanNote]:
    for task in tasks:
        skews: dict[str, list[float]] = {}
        for planned in task.channels:
            skews.setdefault(terminal_of(planned.channel)[0], []).append(planned.skew_s)
        for name, of_device in skews.items():
            last = max(of_device)
            if last <= 0:
                continue
            product = devices[name].product
            text = (
                f"{product.name} scans its channels one after the other: the last is read "
                f"{last * 1e6:.1f} µs after the first; known per channel, corrected in the analysis"
            )
            settling = last / (len(of_device) - 1) - product.min_convert_period_s
            if settling < catalogue.PADDING_S * (1 - 1e-6):
                yield _warning(
                    name,
                    f"{text}. Only {settling * 1e6:.1f} µs are left to settle between channels instead of "
                    f"{catalogue.PADDING_S * 1e6:.0f} µs: spread the sensors over more modules",
                )
            else:
                yield _info(name, text)


def _delay_notes(tasks: Sequence[PlannedTask], devices: Mapping[str, Device]) -> Iterator[PlanNote]:
    delayed: dict[str, float] = {}
    for task in tasks:
        for planned in task.channels:
            if planned.input_delay_s > 0:
                delayed[terminal_of(planned.channel)[0]] = planned.input_delay_s
    for name, delay in delayed.items():
        yield _info(
            name,
            f"{devices[name].product.name} lags by {delay * 1e3:.2f} ms (digital filter); the driver does "
            "not correct it, the run file stores it and the analysis does",
        )


def _rotation_notes(rig: Rig) -> Iterator[PlanNote]:
    if not any(channel.family == "wire" for channel in rig.channels):
        yield _warning(
            rig.name,
            "has no wire potentiometer, from which the rotation is computed: tests are recorded, but their "
            "end is not noticed and r is not computed. Add one wire at least",
        )


def _auxiliary_notes(rig: Rig, devices: Mapping[str, Device]) -> Iterator[PlanNote]:
    beside = [channel for channel in rig.channels if channel.auxiliary]
    if beside:
        yield _info(
            names(beside),
            "are recorded, checked, shown and exported; rocking analysis and diagnosis leave them out",
        )
    slow: dict[str, list[Channel]] = {}
    for channel in beside:
        device = _device(channel, devices)
        if device.product.converter == "slow":
            slow.setdefault(device.name, []).append(channel)
    for name, channels in slow.items():
        product = devices[name].product
        yield _warning(
            names(channels),
            f"{product.name} makes at most {product.max_rate_hz:g} values a second: each is repeated until "
            "the next, as NI-DAQmx does for slow modules of a fast task",
        )


def _coupling_notes(rig: Rig) -> Iterator[PlanNote]:
    iepe = [channel for channel in rig.channels if channel.measurement == "iepe"]
    if iepe:
        yield _info(
            names(iepe),
            "IEPE inputs are AC-coupled: they show impacts, but neither gravity nor slow rocking",
        )


def _impedance_notes(rig: Rig, devices: Mapping[str, Device]) -> Iterator[PlanNote]:
    ghosting = [
        channel
        for channel in rig.channels
        if channel.source_impedance_ohm > MAX_SOURCE_IMPEDANCE_OHM
        and _device(channel, devices).product.converter == "multiplexed"
    ]
    if ghosting:
        yield _warning(
            names(ghosting),
            f"source impedance above {MAX_SOURCE_IMPEDANCE_OHM:g} Ω on a multiplexed module: each reading "
            "keeps part of the channel before (ghosting). Buffer these sensors",
        )


def _potentiometer_notes(rig: Rig) -> Iterator[PlanNote]:
    wires = [c for c in rig.of_family("wire") if c.excitation.kind == "external_voltage"]
    if wires:
        yield _info(
            names(wires),
            "read as plain voltages of an external supply that is not sampled itself: a supply that drifts "
            "by 0.1 % moves the zero by 0.1 % of the voltage. Use a regulated supply; tare before each test",
        )


def _range_notes(rig: Rig) -> Iterator[PlanNote]:
    """Sensors that the largest planned release would drive out of range."""
    ends = [(channel, range_ends_at(rig, channel)) for channel in rig.channels]
    short = [(channel, end) for channel, end in ends if end < LARGEST_LEVEL]
    if short:
        yield _warning(
            names([channel for channel, _ in short]),
            f"will clip: the first range ends at θ/α = {min(end for _, end in short):.2f}, and releases go "
            f"up to {LARGEST_LEVEL:.2f}. Mount the sensor with more stroke, or check range_si",
        )


def _certificate_notes(rig: Rig, today: dt.date) -> Iterator[PlanNote]:
    overdue = [c for c in rig.channels if c.certificate.due < today]
    if overdue:
        earliest = min(c.certificate.due for c in overdue)
        yield _warning(
            names(overdue),
            f"calibration certificate overdue (since {earliest.isoformat()}). Recalibrate, or write the "
            "new certificate into the rig file",
        )
    soon = [c for c in rig.channels if 0 <= (c.certificate.due - today).days <= _DUE_SOON_DAYS]
    if soon:
        earliest = min(c.certificate.due for c in soon)
        yield _info(names(soon), f"calibration due soon ({earliest.isoformat()})")


def _task_notes(tasks: Sequence[PlannedTask], devices: Mapping[str, Device]) -> Iterator[PlanNote]:
    for task in tasks:
        chassis = _device(task.channels[0].channel, devices)
        engines = chassis.chassis.ai_timing_engines
        if engines is not None:
            yield _info(task.name, f"uses 1 of {engines} AI timing engines of {chassis.chassis_name}")
        if task.role == "slave":
            yield _info(task.name, f"is armed before the master and follows its clock ({task.clock_source})")
    unconfirmed = sorted(
        {
            _device(p.channel, devices).product.name
            for task in tasks
            for p in task.channels
            if "GK" in _device(p.channel, devices).product.source
        }
    )
    if unconfirmed:
        yield _info(
            ", ".join(unconfirmed),
            "some catalogue values are general knowledge, not read in NI's documents: compare ranges, rates "
            "and delays with what the driver reads back on site",
        )


__all__ = ["plan_notes"]


def _clock_notes(tasks: Sequence[PlannedTask], devices: Mapping[str, Device]) -> Iterator[PlanNote]:
    """How chassis come to one clock: over cables that somebody must plug, or over the network."""
    chassis = list(
        dict.fromkeys(_device(p.channel, devices).chassis_name for task in tasks for p in task.channels)
    )
    if len(chassis) < 2:
        return
    master = next(task for task in tasks if task.role == "master")
    if master.exported_clock:
        far = [task for task in tasks if task.clock_source.count("/") == 2]
        clocks = ", ".join(task.clock_source for task in far)
        starts = ", ".join(task.start_trigger_source for task in far)
        yield _warning(
            "hardware.clock_cable",
            f"{' and '.join(chassis)} are synchronised by cables: {master.exported_clock} to {clocks} "
            f"(sample clock), {master.exported_trigger} to {starts} (start)",
        )
    else:
        yield _info(
            "hardware.chassis",
            f"{' and '.join(chassis)} are synchronised over the network: no cable is needed",
        )
