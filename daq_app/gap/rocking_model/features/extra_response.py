"""What effects do to the blocks beyond the families: one channel, ring-downs, the floor."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from scipy.signal import cont2discrete, lfilter

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.rings import ring_columns
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.sensor_blocks import Block, Shares, first_order
from daq_app.gap.rocking_model.motion.motion_grid import GRID_HZ
from daq_app.gap.rocking_model.motion.rotation import TAIL_S, WireInverse
from daq_app.gap.rocking_model.records import Sensor


def bessel(values: FloatArray, delay_s: float) -> FloatArray:
    """Second-order Bessel low-pass of group delay `delay_s` on the coarse grid."""
    if delay_s <= 1e-5:
        # As good as a delay, and not nothing: a fit that starts from none has to see where it leads.
        return values - delay_s * GRID_HZ * np.gradient(values)
    return resonator(values, np.sqrt(3.0) / delay_s, np.sqrt(3.0) / 2.0)


def resonator(values: FloatArray, natural: float, zeta: float) -> FloatArray:
    """ÿ/ω² + 2ζẏ/ω + y = x on the coarse grid, for an x that is straight between samples; starts settled.

    A bilinear transform would be off in delay by a fifth where the response is as quick as the grid.
    """
    numerator, denominator = _discrete(float(natural), float(zeta))
    found: FloatArray = lfilter(numerator, denominator, values - values[0]) + values[0]
    return found


@lru_cache(maxsize=64)
def _discrete(natural: float, zeta: float) -> tuple[FloatArray, FloatArray]:
    """Filter of the resonator; all runs and blocks of one prediction ask for the same one."""
    numerator, denominator, _ = cont2discrete(
        ([natural**2], [1.0, 2.0 * zeta * natural, natural**2]), 1.0 / GRID_HZ, method="foh"
    )
    return numerator[0], denominator


def responded(values: FloatArray, effect: str, given: Mapping[str, float]) -> FloatArray:
    """A signal on the grid as a sensor with the effect shows it."""
    match effect:
        case "gain":
            return values * (1.0 + given["error"])
        case "lag":
            k = np.arange(values.size, dtype=float)
            return np.asarray(np.interp(k - given["tau"] * GRID_HZ, k, values))
        case "slow_response":
            return first_order(values, given["tau"])
        case "filter_delay":
            return bessel(values, given["tau"])
        case "wire_inertia":
            return resonator(values, 2.0 * np.pi * given["frequency"], given.get("zeta", 0.2))
        case "wire_cosine":
            return values + given["kappa"] * values**2
        case "drift":
            return values + given["rate"] * np.arange(values.size) / GRID_HZ
    raise KeyError(effect)


def _rotation(block: Block) -> FloatArray:
    """What the other wires say of the rotation."""
    assert block.expected is not None
    assert block.wire is not None
    return block.expected / block.wire.sensor.position_m[2]


def channel(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """Coefficients of one channel against its family, and the logarithm of what they leave over noise."""
    assert block.expected is not None
    assert block.design is not None
    # A wire's faults act on its length, of which its height times the rotation is a curved picture.
    true = block.expected if block.wire is None else block.wire.shortening(_rotation(block))
    total: FloatArray | None = None
    for key in {k.rpartition(".")[0] for k in values if k.rpartition(".")[0].endswith("@" + block.family)}:
        effect = key.partition("@")[0]
        given = {k.rpartition(".")[2]: v for k, v in values.items() if k.rpartition(".")[0] == key}
        if effect == "wire_anchor":
            assert block.wire is not None
            series = block.wire.shortening(_rotation(block), given["height"]) - true
        else:
            series = responded(true, effect, given) - true
        total = series if total is None else total + series
    found = np.zeros(len(block.names))
    ringing = _ringing(run, block, values)
    if total is not None or ringing is not None:
        total = np.zeros_like(true) if total is None else total
        if block.wire is not None:
            # The zero of every channel is its rest at the end of the record.
            total = total - total[-round(TAIL_S * GRID_HZ) :].mean()
            total = block.wire.sensor.position_m[2] * block.wire.rotation(true + total) - block.expected
        total = total if ringing is None else total + ringing
        seen = total[block.pick]
        found[:-1] = block.projection @ seen
        left = seen - block.design @ (block.design.T @ seen)
        found[-1] = 0.5 * np.log1p(float(left @ left) / seen.size / block.noise**2)
    for k, shape in enumerate(block.names[: len(block.levers)]):
        found[k] += values.get(f"cal_{block.family}_{shape}", 0.0)
    return found


_RINGS = (("bending", "flexible_wall.gain"), ("turning", "yaw.kick"), ("turning", "twist.kick"))


def _ringing(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray | None:
    """What a wall that rings moves one wire by, beyond what the others make of it, m; None for nothing.

    They stand at other heights and on other sides, so it does not cancel as a rotation does.
    """
    if block.wire is None:
        return None
    parts = []
    for family, key in _RINGS:
        ring = next((b for b in run.blocks if b.family == family), None)
        size = values.get(key, 0.0)
        if ring is None or size == 0.0:
            continue
        if (block.family, key) not in run.cache:
            run.cache[block.family, key] = _ringing_of_one(run, block.wire, ring, key)
        parts.append(size * run.cache[block.family, key])
    return np.asarray(np.sum(parts, axis=0)) if parts else None


def _ringing_of_one(run: RockingRun, wire: WireInverse, ring: Block, key: str) -> FloatArray:
    """The same for a strength of one, at the frequency and damping that the runs show."""
    frequency, zeta, rate = ring.ring
    wave = np.sinc(frequency / rate) * ring_columns(run.grid, frequency, zeta)[:, 0]

    def moved(sensor: Sensor) -> float:
        _, y, z = sensor.position_m
        if key.startswith("flexible_wall"):
            return float((z / run.survey.height_m) ** 2)
        return (y * z if key.startswith("twist") else -y) / (2.0 * np.pi * frequency)

    others = [w.sensor for w in run.wires if w.sensor.id != wire.sensor.id]
    heights = np.array([sensor.position_m[2] for sensor in others])
    weights = np.array([1.0, wire.sensor.position_m[2]]) @ np.linalg.pinv(
        np.column_stack([np.ones_like(heights), heights])
    )
    beyond = moved(wire.sensor) - float(weights @ np.array([moved(sensor) for sensor in others]))
    return np.asarray(beyond * wave)


def transfer(rate: complex, family: str, values: Mapping[str, float]) -> complex:
    """What a family's sensors make of exp(rate · t): the Laplace transform of their response."""
    found = 1.0 + 0.0j
    if tau := values.get(f"lag@{family}.tau", 0.0):
        found *= np.exp(-rate * tau)
    if tau := values.get(f"slow_response@{family}.tau", 0.0):
        found /= 1.0 + rate * tau
    if tau := values.get(f"filter_delay@{family}.tau", 0.0):
        found *= 3.0 / ((rate * tau) ** 2 + 3.0 * rate * tau + 3.0)
    if frequency := values.get(f"wire_inertia@{family}.frequency", 0.0):
        natural, zeta = 2.0 * np.pi * frequency, values.get(f"wire_inertia@{family}.zeta", 0.2)
        found *= natural**2 / (rate**2 + 2.0 * zeta * natural * rate + natural**2)
    return complex(found)


