"""The library of effects: small declarative pieces that name what a model may lack."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

from daq_app.gap.core.parameters import Parameter


@dataclass(frozen=True, slots=True)
class Confusion:
    """Another effect that looks similar, and the measurement that tells the two apart."""

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
    kind: Literal["effect", "probe", "departure"] = "effect"
    """A probe is a non-parametric form of its family: it can name the family, never the effect. A departure
    is the first step away from the forms of some effects, only ever tested on top of one of them."""
    of: tuple[str, ...] = ()
    """Effects whose forms a departure departs from."""
    typical: float = 0.0
    """Size of a departure's coefficient where the family has another form, per unit of the first
    parameter of the effect that it departs from. Without it the departure says nothing of that."""
    directed: bool = False
    """Whether the sign of that coefficient follows from the signs of `typical` and of the parameter."""
    part_of: str = ""
    """Effect of which this is one place: the same law on one channel of a family. They are no two causes."""
    place: str = ""
    """That channel, as the labels of its features have it."""

    @property
    def shared(self) -> tuple[Parameter, ...]:
        return tuple(p for p in self.parameters if not p.per_run)

    @property
    def per_run(self) -> tuple[Parameter, ...]:
        return tuple(p for p in self.parameters if p.per_run)

    def key(self, parameter: Parameter) -> str:
        """Name under which the model reads a parameter."""
        return f"{self.name}.{parameter.name}"


@dataclass(frozen=True, slots=True)
class Indistinguishable:
    """Effects that are the same equation in everything that the sensors measure.

    Not effects that these runs happen not to separate: those may differ in the next ones.
    """

    names: tuple[str, ...]
    reason: str
    measure: str
    """What would tell them apart, beyond the sensors that there are."""


class Library(Mapping[str, Effect]):
    """Effects by name; checks on construction that names are unique and confusions known."""

    def __init__(self, effects: Iterable[Effect], groups: Iterable[Indistinguishable] = ()) -> None:
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
            strangers = [name for name in effect.of if name not in self._effects]
            if strangers or bool(effect.of) != (effect.kind == "departure"):
                raise ValueError(f"effect {effect.name} ({effect.kind}) departs from {list(effect.of)}")
        self.groups = tuple(groups)
        self._group_of: dict[str, Indistinguishable] = {}
        for group in self.groups:
            for name in group.names:
                if name not in self._effects or name in self._group_of:
                    raise ValueError(
                        f"{name} is in a group of indistinguishable effects, but unknown or in two of them"
                    )
                self._group_of[name] = group

    def __getitem__(self, name: str) -> Effect:
        return self._effects[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._effects)

    def __len__(self) -> int:
        return len(self._effects)

    @property
    def named(self) -> tuple[Effect, ...]:
        """Effects proper, without probes and departures."""
        return tuple(e for e in self._effects.values() if e.kind == "effect")

    @property
    def probes(self) -> tuple[Effect, ...]:
        return tuple(e for e in self._effects.values() if e.kind == "probe")

    def departures(self, effects: Iterable[str]) -> tuple[Effect, ...]:
        """Those from the form of any of some effects."""
        named = set(effects)
        return tuple(e for e in self._effects.values() if named.intersection(e.of))

    @property
    def families(self) -> tuple[str, ...]:
        """Families in the order of their first effect."""
        return tuple(dict.fromkeys(e.family for e in self._effects.values()))

    def without(self, *names: str) -> Library:
        """The library less some effects (and less the confusions that point at them)."""
        kept = []
        for effect in self._effects.values():
            of = tuple(name for name in effect.of if name not in names)
            if effect.name in names or (effect.of and not of):
                continue
            confusions = tuple(c for c in effect.confusable_with if c.effect not in names)
            kept.append(replace(effect, confusable_with=confusions, of=of))
        groups = ((group, tuple(n for n in group.names if n not in names)) for group in self.groups)
        remaining = [
            Indistinguishable(left, group.reason, group.measure) for group, left in groups if len(left) > 1
        ]
        return Library(kept, remaining)

    def indistinguishable_from(self, name: str) -> Indistinguishable | None:
        """The effects that no sensor tells from this one, itself among them; None if there are none."""
        return self._group_of.get(name)

    def class_of(self, effects: Iterable[str]) -> tuple[str, ...]:
        """The effects, each by the first name of its group: equal for hypotheses that nothing tells apart."""
        return tuple(sorted(self._group_of[n].names[0] if n in self._group_of else n for n in effects))

    def separating_measurement(self, first: str, second: str) -> str | None:
        """What to measure to tell two effects apart, if the library knows."""
        for here, there in ((first, second), (second, first)):
            for confusion in self._effects[here].confusable_with:
                if confusion.effect == there:
                    return confusion.measure
        return None
