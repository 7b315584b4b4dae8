"""A rig and its plan as tables for the terminal."""

from __future__ import annotations

from collections.abc import Iterator

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from daq_app.config import Rig, TaskPlan
from daq_app.config.hardware import catalogue
from daq_app.config.hardware.inventory import Device, devices_of
from daq_app.config.hardware.wiring import terminal_of
from daq_app.config.shown_units import shown_unit


def plan_tables(rig: Rig, plan: TaskPlan) -> Iterator[RenderableType]:
    """Heading, specimen, sensors, wiring, tasks, modules and notes."""
    devices = {name: device for name, device in devices_of(rig.hardware)[0].items() if device}
    title = f"{rig.name}: {rig.description}" if rig.description else rig.name
    yield Text(title, style="bold")
    yield _specimen_table(rig)
    yield _sensor_table(rig)
    yield _wiring_table(rig, plan, devices)
    yield _task_table(plan)
    yield _module_table(plan, devices)
    yield _notes(plan)


def _table(title: str, *columns: tuple[str, bool]) -> Table:
    table = Table(title=title, title_justify="left", header_style="bold", pad_edge=False)
    for name, right in columns:
        table.add_column(name, justify="right" if right else "left", overflow="fold")
    return table


def _specimen_table(rig: Rig) -> Table:
    specimen = rig.specimen
    table = _table("Specimen and recording", ("", False), ("value", True), ("unit", False), ("", False))
    rows: list[tuple[str, str, float, str]] = [
        ("weight", "weight_n", specimen.weight_n / 1e3, "kN"),
        ("height", "height_m", specimen.height_m, "m"),
        ("length", "length_m", specimen.length_m, "m"),
        ("rotational inertia", "rotational_inertia_kg_m2", specimen.rotational_inertia_kg_m2, "kg m²"),
        ("R0", "r0_m", specimen.r0_m, "m"),
        ("α0", "alpha0_rad", specimen.alpha0_rad, "rad"),
        ("p", "p_rad_s", specimen.p_rad_s, "rad/s"),
        ("base width b = 2 R0 sin α0", "", specimen.base_width_m, "m"),
    ]
    for label, key, value, unit in rows:
        remark = "assumed" if key in specimen.assumed else "derived" if not key else ""
        table.add_row(f"{specimen.name} {label}", f"{value:.6g}", unit, remark)
    table.add_row("connection", rig.hardware.connection, "", "")
    table.add_row("requested rate", f"{rig.acquisition.rate_hz:g}", "Hz", "")
    table.add_row("pre-trigger", f"{rig.acquisition.pre_trigger_s:g}", "s", "")
    table.add_row("longest test", f"{rig.acquisition.max_duration_s:g}", "s", "")
    return table


def _sensor_table(rig: Rig) -> Table:
    table = _table(
        f"Sensors ({len(rig.channels)})",
        ("id", False),
        ("family", False),
        ("x, y, z in m", True),
        ("sensitivity", True),
        ("range", True),
        ("noise", True),
        ("due", False),
    )
    for channel in rig.channels:
        low, high = channel.range_si
        unit, scale = shown_unit(channel.si_unit)
        sign = "−" if channel.polarity < 0 else ""
        table.add_row(
            channel.id,
            channel.family,
            ", ".join(f"{value:.3f}" for value in channel.position_m),
            f"{sign}{channel.sensitivity:g} {channel.sensitivity_unit}",
            f"{low * scale:g} to {high * scale:g} {unit}",
            f"{channel.noise_si * scale:g}",
            channel.certificate.due.isoformat(),
        )
    return table


def _wiring_table(rig: Rig, plan: TaskPlan, devices: dict[str, Device]) -> Table:
    planned = {p.channel.id: p for task in plan.tasks for p in task.channels}
    table = _table(
        "Wiring and timing (in time, sample k shows k / rate + skew − delay)",
        ("id", False),
        ("terminal", False),
        ("configuration", False),
        ("input V", True),
        ("module V", True),
        ("skew µs", True),
        ("delay ms", True),
    )
    for channel in rig.channels:
        product = devices[terminal_of(channel)[0]].product
        low, high = channel.input_range_v
        coerced = (low, high)
        if channel.measurement != "thermocouple":
            coerced = catalogue.coerce_range(product, low, high, channel.measurement)
        table.add_row(
            channel.id,
            channel.physical_channel,
            channel.terminal_config,
            f"{low:g} to {high:g}",
            f"{coerced[0]:g} to {coerced[1]:g}",
            f"{planned[channel.id].skew_s * 1e6:.1f}",
            f"{planned[channel.id].input_delay_s * 1e3:.2f}",
        )
    return table


def _task_table(plan: TaskPlan) -> Table:
    table = _table(
        "NI tasks (slaves are armed before the master)",
        ("task", False),
        ("role", False),
        ("channels", True),
        ("asked Hz", True),
        ("coerced Hz", True),
        ("sample clock", False),
        ("start trigger", False),
        ("buffer", True),
    )
    for task in plan.tasks:
        table.add_row(
            task.name,
            task.role,
            str(len(task.channels)),
            f"{task.requested_rate_hz:g}",
            f"{task.rate_hz:.3f}",
            task.clock_source or "its own",
            task.start_trigger_source or "software",
            f"{task.buffer_samples} samples",
        )
    return table


def _module_table(plan: TaskPlan, devices: dict[str, Device]) -> Table:
    table = _table(
        "Modules",
        ("device", False),
        ("product", False),
        ("converter", False),
        ("channels", True),
        ("kS/s", True),
        ("of kS/s", True),
        ("load", True),
        ("µs a channel", True),
    )
    for task in plan.tasks:
        names = list(dict.fromkeys(terminal_of(p.channel)[0] for p in task.channels))
        counts = [sum(terminal_of(p.channel)[0] == name for p in task.channels) for name in names]
        periods = catalogue.convert_periods_s(
            [(devices[name].product, n) for name, n in zip(names, counts, strict=True)], task.rate_hz
        )
        for name, n, period in zip(names, counts, periods, strict=True):
            product = devices[name].product
            asked, limit = catalogue.aggregate_rate_hz(product, n, task.rate_hz)
            table.add_row(
                name,
                product.name,
                product.converter.replace("_", "-"),
                f"{n} of {product.n_ai}",
                f"{asked / 1e3:.1f}",
                f"{limit / 1e3:g}",
                f"{100 * asked / limit:.0f} %",
                f"{period * 1e6:.2f}",
            )
    return table


def _notes(plan: TaskPlan) -> Text:
    text = Text("Notes", style="italic")
    for note in plan.notes:
        text.append("\n")
        text.append(f"{note.severity}: ", style="bold yellow" if note.severity == "warning" else "bold")
        text.append(f"{note.where}: {note.text}", style="default")
    return text
