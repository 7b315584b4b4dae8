"""`daq-app keys seal`, `trust`, `distrust`, `trusted`: whose seals on run files are believed."""

from __future__ import annotations

from typing import Annotated

import typer

from daq_app.cli.errors import EXIT_FAILED, print_paragraph, reported
from daq_app.cli.terminal import echo, echo_json

_Name = Annotated[str, typer.Argument(help="What this lab calls the recorder.", metavar="NAME")]


def register_seal_keys(keys: typer.Typer) -> None:
    """Add the commands to the group ``keys``."""
    keys.command("seal", epilog="Example: daq-app keys seal > our-recorder.txt")(seal)
    keys.command("trust", epilog="Example: daq-app keys trust hall-2 3f…c9")(trust_key)
    keys.command("distrust", epilog="Example: daq-app keys distrust hall-2")(distrust_key)
    keys.command("trusted", epilog="Example: daq-app keys trusted --json")(trusted)


def seal() -> None:
    """Print the key that this machine seals its runs with: other labs trust it by this.

    Exit code 1 where this user has no key and none can be kept.
    """
    from daq_app.runfile.seal.signing import key_file, own_public_key

    key = own_public_key()
    if not key:
        print_paragraph("Error", f"this user has no key, and {key_file()} cannot be written")
        raise typer.Exit(EXIT_FAILED)
    echo(key.hex())


def trust_key(
    name: _Name,
    key: Annotated[str, typer.Argument(help="Its key, as `keys seal` prints it there.", metavar="KEY")],
    replace: Annotated[
        bool, typer.Option("--replace", help="That recorder has a new key; the old one is trusted no more.")
    ] = False,
) -> None:
    """Believe runs that another recorder sealed. Ask for the key by another way than the runs came by."""
    from daq_app.runfile.seal.trust import trust

    with reported():
        path = trust(name, key, replace=replace)
    echo(f"Runs sealed by {name} are believed from now on ({path})")


def distrust_key(name: _Name) -> None:
    """Believe that recorder no more, at once."""
    from daq_app.runfile.seal.trust import distrust

    with reported():
        distrust(name)
    echo(f"{name} is trusted no more")


def trusted(
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object, name to key.")] = False,
) -> None:
    """List the recorders that are trusted, with their keys."""
    from daq_app.runfile.seal.trust import trusted_keys

    keys = trusted_keys()
    if as_json:
        echo_json(keys)
        return
    for name, key in keys.items():
        echo(f"{name}  {key}")
    if not keys:
        echo("No other recorder is trusted.")
