"""`daq-app rig`: a rig file for one's own wall and hardware."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import tomli_w
import typer

from daq_app.cli.devices import devices_at, devices_of, product_at, reserve_at
from daq_app.cli.errors import EXIT_BAD_INPUT, print_paragraph, reported
from daq_app.cli.help_page import command_group
from daq_app.cli.terminal import echo
from daq_app.config import ConfigError, Problem, parse_rig
from daq_app.config.authoring import Block, read_sensor_table, spread_sensors, wiring_lines, write_rig_text
from daq_app.config.authoring.hardware_text import PXI_UNNAMED, chassis_tables, hardware_text
from daq_app.config.authoring.sensor_table import COLUMNS
from daq_app.config.authoring.terminals import CHASSIS
from daq_app.config.hardware import catalogue
from daq_app.config.hardware.max_file import listed_in_export

_Modules = Annotated[
    list[str] | None,
    typer.Option(
        help="NI's product name of a module, slot by slot; may be repeated.",
        show_default="as many NI 9205 as needed",
    ),
]
_Hardware = Annotated[
    str | None,
    typer.Option(
        metavar="SOURCE",
        help="Instead of --module: the chassis and modules of an export of NI MAX (.ini), or of a "
        "connection (local, grpc://HOST:PORT).",
        show_default=False,
    ),
]
_Sensors = Annotated[
    Path | None,
    typer.Option(
        "--sensors",
        metavar="FILE",
        help=f"List of sensors from a spreadsheet, .xlsx or CSV. Columns: {', '.join(COLUMNS)}.",
        show_default="as many of each as asked, spread over the wall",
    ),
]

_RESERVED_BY_OTHER = -201420


def register(app: typer.Typer) -> None:
    """Add the group ``rig``."""
    group = command_group("Write rig files for walls of one's own.")

    @group.callback()
    def _rig() -> None:
        """Write rig files for walls of one's own."""

    group.command(
        "new",
        epilog="Example: daq-app rig new w1.toml --height 2.4 --thickness 0.5 --length 1.6 "
        "--sensors sensors.csv --module 'NI 9205'",
    )(new)
    group.command("from-max", epilog="Example: daq-app rig from-max lab.ini > hardware.toml")(from_max)
    group.command("from-device", epilog="Example: daq-app rig from-device grpc://127.0.0.1:31763")(
        from_device
    )
    group.command("product", epilog="Example: daq-app rig product cDAQ1Mod3 local > our_cards.toml")(product)
    group.command("reserve", epilog="Example: daq-app rig reserve cDAQ9188-1A2B3C4 local")(reserve)
    app.add_typer(group, name="rig")


def new(
    file: Annotated[Path, typer.Argument(help="Rig file to write.", metavar="RIG.toml")],
    height: Annotated[float, typer.Option(prompt="Height of the wall, m", min=0.05, max=50.0, help="m.")],
    thickness: Annotated[
        float, typer.Option(prompt="Thickness of the wall, m", min=0.01, max=20.0, help="m.")
    ],
    length: Annotated[float, typer.Option(prompt="Length of the wall, m", min=0.01, max=100.0, help="m.")],
    name: Annotated[
        str | None, typer.Option(help="Name of the wall.", show_default="the file's name")
    ] = None,
    weight: Annotated[
        float | None, typer.Option(min=1.0, help="Weight, N.", show_default="2300 kg/m³")
    ] = None,
    sensors: _Sensors = None,
    lvdts: Annotated[int, typer.Option(min=0, max=500, help="Without a list: how many LVDTs.")] = 4,
    wires: Annotated[int, typer.Option(min=0, max=500, help="Without a list: wire potentiometers.")] = 1,
    accelerometers: Annotated[int, typer.Option(min=0, max=500, help="Without a list.")] = 2,
    tiltmeters: Annotated[int, typer.Option(min=0, max=500, help="Without a list: tilt axes.")] = 2,
    chassis: Annotated[str, typer.Option(help="NI's product name of the chassis.")] = CHASSIS,
    module: _Modules = None,
    hardware: _Hardware = None,
    rate: Annotated[float, typer.Option(min=1.0, help="Sample rate, Hz.")] = 4000.0,
) -> None:
    """Write a commented rig file for a wall of one's own, that `config check` calls good.

    Asks for what is not given. Each sensor gets a module that can read it. Overwrites nothing.
    """
    block = Block(name or file.stem, height, thickness, length, weight)
    with reported():
        if file.exists():
            print_paragraph("Error", f"{file} exists and may have been edited. Name another file")
            raise typer.Exit(EXIT_BAD_INPUT)
        counts = {"lvdt": lvdts, "wire": wires, "accelerometer": accelerometers, "tiltmeter": tiltmeters}
        listed = read_sensor_table(sensors) if sensors is not None else spread_sensors(block, counts)
        tables = _chassis_of(hardware, chassis, module) if hardware else []
        text = write_rig_text(
            block,
            listed,
            chassis=chassis,
            modules=module or (),
            hardware=tables,
            rate_hz=rate,
            file=str(file),
        )
        with file.open("x", encoding="utf-8") as out:
            out.write(text)
    typer.echo(f"{file}: good, {len(listed)} sensors. Replace what it calls `assumed`.")
    for line in wiring_lines(parse_rig(text, str(file))):
        typer.echo(line)
    typer.echo(f"See it: daq-app config show {file}")
    typer.echo(f"Try it on a simulated wall: daq-app run {file} --test {block.name}-L3-1 --headless")


