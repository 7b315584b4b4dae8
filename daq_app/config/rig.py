"""The rig model: what a rig file says, as validated, immutable objects.

Frame of every position: origin at the centre of the wall's base, x through the thickness,
y along the length, z up, in metres.  A positive rotation tilts the top towards +x; the wall then
turns about the edge at x = +b/2.

`assumed` in any table lists the keys of that table whose values come from no source and were
chosen as plausible.
"""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Sequence
from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, model_validator

from daq_app.config.families import AUXILIARY, Family, is_auxiliary
from daq_app.config.units import (
    FAMILY_SI_UNIT,
    G_M_S2,
    READING_UNIT,
    SENSITIVITY_TO_SI,
    sensitivity_units,
)

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False, strict=True)]
Finite = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Vector3 = tuple[Finite, Finite, Finite]


class Table(BaseModel):
    """A table of a rig file: immutable, unknown keys refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    assumed: tuple[str, ...] = ()

    @model_validator(mode="after")
    def _assumed_keys_exist(self) -> Table:
        unknown = [key for key in self.assumed if key not in type(self).model_fields]
        if unknown:
            raise ValueError(f"assumed names keys that this table does not have: {unknown}")
        return self


class Specimen(Table):
    """The wall as a rigid block (Table 3.1 of the paper); the derived values are properties."""

    name: str
    weight_n: Positive
    height_m: Positive
    rotational_inertia_kg_m2: Positive
    """About the base corner."""
    r0_m: Positive
    """Distance from the base corner to the centre of mass."""
    alpha0_rad: Annotated[float, Field(gt=0, lt=math.pi / 2, allow_inf_nan=False, strict=True)]
    p_rad_s: Positive
    """As printed in the source; checked against sqrt(W R0 / I_O)."""
    length_m: Positive
    mortar_compressive_strength_pa: Positive
    mortar_flexural_strength_pa: Positive
    source: str = ""

    @property
    def mass_kg(self) -> float:
        return self.weight_n / 9.81

    @property
    def base_width_m(self) -> float:
        """b = 2 R sin α."""
        return 2.0 * self.r0_m * math.sin(self.alpha0_rad)

    @property
    def centroid_height_m(self) -> float:
        """h_G = R cos α."""
        return self.r0_m * math.cos(self.alpha0_rad)


class Module(Table):
    """One I/O module in a slot of a chassis."""

    slot: Annotated[int, Field(ge=1, le=18, strict=True)]
    product: str
    """NI's product name as in the catalogue, for instance ``NI 9205`` or ``PXIe-4340``."""
    name: str = ""
    """Device name; empty means the name NI-DAQmx gives, for instance ``cDAQ1Mod3``."""
    serial: str = ""


class Chassis(Table):
    """One chassis with its modules."""

    name: str
    product: str
    modules: tuple[Module, ...] = Field(min_length=1)


class ClockCable(Table):
    """Cables between equal PFI terminals of cDAQ chassis that have no clock in common."""

    clock: str = "PFI0"
    """Terminal that carries the sample clock, of every chassis."""
    trigger: str = "PFI1"
    """Terminal that carries the start trigger."""


class Hardware(Table):
    """The acquisition hardware and how it is reached."""

    connection: str = "simulated"
    """``local``, ``grpc://HOST:PORT`` or ``simulated``."""
    chassis: tuple[Chassis, ...] = Field(min_length=1)
    clock_cable: ClockCable | None = None
    products: tuple[str, ...] = ()
    """Product files in the folder of the rig file, for products that the catalogue lacks."""
    _product_texts: tuple[str, ...] = PrivateAttr(())

    @property
    def product_texts(self) -> tuple[str, ...]:
        """Contents of `products`, where the rig was read from its file."""
        return self._product_texts

    def with_product_texts(self, texts: tuple[str, ...]) -> Hardware:
        """The same hardware with what its product files say."""
        copy = self.model_copy()
        copy._product_texts = texts
        return copy


class Acquisition(Table):
    """How a test is recorded and when it starts and ends."""

    rate_hz: Positive = 4000.0
    read_period_s: Annotated[float, Field(ge=0.01, le=1.0, allow_inf_nan=False, strict=True)] = 0.1
    buffer_s: Annotated[float, Field(ge=2.0, le=120.0, allow_inf_nan=False, strict=True)] = 20.0
    """Length of the driver's circular buffer: how long the computer may be deaf."""
    pre_trigger_s: Annotated[float, Field(ge=0.5, le=120.0, allow_inf_nan=False, strict=True)] = 5.0
    post_rest_s: Annotated[float, Field(ge=0.2, le=60.0, allow_inf_nan=False, strict=True)] = 2.0
    max_duration_s: Annotated[float, Field(ge=5.0, le=7200.0, allow_inf_nan=False, strict=True)] = 120.0
    """Longest time from release to the automatic stop."""
    velocity_cutoff_hz: Positive = 25.0
    """Cut-off of the stated low-pass differentiator (daq_app.rocking)."""
    ring_s: Annotated[float, Field(ge=20.0, le=3600.0, allow_inf_nan=False, strict=True)] = 180.0
    """How much of the past lies on disk while nothing is recorded (1.3 MB a second for 41 channels)."""
    hold_s: Annotated[float, Field(ge=0.0, le=60.0, allow_inf_nan=False, strict=True)] = 3.0
    """How long the wall is held still at its target before the operator is told to release. Assumed."""
    warning_ratio: Annotated[float, Field(gt=0, lt=1, allow_inf_nan=False, strict=True)] = 0.5
    """|θ|/α from which the nearness to overturning is a warning. Assumed: above every level of Table 3.2."""
    alarm_ratio: Annotated[float, Field(gt=0, lt=1, allow_inf_nan=False, strict=True)] = 0.65
    """|θ|/α from which the pull must stop and be eased back. Assumed."""


