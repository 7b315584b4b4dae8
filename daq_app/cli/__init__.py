"""The command line: thin. Each module registers one group of commands; it parses, calls, prints."""

from daq_app.cli.app import main

__all__ = ["main"]
