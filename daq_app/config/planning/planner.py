"""The planner: a rig's channels → the fewest valid NI tasks, or every reason why not.

One rate for the whole run (docs/decisions/0002): tasks share one sample clock, and a module that
cannot follow it is refused.
"""

from __future__ import annotations

import datetime as dt
import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from daq_app.config.errors import ConfigError, Problem
from daq_app.config.hardware import catalogue
from daq_app.config.hardware.inventory import Device, devices_of
from daq_app.config.hardware.wiring import channel_key, terminal_of, wiring_problems
from daq_app.config.planning.grouping import grouped
from daq_app.config.planning.plan import PlannedChannel, PlannedTask, TaskPlan
from daq_app.config.planning.plan_notes import plan_notes
from daq_app.config.rig import Channel, ClockCable, Rig

_GroupKey = tuple[str, str]
"""(clock domain, task family): modules of one group share a task."""


@dataclass(frozen=True, slots=True)
class _Member:
    index: int
    channel: Channel
    device: Device


def plan_tasks(rig: Rig, file: str = "", today: dt.date | None = None) -> TaskPlan:
    """The task plan of a rig; notes judge certificates by `today` (default: the current date).

    Raises `ConfigError` with every rule of the hardware that the rig breaks.
    """
    devices, problems = channel_problems(rig, dict(enumerate(rig.channels)), file)
    if problems:
        raise ConfigError(grouped(problems))
    groups = _groups(_members(dict(enumerate(rig.channels)), devices))
    rate = _common_rate(groups, rig.acquisition.rate_hz)
    tasks = _tasks(groups, rig, rate)
    return TaskPlan(
        tasks=tasks,
        rate_hz=rate,
        channel_ids=rig.channel_ids,
        read_samples=max(1, round(rig.acquisition.read_period_s * rate)),
        notes=plan_notes(rig, tasks, devices, today or dt.date.today()),
    )


def channel_problems(
    rig: Rig, channels: Mapping[int, Channel], file: str
) -> tuple[dict[str, Device], list[Problem]]:
    """The rig's devices, and every conflict of its `channels` (rig index → channel) with them."""
    listed, problems = devices_of(rig.hardware, file)
    problems += wiring_problems(channels, listed, file)
    devices = {name: device for name, device in listed.items() if device}
    members = _members(channels, devices)
    problems += _speed_problems(members, rig.acquisition.rate_hz, file)
    problems += _clock_problems(members, rig.hardware.clock_cable, file)
    return devices, problems


def _members(channels: Mapping[int, Channel], devices: Mapping[str, Device]) -> list[_Member]:
    """The channels whose device is known, with it."""
    return [
        _Member(index, channel, devices[terminal_of(channel)[0]])
        for index, channel in channels.items()
        if terminal_of(channel)[0] in devices
    ]


def _clock_domain(device: Device) -> str:
    """Modules with the same domain can be clocked together without wires between chassis."""
    if device.chassis.network_synchronised:
        return "network-synchronised cDAQ"
    return device.chassis_name


def _groups(members: list[_Member]) -> dict[_GroupKey, list[_Member]]:
    """Members of each task, in scan order: by device (rig's order of slots), then by rig order.

    All channels of one module stay together, so a module is never in two tasks, and channels of
    one family stay neighbours, which keeps the steps that the multiplexer must settle small.
    """
    groups: dict[_GroupKey, list[_Member]] = {}
    for member in members:
        groups.setdefault((_clock_domain(member.device), member.device.product.task_family), []).append(
            member
        )
    for group in groups.values():
        group.sort(key=lambda member: (member.device.chassis_name, member.device.slot, member.index))
    return groups


def _speed_problems(members: list[_Member], rate_hz: float, file: str) -> list[Problem]:
    problems = []
    counts = Counter(member.device.name for member in members)
    devices = {member.device.name: member.device for member in members}
    sound: list[catalogue.Product] = []
    for name, n in counts.items():
        device, product = devices[name], devices[name].product
        if product.converter == "slow" and all(m.channel.auxiliary for m in members if m.device is device):
            continue  # told by the plan's notes: its values repeat
        if product.converter == "slow":
            wrong = f"{product.name} ({name}) makes at most {product.max_rate_hz:g} samples a second; "
            wrong += f"at {rate_hz:g} Hz it would repeat old points without a word"
            right = f"Wire its {n} sensor(s) to a faster module, for instance NI 9205"
            problems.append(Problem(file, device.key, wrong, right))
            continue
        asked, limit = catalogue.aggregate_rate_hz(product, n, rate_hz)
        if asked > limit * (1 + 1e-9):
            wrong = f"{n} channels at {rate_hz:g} Hz are {asked / 1e3:g} kS/s on {product.name} ({name}), "
            wrong += f"which makes {limit / 1e3:g} kS/s at most"
            right = (
                f"Use at most {math.floor(limit / rate_hz)} of its channels, or a lower acquisition.rate_hz"
            )
            problems.append(Problem(file, device.key, wrong, right))
        else:
            sound.append(product)
    if not problems and sound:
        try:
            catalogue.coerce_rate(sound, rate_hz)
        except ValueError as error:
            problems.append(Problem(file, "acquisition.rate_hz", str(error), "Ask for a lower rate"))
    return problems


