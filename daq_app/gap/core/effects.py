"""The library of effects: small declarative pieces that name what a model may lack."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal

from daq_app.gap.core.parameters import Parameter


@dataclass(frozen=True, slots=True)
class Confusion:
    """Another effect that looks alike, and the measurement that tells the two apart."""

    effect: str
    measure: str


@dataclass(frozen=True, slots=True)
class Effect:
    """One effect that can be added to a model.

    The model reads its parameters as ``name.parameter`` (e.g. ``viscous.zeta``); an effect that is
    not part of a hypothesis is absent from the values that the model gets.
    """

    name: str
    family: str
    parameters: tuple[Parameter, ...]
    equation: str
    """What it adds to the model, in plain text."""
    reference: str
    signature: str = ""
    """How it shows."""
    confusable_with: tuple[Confusion, ...] = ()
    kind: Literal["effect", "probe"] = "effect"
    """A probe is a non-parametric form of its family: it can name the family, never the effect."""
    null_value: Mapping[str, float] = field(default_factory=dict)
    """Parameter values at which the effect vanishes; 0 for each that is not listed."""

    @property
    def shared(self) -> tuple[Parameter, ...]:
        return tuple(p for p in self.parameters if not p.per_run)

    @property
    def per_run(self) -> tuple[Parameter, ...]:
        return tuple(p for p in self.parameters if p.per_run)

    def key(self, parameter: Parameter) -> str:
        """Name under which the model reads a parameter."""
        return f"{self.name}.{parameter.name}"


class Library(Mapping[str, Effect]):
    """Effects by name; checks on construction that names are unique and confusions known."""

    def __init__(self, effects: Iterable[Effect]) -> None:
        self._effects: dict[str, Effect] = {}
        for effect in effects:
            if effect.name in self._effects:
                raise ValueError(f"two effects are called {effect.name}")
            if not effect.parameters:
                raise ValueError(f"effect {effect.name} has no parameter")
            self._effects[effect.name] = effect
        for effect in self._effects.values():
            unknown = [c.effect for c in effect.confusable_with if c.effect not in self._effects]
            if unknown:
                raise ValueError(f"effect {effect.name} is said to be confusable with unknown {unknown}")

    def __getitem__(self, name: str) -> Effect:
        return self._effects[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._effects)

    def __len__(self) -> int:
        return len(self._effects)

    @property
    def named(self) -> tuple[Effect, ...]:
        """Effects proper, without probes."""
        return tuple(e for e in self._effects.values() if e.kind == "effect")

    @property
    def probes(self) -> tuple[Effect, ...]:
        return tuple(e for e in self._effects.values() if e.kind == "probe")

    @property
    def families(self) -> tuple[str, ...]:
        """Families in the order of their first effect."""
        return tuple(dict.fromkeys(e.family for e in self._effects.values()))

    def without(self, *names: str) -> Library:
        """The library less some effects (and less the confusions that point at them)."""
        kept = []
        for effect in self._effects.values():
            if effect.name in names:
                continue
            confusions = tuple(c for c in effect.confusable_with if c.effect not in names)
            kept.append(
                Effect(
                    effect.name,
                    effect.family,
                    effect.parameters,
                    effect.equation,
                    effect.reference,
                    effect.signature,
                    confusions,
                    effect.kind,
                    effect.null_value,
                )
            )
        return Library(kept)

    def separating_measurement(self, first: str, second: str) -> str | None:
        """What to measure to tell two effects apart, if the library knows."""
        for here, there in ((first, second), (second, first)):
            for confusion in self._effects[here].confusable_with:
                if confusion.effect == there:
                    return confusion.measure
        return None
