"""``python -m sim_hardware.daqmx_server``: the simulated NI device server as a program."""

from sim_hardware.daqmx_server.program import main

if __name__ == "__main__":
    raise SystemExit(main())