Count = Annotated[int, Field(ge=0, le=1000, strict=True)]


class ExpectedChannels(Table):
    """How many channels of each family the rig must have: a missing sensor is an error."""

    lvdt: Count = 24
    wire: Count = 5
    accelerometer: Count = 8
    tiltmeter: Count = 4
    load_cell: Count = 0
    strain_gauge: Count = 0
    laser: Count = 0
    displacement: Count = 0
    temperature: Count = 0
    voltage: Count = 0
    other: Count = 0

    @property
    def total(self) -> int:
        return sum(getattr(self, family) for family in get_args(Family))


class Excitation(Table):
    """Supply of a sensor."""

    kind: Literal["none", "external_voltage", "internal_voltage", "internal_current"] = "none"
    value: Annotated[float, Field(ge=0, allow_inf_nan=False, strict=True)] = 0.0
    """Volts, or amperes for ``internal_current``."""
    frequency_hz: Annotated[float, Field(ge=0, allow_inf_nan=False, strict=True)] = 0.0
    """AC excitation of native LVDT channels; 0 is DC."""


class Certificate(Table):
    """Calibration certificate of one sensor."""

    number: str
    calibrated: dt.date
    due: dt.date


class Channel(Table):
    """One analogue channel: where the sensor is, how it is wired, how its reading becomes SI.

    ``quantity_si = polarity · (reading − offset) / sensitivity_si`` where *reading* is what the NI
    channel returns: volts, amperes or volts per volt of excitation (bridges), except for native LVDT
    channels (metres), IEPE accelerometer channels (m/s²) and thermocouples (°C), which the NI driver
    scales itself.
    """

    id: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_.-]{0,31}$")]
    family: Family
    physical_channel: Annotated[str, Field(pattern=r"^[A-Za-z][\w-]*/ai\d+$")]
    position_m: Vector3
    anchor_m: Vector3 | None = None
    """Fixed end of a wire potentiometer."""
    axis: Literal["x", "y", "z"] = "x"
    """Sensitive axis: z for LVDTs (opening); direction of tilt for tiltmeters; wall-fixed otherwise."""
    unit: Annotated[str, Field(pattern=r"^[ -~°µ²]{0,16}$")] = ""
    """Unit of the quantity, for family ``other`` only."""
    measurement: Literal["voltage", "iepe", "lvdt_native", "current", "bridge", "thermocouple"] = "voltage"
    bridge: Literal["full", "half", "quarter"] = "full"
    """Bridge circuit of the sensor, for measurement ``bridge``."""
    bridge_ohm: Positive = 350.0
    """Resistance of the bridge, Ω."""
    thermocouple: Literal["B", "E", "J", "K", "N", "R", "S", "T"] = "K"
    """Type of the thermocouple, for measurement ``thermocouple``."""
    sensitivity: Positive
    sensitivity_unit: str
    offset: Finite = 0.0
    """Reading at zero of the quantity, in the unit of the reading (certificate's value)."""
    polarity: Literal[1, -1] = 1
    range_si: tuple[Finite, Finite]
    """Smallest and largest quantity the sensor can measure, SI."""
    warning_si: Positive | None = None
    """|quantity| from which the channel's view warns, SI; none where it is not given."""
    critical_si: Positive | None = None
    """The same, for what must not be reached."""
    input_range_v: tuple[Finite, Finite] = (-10.0, 10.0)
    """Range asked of the module: volts, amperes for ``current``, V/V for ``bridge``."""
    noise_si: Positive
    """Expected rms noise at rest, SI: the sensor check and the simulation use it."""
    time_constant_s: Annotated[float, Field(ge=0, allow_inf_nan=False, strict=True)] = 0.0
    """First-order response of a slow sensor (tiltmeters)."""
    source_impedance_ohm: Annotated[float, Field(ge=0, allow_inf_nan=False, strict=True)] = 100.0
    terminal_config: Literal["DIFF", "RSE", "NRSE", "PSEUDO_DIFF"] = "DIFF"
    excitation: Excitation = Excitation()
    certificate: Certificate

    @model_validator(mode="before")
    @classmethod
    def _joint_lvdts_are_displacements(cls, data: Any) -> Any:
        """An LVDT along x or y, written so, measures no opening of the base joint: it is auxiliary."""
        if isinstance(data, dict) and data.get("family") == "lvdt" and data.get("axis") in ("x", "y"):
            return {**data, "family": "displacement"}
        return data

    @property
    def auxiliary(self) -> bool:
        """Whether rocking analysis and diagnosis leave the channel out."""
        return is_auxiliary(self.family)

    @property
    def zeroed(self) -> bool:
        """Whether a zero is taken with the wall upright."""
        return not self.auxiliary or AUXILIARY[self.family].zeroed

    @property
    def si_unit(self) -> str:
        return FAMILY_SI_UNIT[self.family] or self.unit

    @property
    def reading_unit(self) -> str:
        """Unit of what the NI channel returns."""
        return READING_UNIT[self.measurement]

    @property
    def scaled_by_driver(self) -> bool:
        """Whether the NI channel returns the quantity itself."""
        return self.measurement in ("iepe", "lvdt_native", "thermocouple")

    @property
    def sensitivity_reading_per_si(self) -> float:
        """Reading per SI unit of the quantity; 1 where the NI driver scales."""
        return 1.0 if self.scaled_by_driver else self.sensitivity_v_per_si

    @property
    def sensitivity_v_per_si(self) -> float:
        """The sensor's own sensitivity in volts (amperes, V/V) per SI unit; for ``mV/V/mm`` of a native
        LVDT per volt of excitation. `KeyError` for a unit that the sensor cannot have."""
        known, factor = SENSITIVITY_TO_SI.get(self.sensitivity_unit, ("", 1.0))
        if known != self.si_unit:
            factor = sensitivity_units(self.measurement, self.si_unit)[self.sensitivity_unit]
        return self.sensitivity * factor


