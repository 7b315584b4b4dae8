"""Units in which quantities are shown."""

from __future__ import annotations

_SI_SHOWN = {
    "m": ("mm", 1e3),
    "rad": ("mrad", 1e3),
    "m/s2": ("m/s²", 1.0),
    "N": ("kN", 1e-3),
    "m/m": ("µm/m", 1e6),
    "degC": ("°C", 1.0),
}


def shown_unit(si_unit: str) -> tuple[str, float]:
    """Unit and factor in which a quantity of that SI unit is shown."""
    return _SI_SHOWN.get(si_unit, (si_unit, 1.0))
