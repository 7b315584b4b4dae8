"""The way to the simulated world past NI's interface: pull the wall, release it, break things.

One call, ``/rocking.SimControl/Command``: JSON object {"name": …, "arguments": {…}} in, JSON object out.
"""

from __future__ import annotations

import json
from typing import Any, Final

import grpc

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.tasks.task import tasks_of
from sim_hardware.faults.model import fault_from

SERVICE: Final = "rocking.SimControl"
METHOD: Final = "Command"


def run_command(bench: Bench, name: str, arguments: dict[str, Any]) -> dict[str, object]:
    """Carry out one command. `ValueError` in words for one that is not known or not possible."""
    with bench.changed:
        if name == "bench":
            return {
                "time_s": bench.clock.now(),
                "tasks": {t.name: t.state.name for t in tasks_of(bench)},
            }
        if name == "digital_edge":
            bench.clock.power_on()
            edge = str(arguments.get("edge", "rising"))
            if edge not in ("rising", "falling"):
                raise ValueError(f"an edge is rising or falling, not {edge!r}")
            bench.digital_edge(str(arguments["terminal"]), bench.clock.now(), edge == "rising")
            return {"time_s": bench.clock.now()}
        if name == "fault":
            return {"number": bench.add_fault(fault_from(arguments)), "time_s": bench.clock.now()}
        if name == "clear_faults":
            bench.clear_faults(int(arguments["number"]) if "number" in arguments else None)
            return {"faults": bench.faults.listing()}
        if name == "faults":
            return {"faults": bench.faults.listing(), "time_s": bench.clock.now()}
        return bench.command(name, arguments)


def control_handler(bench: Bench) -> grpc.GenericRpcHandler:
    """The control service as a handler of the gRPC server."""

    def call(request: bytes, context: Any) -> bytes:
        try:
            message = json.loads(request)
            answer = run_command(bench, str(message["name"]), dict(message.get("arguments", {})))
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            context.abort(grpc.StatusCode.INVALID_ARGUMENT, f"{type(error).__name__}: {error}")
        return json.dumps(answer).encode()

    handler = grpc.unary_unary_rpc_method_handler(call, request_deserializer=None, response_serializer=None)
    return grpc.method_handlers_generic_handler(SERVICE, {METHOD: handler})
