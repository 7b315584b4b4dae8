"""How an effect is described: a name, a family, parameters in SI with ranges, an equation, a source."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number of an effect; `low` … `high` is the range in which it is plausible for such walls."""

    name: str
    unit: str
    low: float
    high: float
    text: str
    default: float | None = None
    """Value when the effect is asked for without it; None where it must be given."""
    index: int = -1
    """Place in the flat parameter vector of the effect's kind."""
    minimum: float = -math.inf
    """Smallest value that has a meaning at all."""
    maximum: float = math.inf


@dataclass(frozen=True, slots=True)
class EffectSpec:
    """A term that can be added to the simulator.  With its `strength` at 0 the effect is off."""

    name: str
    family: str
    summary: str
    equation: str
    reference: str
    parameters: tuple[Parameter, ...]
    confusable: tuple[str, ...] = ()
    separated_by: str = ""
    """The measurement that tells it from those."""

    @property
    def strength(self) -> Parameter:
        """The parameter that scales the effect: the first."""
        return self.parameters[0]

    def parameter(self, name: str) -> Parameter:
        """The parameter of that name; `ValueError` in words if there is none."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        known = ", ".join(f"{p.name} ({p.unit})" if p.unit else p.name for p in self.parameters)
        raise ValueError(f"effect {self.name!r} has no parameter {name!r}; it has {known}")

    def complete(self, given: Mapping[str, float]) -> dict[str, float]:
        """All parameters, defaults filled in; `ValueError` for one unknown, missing or without meaning."""
        for name in given:
            self.parameter(name)
        values: dict[str, float] = {}
        for parameter in self.parameters:
            value = given.get(parameter.name, parameter.default)
            if value is None:
                raise ValueError(
                    f"effect {self.name!r} needs {parameter.name} ({parameter.unit or 'no unit'}: "
                    f"{parameter.text}), for instance {self.name}:{parameter.name}={parameter.high:g}"
                )
            if not parameter.minimum <= value <= parameter.maximum:
                raise ValueError(
                    f"effect {self.name!r}: {parameter.name} = {value:g} {parameter.unit} is outside "
                    f"{parameter.minimum:g} … {parameter.maximum:g}"
                )
            values[parameter.name] = float(value)
        return values


def split_target(key: str) -> tuple[str, str]:
    """``gain@wire`` → (``gain``, ``wire``): an effect and the sensors it acts on (empty: all)."""
    name, _, target = key.partition("@")
    return name.strip(), target.strip()


def find_effect(key: str, specs: Iterable[EffectSpec]) -> EffectSpec:
    """The effect named by `key` (a target after ``@`` is ignored); `ValueError` with near names if none."""
    by_name = {spec.name: spec for spec in specs}
    name, _ = split_target(key)
    if name in by_name:
        return by_name[name]
    near = difflib.get_close_matches(name, by_name, n=3)
    hint = f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(by_name)}"
    raise ValueError(f"no effect is called {name!r}; {hint}")


def parse_effect(text: str) -> tuple[str, dict[str, float]]:
    """``viscous:zeta=0.006`` or ``gain@wire:error=0.02,…`` → (key, parameters); `ValueError` in words."""
    key, _, rest = text.partition(":")
    values: dict[str, float] = {}
    for item in filter(None, (part.strip() for part in rest.split(","))):
        name, equals, number = item.partition("=")
        try:
            values[name.strip()] = float(number)
        except ValueError:
            equals = ""
        if not equals:
            raise ValueError(f"in effect {text!r}: {item!r} should read parameter=number")
    return key.strip(), values