def delay(family: str, values: Mapping[str, float]) -> float:
    """By how much a family's sensors are late, s."""
    late = sum(
        values.get(f"{effect}@{family}.tau", 0.0) for effect in ("lag", "slow_response", "filter_delay")
    )
    if frequency := values.get(f"wire_inertia@{family}.frequency", 0.0):
        late += values.get(f"wire_inertia@{family}.zeta", 0.2) / (np.pi * frequency)
    return late


def _ring_coefficients(
    run: RockingRun, block: Block, ring: Block, values: Mapping[str, float]
) -> list[complex]:
    """Per coefficient of the block, what its family's readings show of the motion that `ring` is of: the
    imaginary part of c exp(rate · t) has the sine Re c and the cosine Im c; accelerations over ω².
    The impacts are where the reference shows them, as late as it is.
    """
    frequency, zeta, _ = ring.ring
    natural = 2.0 * np.pi * frequency
    rate = natural * (-zeta + 1j * np.sqrt(1.0 - zeta**2))
    found = []
    for name, shares in zip(block.names, block.shares, strict=False):
        family = name.partition(" in ")[2].removesuffix("s")
        own = _moved(ring, shares, values)
        undone = block.undone_s if family == "accelerometer" else 0.0
        early = np.exp(rate * (undone + delay(run.reference, values)))
        twice = -((1.0 - 2.0 * zeta**2) + 2j * zeta) if family == "accelerometer" else 1.0
        found.append(own * twice * transfer(rate, family, values) * early if own else 0.0j)
    return found


def _moved(ring: Block, shares: Shares, values: Mapping[str, float]) -> float:
    """Size of the sine in a signal of these shares, by the wall's bending or turning."""
    frequency, _, rate = ring.ring
    mean = float(np.sinc(frequency / rate))
    if ring.kind == "bending":
        return shares.bend * mean * values.get("flexible_wall.gain", 0.0)
    turned = shares.yaw * values.get("yaw.kick", 0.0) + shares.twist * values.get("twist.kick", 0.0)
    return turned * mean / (2.0 * np.pi * frequency)


