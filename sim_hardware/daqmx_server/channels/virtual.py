"""Virtual channels: what every channel of a task has, whatever it measures or puts out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final

from nidaqmx.constants import ChannelType, UsageTypeAI, UsageTypeAO, UsageTypeCI, UsageTypeCO

from daq_app.config.hardware.products import Product
from sim_hardware.daqmx_server.channels.kinds import KINDS, ChannelKind
from sim_hardware.daqmx_server.channels.scale import CustomScale
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.inventory.devices import Device

CHANNEL_TYPES: Final[dict[str, int]] = {
    "AI": ChannelType.ANALOG_INPUT.value,
    "AO": ChannelType.ANALOG_OUTPUT.value,
    "DI": ChannelType.DIGITAL_INPUT.value,
    "DO": ChannelType.DIGITAL_OUTPUT.value,
    "CI": ChannelType.COUNTER_INPUT.value,
    "CO": ChannelType.COUNTER_OUTPUT.value,
}
USAGES: Final[dict[str, dict[str, int]]] = {
    "AI": {usage.name: usage.value for usage in UsageTypeAI},
    "AO": {usage.name: usage.value for usage in UsageTypeAO},
    "CI": {usage.name: usage.value for usage in UsageTypeCI},
    "CO": {usage.name: usage.value for usage in UsageTypeCO},
}
_GROUPS: Final = {
    io: frozenset(kind.group for kind in KINDS.values() if kind.io == io and kind.group)
    for io in CHANNEL_TYPES
}
_SHARED: Final = frozenset({"AI_RESISTANCE", "AI_CURRENT", "AI_FREQ", "AI_CHARGE"})
"""Groups whose attributes other measurements use as well: wiring of RTDs, shunts of current inputs."""
_OF_ANY: Final = ("CHAN_", "PHYSICAL_CHAN_")


@dataclass(slots=True)
class VirtualChannel:
    """One channel of a task. `attributes` holds what was asked for; coerced values are derived."""

    name: str
    physical: str
    device: Device
    number: int
    kind: ChannelKind
    attributes: dict[str, Any] = field(default_factory=dict)
    scale: CustomScale | None = None
    """Custom scale of the readings."""
    is_global: bool = False
    lines: tuple[str, ...] = ()
    """Lines of a digital channel, least significant first."""
    columns: tuple[str, ...] = ()
    """The same lines as NI's waveforms order them: single lines as given, a whole port from its highest."""

    @property
    def product(self) -> Product:
        assert self.device.product is not None
        return self.device.product

    @property
    def io(self) -> str:
        return self.kind.io

    @property
    def measurement(self) -> str:
        return self.kind.measurement

    @property
    def raw_bytes(self) -> int:
        """Width of one raw sample, bytes."""
        return 4

    @property
    def unit_name(self) -> str:
        """Unit of the readings, as NI's waveforms name it."""
        return ""

    @property
    def overload_detection(self) -> bool:
        return False

    def applies(self, attribute: str) -> bool:
        """Whether NI's attribute belongs to this kind of channel and measurement."""
        if attribute.startswith(_OF_ANY):
            return True
        prefix = "PWR" if self.kind.group == "PWR" else self.io
        if not attribute.startswith((f"{prefix}_", f"{self.io}_")):
            return False
        own = self.kind.group
        foreign = [g for g in _GROUPS[self.io] - _SHARED if g != own and attribute.startswith(f"{g}_")]
        return not foreign or (bool(own) and attribute.startswith(own))

    def verify(self) -> None:
        """Raise what NI-DAQmx raises for values that the device cannot do."""
        if self.io == "AO" and self.measurement == "VOLTAGE" and self.scale is None:
            self._verify_output_range()

    def _verify_output_range(self) -> None:
        low, high = float(self.attributes["AO_MIN"]), float(self.attributes["AO_MAX"])
        if low >= high:
            raise DaqmxError(Code.MIN_NOT_BELOW_MAX, f"Channel Name: {self.name}")
        ranges = self.product.outputs.ranges_v
        if ranges and not any(bottom <= low and high <= top for bottom, top in ranges):
            raise self.refuse("DAQmx_AO_Max", high, [top for _, top in ranges])

    def refuse(self, attribute: str, asked: object, possible: list[Any]) -> DaqmxError:
        """−200077 with the values that are possible."""
        values = ", ".join(map(str, possible))
        return DaqmxError(
            Code.INVALID_VALUE,
            f"Property: {attribute}\nRequested Value: {asked}\nPossible Values: {values}",
            f"Channel Name: {self.name}",
        )
