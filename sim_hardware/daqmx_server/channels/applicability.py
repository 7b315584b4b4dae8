"""Analogue-input attributes that need something of the measurement or of the product.

NI's metadata names no devices. The rules here follow from what a product measures and how it converts; where
they say nothing, every analogue input keeps the attribute.
"""

from __future__ import annotations

from typing import Final

from daq_app.config.hardware.products import Product
from sim_hardware.daqmx_server.channels.kinds import KINDS

_UNITS: Final = frozenset(
    kind.attributes["units"] for kind in KINDS.values() if kind.io == "AI" and "units" in kind.attributes
)
"""The unit of the reading, an attribute for each measurement."""
_BRIDGES: Final = frozenset({"bridge", "strain", "rosette", "voltage_excitation"})
_RESISTORS: Final = frozenset({"resistance", "rtd", "rtd_cjc"})
_EXCITES: Final = _BRIDGES | _RESISTORS | {"iepe", "force_iepe", "microphone", "lvdt_native", "accel_4wire"}
_BRIDGE_WORDS: Final = ("BRIDGE", "STRAIN", "EXCITATION")
_RESISTOR_WORDS: Final = ("RESISTANCE", "RTD", "THERMISTOR")
_EXCITED_WORDS: Final = (
    *_BRIDGE_WORDS,
    *_RESISTOR_WORDS,
    "ACCELERATION",
    "MICROPHONE",
    "IEPE",
    "LVDT",
    "RVDT",
    "PROX_PROBE",
)
_FILTERS: Final = (
    "AI_LOWPASS_",
    "AI_DIG_FLTR_",
    "AI_FILTER_",
    "AI_REMOVE_FILTER_",
    "AI_ENHANCED_ALIAS_",
    "AI_CHOP_",
)
_FILTERED_CATEGORIES: Final = ("SC_EXPRESS", "DSA")
_FILTERED_CARDS: Final = ("-628",)
"""M Series cards with a lowpass filter on their inputs (NI, M Series user manual)."""


def has_attribute(attribute: str, measurement: str, units: str, product: Product) -> bool:
    """Whether a channel has an attribute; `units` names the attribute that holds the unit of its reading."""
    if attribute in _UNITS:
        return attribute == units
    if attribute.startswith("AI_ADC_"):
        return product.converter == "slow"
    if attribute.startswith("AI_BRIDGE_"):
        return _one_of(measurement, product, _BRIDGE_WORDS, _BRIDGES)
    if attribute.startswith(("AI_EXCIT_", "AI_AC_EXCIT_")):
        return _one_of(measurement, product, _EXCITED_WORDS, _EXCITES)
    if attribute.startswith(("AI_RESISTANCE_", "AI_LEAD_WIRE_")):
        return _one_of(measurement, product, (*_RESISTOR_WORDS, *_BRIDGE_WORDS), _RESISTORS | _BRIDGES)
    if attribute.startswith("AI_OPEN_THRMCPL_"):
        return "thermocouple" in product.measurements
    if attribute.startswith(_FILTERS):
        return _has_filter(product)
    return True


def _one_of(measurement: str, product: Product, words: tuple[str, ...], measures: frozenset[str]) -> bool:
    return any(word in measurement for word in words) or bool(measures & product.measurements)


def _has_filter(product: Product) -> bool:
    return (
        product.converter == "delta_sigma"
        or product.category in _FILTERED_CATEGORIES
        or any(series in product.name for series in _FILTERED_CARDS)
    )