def _put(
    run: RockingRun, block: Block, values: Mapping[str, float], frequency: float, zeta: float
) -> FloatArray:
    """The coefficients of a ring-down as numbers, with those of the oscillator."""
    found = np.zeros(len(block.names))
    for k, c in enumerate(_ring_coefficients(run, block, block, values)):
        found[k] = c.real if block.names[k].startswith("sine") else c.imag
    own = {"frequency": frequency, "damping": zeta}
    for k, name in enumerate(block.names):
        found[k] = own.get(name, found[k])
    return found * _faded(block, zeta) + _of_the_other(run, block, values)


_EVEN = 1e-9
"""Share below which sensors stand evenly, and what rounding leaves is none."""


def _of_the_other(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """What turns in the signals of bending, what bends in those of turning.

    Sensors on both sides of the middle keep them apart; with one of them left out they do not.
    """
    found = np.zeros(len(block.names))
    other = next((b for b in run.blocks if b.ring[0] and b.kind != block.kind), None)
    if other is None or not any(abs(_moved(other, s, values)) > _EVEN for s in block.shares):
        return found
    frequency, zeta, _ = other.ring
    key = (block.family, "the other ring")
    if key not in run.cache:
        run.cache[key] = block.projection @ ring_columns(run.grid, frequency, zeta)
    for k, c in enumerate(_ring_coefficients(run, block, other, values)):
        size = (2.0 * np.pi * frequency) ** 2 if block.names[k].endswith("accelerometers") else 1.0
        found[k] = size * float(run.cache[key][k] @ (c.real, c.imag))
    return found


def bending(
    run: RockingRun, block: Block, values: Mapping[str, float], wires: FloatArray | None
) -> FloatArray:
    """Ring-down of a cantilever mode, and what effects on the wires look like in the same columns."""
    frequency, zeta, _ = block.ring
    own = (values.get("flexible_wall.frequency", frequency), values.get("flexible_wall.zeta", zeta))
    return _put(run, block, values, *own) + _in_wires(block, wires)


def turning(
    run: RockingRun, block: Block, values: Mapping[str, float], wires: FloatArray | None
) -> FloatArray:
    """Ring-down of yaw (the wall turns about the vertical) or of twist (θ differs along the length)."""
    frequency, zeta, _ = block.ring
    other = "yaw" if "yaw.kick" in values else "twist"
    own = (values.get(f"{other}.frequency", frequency), values.get(f"{other}.zeta", zeta))
    return _put(run, block, values, *own) + _in_wires(block, wires)


def shows_rotation(block: Block) -> bool:
    """Whether an error of the wires' rotation shows in a ring-down's signals."""
    return any(
        n.endswith("in wires") and abs(s.rotation) > _EVEN
        for n, s in zip(block.names, block.shares, strict=False)
    )


def _faded(block: Block, zeta: float) -> FloatArray:
    """Size of each coefficient, made with the block's damping, of a ring-down with another damping."""
    found = np.ones(len(block.names))
    found[: len(block.fading)] += np.array(block.fading) * np.log(zeta / block.ring[1])
    return found


def _in_wires(block: Block, series: FloatArray | None) -> FloatArray:
    """What a difference of the wires' rotation, if any, makes of the columns read from wires."""
    found = np.zeros(len(block.names))
    if series is not None:
        for k, name in enumerate(block.names):
            if name.endswith("in wires"):
                found[k] = block.shares[k].rotation * float(block.projection[k] @ series)
    return found


def floor(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """The sinusoid of the floor while the wall does not move."""
    found = {
        "amplitude": values.get("ambient.amplitude", 0.0),
        "frequency": values.get("ambient.fitted", run.vibration.frequency_hz if run.vibration else 0.0),
    }
    return np.array([found[name] for name in block.names])


def with_measured_inputs(run: RockingRun, values: Mapping[str, float]) -> Mapping[str, float]:
    """The values with what is not fitted but read from the run itself: the floor's frequency and phase."""
    if "ambient.amplitude" not in values or run.vibration is None:
        return values
    seen = run.vibration
    given = {**values, "ambient.frequency": seen.frequency_hz}
    given["ambient.phase"] = seen.phase + seen.phase_sd * values.get("ambient.shift", 0.0)
    if "ambient.frequency" in values:
        given["ambient.fitted"] = values["ambient.frequency"]
    return given