def _chassis_of(source: str, chassis: str, modules: list[str] | None) -> list[dict[str, Any]]:
    """The chassis tables of a `source` of hardware. Raises `ConfigError` or `DriverError`."""
    if modules:
        wrong, right = "names modules, and so does --module", "Give one of the two"
        raise ConfigError([Problem("--hardware", source, wrong, right)])
    tables, remarks = chassis_tables(devices_of(source), source)
    for table in tables:
        if table["product"] == PXI_UNNAMED:
            if catalogue.chassis(chassis).bus != "pxie":
                right = "Name it with --chassis, for instance --chassis PXIe-1082"
                raise ConfigError(
                    [Problem(source, table["name"], "the product of the chassis is unknown", right)]
                )
            table["product"] = chassis
    for remark in remarks:
        if not remark.startswith(tuple(f"{table['name']}:" for table in tables)):
            print_paragraph("Left out", remark, style="bold yellow")
    return tables


def from_max(
    export: Annotated[Path, typer.Argument(help="Export of NI MAX.", metavar="EXPORT.ini")],
) -> None:
    """Print the hardware part of a rig file from what NI MAX has exported (File, Export, .ini)."""
    with reported():
        _print(hardware_text(listed_in_export(export), export.name))


def from_device(
    connection: Annotated[
        str, typer.Argument(help="local, grpc://HOST:PORT or grpcs://HOST:PORT.", metavar="CONNECTION")
    ] = "local",
) -> None:
    """Print the hardware part of a rig file from the devices that NI-DAQmx finds."""
    with reported():
        devices = devices_at(connection)
        _print(hardware_text(devices, f"NI-DAQmx at {connection}", connection))


def product(
    device: Annotated[str, typer.Argument(help="Name of a module or card in NI MAX.")],
    connection: Annotated[
        str, typer.Argument(help="local, grpc://HOST:PORT or grpcs://HOST:PORT.", metavar="CONNECTION")
    ] = "local",
) -> None:
    """Print the table of a product file for a module or card that is there, from what NI-DAQmx tells of it.

    For products that the catalogue lacks; a rig file names the file in hardware.products.
    """
    with reported():
        _print(tomli_w.dumps({"product": [product_at(connection, device)]}))


def reserve(
    chassis: Annotated[str, typer.Argument(help="Name of the network chassis in NI MAX.")],
    connection: Annotated[
        str, typer.Argument(help="local, grpc://HOST:PORT or grpcs://HOST:PORT.", metavar="CONNECTION")
    ] = "local",
    override: Annotated[
        bool, typer.Option("--override", help="Take it from another computer without asking.")
    ] = False,
) -> None:
    """Reserve a network chassis for the computer of NI-DAQmx; one of another computer only when told to.

    What that computer measures with the chassis ends.
    """
    with reported():
        if not _reserved(chassis, connection, override):
            typer.confirm(
                f"Another computer has reserved {chassis}; its measurement would end. Take it over?",
                abort=True,
            )
            _reserved(chassis, connection, override=True)
    echo(f"{chassis} is reserved")


def _reserved(chassis: str, connection: str, override: bool) -> bool:
    """Whether the reservation was given; False where another computer has the chassis."""
    from drivers import DriverError

    try:
        reserve_at(connection, chassis, override=override)
    except DriverError as error:
        if error.code != _RESERVED_BY_OTHER:
            raise
        return False
    return True


def _print(text: str) -> None:
    for line in text.splitlines():
        echo(line)
