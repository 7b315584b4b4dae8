"""``python -m daq_app.cli``: the same as the console script `daq-app`."""

from daq_app.cli import main

main()
