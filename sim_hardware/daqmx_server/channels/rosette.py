"""Rosettes of strain gauges: one channel for each quantity that is worked out of two or three gauges."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

from nidaqmx.constants import StrainGageRosetteMeasurementType as Quantity
from nidaqmx.constants import StrainGageRosetteType as Rosette

from sim_hardware.daqmx_server.channels.analog_input import AnalogInput
from sim_hardware.daqmx_server.errors import Code, DaqmxError

_NAMES: Final = {
    Quantity.PRINCIPAL_STRAIN_1.value: "principalStrain1",
    Quantity.PRINCIPAL_STRAIN_2.value: "principalStrain2",
    Quantity.PRINCIPAL_STRAIN_ANGLE.value: "principalStrainAngle",
    Quantity.CARTESIAN_STRAIN_X.value: "cartesianStrainX",
    Quantity.CARTESIAN_STRAIN_Y.value: "cartesianStrainY",
    Quantity.CARTESIAN_SHEAR_STRAIN_XY.value: "cartesianShearStrainXY",
    Quantity.MAX_SHEAR_STRAIN.value: "maxShearStrain",
    Quantity.MAX_SHEAR_STRAIN_ANGLE.value: "maxShearStrainAngle",
}
"""NI's number of a quantity → how its channel's name ends."""


def rosette_channels(
    gauges: Sequence[AnalogInput], fields: Mapping[str, Any], taken: Collection[str]
) -> list[AnalogInput]:
    """The channels of a rosette whose gauges these are; each is simulated in its own unit.

    Names are ``rosette0_principalStrain1``, with the next number that is free, or begin as the call says.
    Raises −201446, −201447 for a wrong number of gauges and −201448 where no quantity is asked for.
    """
    quantities = list(fields["rosette_meas_types"])
    if not quantities:
        raise DaqmxError(Code.ROSETTE_WITHOUT_QUANTITY)
    is_tee = fields["rosette_type"] == Rosette.TEE.value
    if len(gauges) != (2 if is_tee else 3):
        raise DaqmxError(Code.TEE_ROSETTE_GAUGES if is_tee else Code.DELTA_ROSETTE_GAUGES)
    first = gauges[0]
    strain_channels = ", ".join(gauge.physical for gauge in gauges)
    stem = str(fields["name_to_assign_to_channel"]) or _free_stem(taken)
    return [
        replace(
            first,
            name=f"{stem}_{_NAMES[quantity]}",
            attributes=first.attributes
            | {
                "AI_ROSETTE_STRAIN_GAGE_ROSETTE_MEAS_TYPE": quantity,
                "AI_ROSETTE_STRAIN_GAGE_STRAIN_CHANS": strain_channels,
            },
        )
        for quantity in quantities
    ]


def _free_stem(taken: Collection[str]) -> str:
    number = 0
    while any(name.startswith(f"rosette{number}_") for name in taken):
        number += 1
    return f"rosette{number}"
