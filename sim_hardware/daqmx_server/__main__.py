"""``python -m sim_hardware.daqmx_server``: the simulated NI device server as a program."""

from sim_hardware.daqmx_server.options import parser
from sim_hardware.first_start import never_compiled, start_compiling_motion


def main() -> int:
    """On a new machine the wall's motion is compiled from the first moment, while the server loads."""
    arguments = parser().parse_args()
    wanted = arguments.config is not None and arguments.wall == "commanded"
    motion = start_compiling_motion() if wanted and never_compiled() else None
    from sim_hardware.daqmx_server import program  # takes a second to load

    return program.main(motion=motion)


if __name__ == "__main__":
    raise SystemExit(main())
