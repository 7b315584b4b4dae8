"""The virtual rig: a wall, people who pull it, and sensors, as a `SignalSource`.

Two ways to run it.  *Scripted*: upright, pulled, held, released, at rest, by the times in the rig
file; all of it is decided by the seed before the first sample.  *Commanded*: upright until told to
pull, release, and so on.  Commands work in both; what has been sampled never changes.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import Rig
from sim_hardware.dynamics.motion import simulate_vector
from sim_hardware.handling import footsteps, lower_path, pull_path
from sim_hardware.sensors import Knock, Scene, SensorChain
from sim_hardware.sensors.noise import generator
from sim_hardware.simulated_test import Engine, SimulatedTest, Wall

COMMAND_GRID_S: Final = 0.01
"""Commands take effect on a grid of 10 ms, which all other grids of the simulation divide."""
DEFAULT_LEVEL: Final = 0.35
_NO_EFFECTS: Final[Mapping[str, Mapping[str, float]]] = {}
_HELD_RAD: Final = 5e-4
_LOWER_S: Final = 2.0
_RESET_S: Final = 0.3
_SNAP_RAD_S: Final = 0.01
"""Loudness of the release hook, in rad/s of an impact's approach."""

Arguments = Mapping[str, float | str]


class VirtualRig:
    """`SignalSource` of a simulated rig.  Thread-safe: the server samples while commands arrive."""

    def __init__(
        self,
        rig: Rig,
        *,
        seed: int,
        theta0_over_alpha: float = DEFAULT_LEVEL,
        restitution: float | None = None,
        scripted: bool = True,
        effects: Mapping[str, Mapping[str, float]] = _NO_EFFECTS,
        impacts_before: int = 0,
        engine: Engine = simulate_vector,
    ) -> None:
        """`theta0_over_alpha` is the planned level, negative to release from the other side.

        `restitution` and `effects` (``name`` or ``name@sensors`` → parameters) go over the rig
        file's.  `impacts_before` counts the impacts of earlier tests, for effects that wear.
        `engine` moves the wall once it is let go.
        `ValueError` in words for an effect, a level or a restitution that makes no sense.
        """
        self.rig = rig
        self.seed = seed
        self.theta0_over_alpha = theta0_over_alpha
        self._wall = Wall.of(rig, seed, restitution, effects, impacts_before, engine)
        self._wall.check_level(theta0_over_alpha)
        self._chain = SensorChain(rig, seed, self._wall.sensor_effects)
        self._scene = Scene.upright(self._wall.vector(), rig.specimen.height_m)
        self._tests: list[SimulatedTest] = []
        self._phases: list[tuple[float, str]] = [(-math.inf, "upright")]
        self._now_s = 0.0
        self._pulls = 0
        self._planned_rad = 0.0
        self._lock = threading.RLock()
        if scripted:
            self._script()

    @classmethod
    def from_rig(
        cls,
        rig: Rig,
        seed: int | None = None,
        theta0_over_alpha: float | None = None,
        restitution: float | None = None,
        scripted: bool = True,
        effects: Mapping[str, Mapping[str, float]] = _NO_EFFECTS,
    ) -> VirtualRig:
        """The virtual rig that a rig file describes; None means what its `simulation` table says."""
        return cls(
            rig,
            seed=rig.simulation.seed if seed is None else seed,
            theta0_over_alpha=DEFAULT_LEVEL if theta0_over_alpha is None else theta0_over_alpha,
            restitution=restitution,
            scripted=scripted,
            effects=effects,
        )

    # SignalSource

    def volts(self, terminals: tuple[str, ...], times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """(len(terminals), len(times_s)) electrical values; see `SignalSource.volts`."""
        with self._lock:
            return self._chain.volts(self._scene, terminals, times_s)

    def advance(self, time_s: float) -> None:
        """The clock has reached `time_s`; it never goes back."""
        with self._lock:
            self._now_s = max(self._now_s, time_s)

    def command(self, name: str, arguments: dict[str, float | str]) -> dict[str, object]:
        """pull, release, hammer, upright (settle), reset or status; answers with the state it leads to.

        `ValueError` in words for a command that is not known or not possible now.
        """
        commands: dict[str, tuple[Callable[[Arguments], None], tuple[str, ...]]] = {
            "pull": (self._pull, ("theta0_over_alpha", "duration_s")),
            "release": (self._release, ("restitution",)),
            "hammer": (self._hammer, ("intensity_rad_s",)),
            "upright": (self._upright, ("duration_s",)),
            "settle": (self._upright, ("duration_s",)),
            "reset": (self._reset, ()),
            "status": (lambda _: None, ()),
        }
        if name not in commands:
            raise ValueError(f"the virtual rig knows no command {name!r}; it knows {', '.join(commands)}")
        action, known = commands[name]
        unknown = sorted(set(arguments) - set(known))
        if unknown:
            allowed = ", ".join(known) or "none"
            raise ValueError(f"{name} has no argument {', '.join(unknown)}; it has {allowed}")
        with self._lock:
            action(arguments)
            return self._status_at(self._instant())

    # what is so

    def status(self) -> dict[str, object]:
        """State now, in plain numbers."""
        with self._lock:
            return self._status_at(self._now_s)

    def _status_at(self, time_s: float) -> dict[str, object]:
        theta, omega, _ = self._state(time_s)
        return {
            "time_s": time_s,
            "state": self._phase(time_s),
            "rotation_rad": theta,
            "velocity_rad_s": omega,
            "rotation_over_alpha": theta / self._wall.body.alpha_rad,
            "tests": sum(test.release_s <= time_s for test in self._tests),
            "truth": self._tests[-1].truth() if self._tests else None,
        }

    def truth(self, test: int = -1) -> dict[str, object]:
        """The true values of a test (the last by default): θ₀, r, impacts …; see `SimulatedTest.truth`.

        `LookupError` where no wall has been released.
        """
        with self._lock:
            if not self._tests:
                raise LookupError("the wall has not been released: there is no truth to tell")
            return self._tests[test].truth()

    @property
    def tests(self) -> tuple[SimulatedTest, ...]:
        with self._lock:
            return tuple(self._tests)

    @property
    def scene(self) -> Scene:
        """What happens at the wall, as far as it is decided."""
        with self._lock:
            return self._scene

    @property
    def chain(self) -> SensorChain:
        return self._chain

    # what happens

    def _script(self) -> None:
        plan = self.rig.simulation
        pulled = plan.upright_s + plan.pull_s
        rng = generator(self.seed, "script", "footsteps")
        self._scene = self._scene.with_knocks(footsteps(0.3, plan.upright_s, rng))
        self._start_pull(plan.upright_s, self.theta0_over_alpha, plan.pull_s)
        knocks = footsteps(pulled, pulled + plan.hold_s - 0.5, rng)
        self._scene = self._scene.with_knocks(knocks)
        self._let_go(pulled + plan.hold_s, None)

    def _pull(self, arguments: Arguments) -> None:
        level = _number(arguments, "theta0_over_alpha", self.theta0_over_alpha)
        duration = _number(arguments, "duration_s", self.rig.simulation.pull_s)
        self._wall.check_level(level)
        if not 0.2 <= duration <= 600.0:
            raise ValueError(f"a pull lasts between 0.2 and 600 s, not {duration:g} s")
        at = self._instant()
        if self._phase(at) == "rocking":
            raise ValueError("the wall is rocking: wait until it is at rest, or send 'upright' to catch it")
        self._start_pull(at, level, duration)

    def _release(self, arguments: Arguments) -> None:
        given = _number(arguments, "restitution", math.nan)
        if not math.isnan(given) and not 0.0 <= given <= 1.0:
            raise ValueError(f"restitution lies between 0 and 1, not {given:g}")
        at = self._instant()
        phase = self._phase(at)
        if phase not in ("pulling", "held") or abs(self._state(at)[0]) < _HELD_RAD:
            raise ValueError(f"nothing to release: the wall is {phase}; send 'pull' first")
        self._let_go(at, None if math.isnan(given) else given)

    def _hammer(self, arguments: Arguments) -> None:
        intensity = _number(arguments, "intensity_rad_s", 0.05)
        at = self._instant()
        self._scene = self._scene.with_knocks([Knock(at, intensity, 0.1 * intensity)])
        self._chain.forget_from(at)

    def _upright(self, arguments: Arguments) -> None:
        duration = _number(arguments, "duration_s", _LOWER_S)
        if not 0.1 <= duration <= 600.0:
            raise ValueError(f"letting down lasts between 0.1 and 600 s, not {duration:g} s")
        self._lower(duration)

    def _reset(self, _: Arguments) -> None:
        self._lower(_RESET_S)
        self._pulls = 0

    def _lower(self, duration_s: float) -> None:
        at = self._instant()
        state = self._state(at)
        self._cut(at)
        self._scene = self._scene.with_path(lower_path(at, state, 0.0, duration_s))
        self._phases += [(at, "lowering"), (at + duration_s, "upright")]

    def _start_pull(self, at: float, level: float, duration_s: float) -> None:
        self._pulls += 1
        self._planned_rad = level * self._wall.body.alpha_rad
        rng = generator(self.seed, f"pull {self._pulls}", "handling")
        target = self._wall.release_rotation(level, self._pulls)
        start = self._state(at)[0]
        self._cut(at)
        pieces, knocks = pull_path(at, start, target, duration_s, rng)
        self._scene = self._scene.with_path(pieces).with_knocks(knocks)
        self._phases += [(at, "pulling"), (at + duration_s, "held")]

    def _let_go(self, at: float, restitution: float | None) -> None:
        theta, omega, _ = self._state(at)
        self._cut(at)
        earlier = sum(len(test.motion.impact_time_s) for test in self._tests)
        test = self._wall.release(at, theta, omega, self._pulls, earlier, restitution, self._planned_rad)
        self._tests.append(test)
        knock = Knock(at, _SNAP_RAD_S)
        self._scene = self._scene.with_motion(test.motion, at).with_knocks([knock])
        self._phases += [(at, "rocking"), (at + test.motion.end_s, test.motion.ending)]

    def _cut(self, at: float) -> None:
        """Forget what was decided for `at` and later: a command has changed it."""
        self._scene = self._scene.cut(at)
        self._phases = [phase for phase in self._phases if phase[0] < at]
        self._tests = [test.interrupted(at) for test in self._tests if test.release_s < at]
        self._chain.forget_from(at)

    def _instant(self) -> float:
        """When a command given now takes effect."""
        return math.ceil(self._now_s / COMMAND_GRID_S - 1e-6) * COMMAND_GRID_S

    def _phase(self, time_s: float) -> str:
        return next(name for start, name in reversed(self._phases) if start <= time_s)

    def _state(self, time_s: float) -> tuple[float, float, float]:
        """(θ, θ̇, θ̈) of the joint."""
        return self._scene.rotation_at(time_s)


def _number(arguments: Arguments, name: str, default: float) -> float:
    value = arguments.get(name, default)
    try:
        return float(value)
    except ValueError:
        raise ValueError(f"{name} must be a number, not {value!r}") from None