class Simulation(Table):
    """The simulated wall behind ``connection = "simulated"``: truth that no real rig file needs."""

    restitution: Annotated[float, Field(gt=0, le=1, allow_inf_nan=False, strict=True)] = 0.9
    """True r of the simulated wall."""
    restitution_scatter: Annotated[float, Field(ge=0, le=0.05, allow_inf_nan=False, strict=True)] = 0.0
    """Relative standard deviation of r from impact to impact."""
    theta0_scatter: Annotated[float, Field(ge=0, le=0.1, allow_inf_nan=False, strict=True)] = 0.01
    """Relative standard deviation of the release rotation about the planned level."""
    semi_rigid: bool = False
    """Move the pivot inwards by a = 2 W / (2 f_m l) (Eqns 2.1 to 2.3)."""
    offset_scatter: Annotated[float, Field(ge=0, le=0.2, allow_inf_nan=False, strict=True)] = 0.01
    """Standard deviation of sensor zero offsets, as a fraction of the range."""
    seed: Annotated[int, Field(ge=0, lt=2**63, strict=True)] = 1
    upright_s: Annotated[float, Field(ge=0.5, le=600, allow_inf_nan=False, strict=True)] = 3.0
    pull_s: Annotated[float, Field(ge=0.5, le=600, allow_inf_nan=False, strict=True)] = 3.0
    hold_s: Annotated[float, Field(ge=0.5, le=600, allow_inf_nan=False, strict=True)] = 8.0
    """Timeline of an unattended test: upright, pulled, held, then released."""
    effects: dict[str, dict[str, Finite]] = Field(default_factory=dict)
    """Further effects by name with their parameters (sim_hardware.dynamics)."""


class Rig(Table):
    """A whole rig file."""

    schema_version: Literal[1] = 1
    name: str
    description: str = ""
    specimen: Specimen
    hardware: Hardware
    acquisition: Acquisition = Acquisition()
    expected_channels: ExpectedChannels = ExpectedChannels()
    simulation: Simulation = Simulation()
    channels: tuple[Channel, ...]

    @property
    def channel_ids(self) -> tuple[str, ...]:
        return tuple(channel.id for channel in self.channels)

    def channel(self, channel_id: str) -> Channel:
        """The channel of that id; `KeyError` if there is none."""
        for channel in self.channels:
            if channel.id == channel_id:
                return channel
        raise KeyError(channel_id)

    def of_family(self, family: Family) -> tuple[Channel, ...]:
        return tuple(channel for channel in self.channels if channel.family == family)


def names(channels: Sequence[Channel]) -> str:
    """Ids of channels in a sentence: all of four, else the ends of the list and how many there are."""
    ids = [channel.id for channel in channels]
    return ", ".join(ids) if len(ids) <= 4 else f"{', '.join(ids[:2])} … {ids[-1]} ({len(ids)} channels)"


__all__ = [
    "G_M_S2",
    "Acquisition",
    "Certificate",
    "Channel",
    "Chassis",
    "Excitation",
    "ExpectedChannels",
    "Family",
    "Hardware",
    "Module",
    "Rig",
    "Simulation",
    "Specimen",
    "Table",
    "Vector3",
    "names",
]
