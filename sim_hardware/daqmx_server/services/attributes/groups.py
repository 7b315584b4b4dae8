"""One dispatch for all of NI's typed attribute calls.

`GetChanAttributeDouble`, `SetTimingAttributeExString`, `ResetReadAttribute` … differ in the message
types only; the names and numbers of the attributes are in the enums of the same protobuf file. So the
calls are taken apart by name, and each group of attributes is one small object with get, set, reset.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, Protocol

from nidaqmx._stubs import nidaqmx_pb2

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.channels.metadata import CALL, plain_name
from sim_hardware.daqmx_server.errors import Code, DaqmxError

Handler = Callable[[Bench, Any], Any]


class AttributeGroup(Protocol):
    """Attributes of one kind of object; `name` as in NI's C header without the prefix (``AI_MAX``)."""

    def get(self, bench: Bench, request: Any, name: str) -> Any: ...

    def set(self, bench: Bench, request: Any, name: str, value: Any) -> None: ...

    def reset(self, bench: Bench, request: Any, name: str) -> None: ...


def unsupported(name: str, *where: str) -> DaqmxError:
    """−200452 for an attribute that the device or task does not have."""
    return DaqmxError(Code.ATTRIBUTE_UNSUPPORTED, f"Property: DAQmx_{name}", *where)


def attribute_handlers(groups: dict[str, AttributeGroup]) -> dict[str, Handler]:
    """RPC name → handler, for every attribute call whose group is given."""
    service = nidaqmx_pb2.DESCRIPTOR.services_by_name["NiDAQmx"]
    out: dict[str, Handler] = {}
    for method in service.methods:
        match = CALL.match(method.name)
        if match and match["group"] in groups:
            out[method.name] = _handler(method, match["verb"], groups[match["group"]])
    return out


def _handler(method: Any, verb: str, group: AttributeGroup) -> Handler:
    enum = method.input_type.fields_by_name["attribute"].enum_type
    names = {value.number: plain_name(value.name) for value in enum.values}
    reply = getattr(nidaqmx_pb2, method.output_type.name)
    is_enum = "value_raw" in method.output_type.fields_by_name

    def name_of(request: Any) -> str:
        number = request.attribute_raw or request.attribute
        name = names[number] if number and number in names else EXTRA_NAMES.get(number)
        name = name or f"Attribute_0x{number:04X}"
        if getattr(request, "device_names", "") and not name.startswith(_BY_DEVICE):
            raise DaqmxError(Code.NO_DEVICE_CONTEXT, f"Property: DAQmx_{name}")
        return name

    def get(bench: Bench, request: Any) -> Any:
        value = group.get(bench, request, name_of(request))
        return reply(value=value, value_raw=value) if is_enum else reply(value=value)

    def set_(bench: Bench, request: Any) -> Any:
        group.set(bench, request, name_of(request), _value(request))
        return reply()

    def reset(bench: Bench, request: Any) -> Any:
        group.reset(bench, request, name_of(request))
        return reply()

    return {"Get": get, "Set": set_, "Reset": reset}[verb]


_BY_DEVICE: Final = "AI_CONV"
"""Timing attributes that each device of a task has for itself."""
EXTRA_NAMES: Final = {0x31E8: "DEFAULT_NUMBER_OF_SAMPLES_TO_READ"}
"""Attributes that the client asks for by number though the enums do not list them."""


def _value(request: Any) -> Any:
    """The value of a Set request, whichever way it was sent."""
    fields = request.DESCRIPTOR.fields_by_name
    if "value_raw" in fields and request.WhichOneof("value_enum") == "value_raw":
        return request.value_raw
    value = request.value
    return list(value) if fields["value"].is_repeated else value