def _clock_problems(members: list[_Member], cable: ClockCable | None, file: str) -> list[Problem]:
    """A run has one clock: all modules must be able to share it."""
    problems = []
    domains: dict[str, _Member] = {}
    for member in members:
        domains.setdefault(_clock_domain(member.device), member)
    if len(domains) > 1:
        first, *others = domains.values()
        for other in others:
            if cable is not None and {first.device.chassis.bus, other.device.chassis.bus} == {"cdaq"}:
                continue
            wrong = (
                f"`{other.device.chassis_name}` and `{first.device.chassis_name}` have no common sample clock"
            )
            right = (
                "Put all modules into one chassis or into network-synchronised ones (cDAQ-9185, 9189), or "
                "join PFI terminals of cDAQ chassis by cables and add [hardware.clock_cable]"
            )
            if other.device.chassis.bus != first.device.chassis.bus:
                wrong += " (cDAQ and PXIe cannot share a task)"
            problems.append(
                Problem(file, channel_key(other.index, other.channel, "physical_channel"), wrong, right)
            )
    groups = _groups(members)
    masters = [
        key for key, group in groups.items() if any(not m.device.product.external_clock for m in group)
    ]
    if (len(domains) == 1 or cable is not None) and len(masters) > 1:
        families = " and ".join(family for _, family in masters)
        wrong = f"modules of {families} each insist on their own sample clock"
        right = "Use modules of one of these families only"
        problems.append(Problem(file, "hardware.chassis", wrong, right))
    for chassis_name, n in Counter(
        group[0].device.chassis_name for group in groups.values() if group
    ).items():
        engines = next(
            m.device.chassis.ai_timing_engines for m in members if m.device.chassis_name == chassis_name
        )
        if engines is not None and n > engines:
            wrong = f"`{chassis_name}` would need {n} analogue-input tasks and has {engines} timing engines"
            problems.append(Problem(file, "hardware.chassis", wrong, "Use modules that can share a task"))
    return problems


def _common_rate(groups: Mapping[_GroupKey, list[_Member]], requested_hz: float) -> float:
    products = {member.device.product.name: member.device.product for g in groups.values() for member in g}
    return catalogue.coerce_rate(list(products.values()), requested_hz)


def _tasks(groups: Mapping[_GroupKey, list[_Member]], rig: Rig, rate: float) -> tuple[PlannedTask, ...]:
    # Slaves first in the tuple would invite starting them in any order; roles say who is last.
    ordered = sorted(
        groups.values(), key=lambda g: (all(m.device.product.external_clock for m in g), -len(g))
    )
    buffer_samples = math.ceil(rig.acquisition.buffer_s * rate)
    master_device = ordered[0][0].device
    prefix = f"/{master_device.name}/ai"
    if master_device.chassis.bus == "cdaq":
        prefix = f"/{master_device.chassis_name}/ai"
    domains = len({_clock_domain(group[0].device) for group in ordered})
    tasks = []
    for number, group in enumerate(ordered):
        skews = catalogue.task_skews_s([(m.device.name, m.device.product) for m in group], rate)
        planned = tuple(
            PlannedChannel(m.channel, m.index, skew, catalogue.input_delay_s(m.device.product, rate))
            for m, skew in zip(group, skews, strict=True)
        )
        slave = number > 0
        cable = rig.hardware.clock_cable if domains > 1 else None
        far = cable is not None and _clock_domain(group[0].device) != _clock_domain(master_device)
        clock, trigger = f"{prefix}/SampleClock", f"{prefix}/StartTrigger"
        if cable is not None and far:
            place = f"/{group[0].device.chassis_name}"
            clock, trigger = f"{place}/{cable.clock}", f"{place}/{cable.trigger}"
        shown = f"/{master_device.chassis_name}"
        tasks.append(
            PlannedTask(
                name=_task_name(group),
                channels=planned,
                requested_rate_hz=rig.acquisition.rate_hz,
                rate_hz=rate,
                role="slave" if slave else "master",
                clock_source=clock if slave else "",
                start_trigger_source=trigger if slave else "",
                exported_clock="" if slave or cable is None else f"{shown}/{cable.clock}",
                exported_trigger="" if slave or cable is None else f"{shown}/{cable.trigger}",
                buffer_samples=buffer_samples,
            )
        )
    return tuple(tasks)


def _task_name(group: list[_Member]) -> str:
    device = group[0].device
    name = (
        f"{device.chassis_name}_{device.product.task_family}"
        if device.chassis.bus == "pxie"
        else device.chassis_name
    )
    return f"rocking_{name}".replace(" ", "_").replace("-", "_")
