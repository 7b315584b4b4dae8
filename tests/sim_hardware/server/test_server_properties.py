"""Properties of the parts: clocks and their inverse, converters, crossings, and the reply's bytes."""

from __future__ import annotations

import itertools
import json

import grpc
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from nidaqmx._stubs import nidaqmx_pb2 as pb

from sim_hardware.daqmx_server.channels.converter import Converter
from sim_hardware.daqmx_server.services.reads.analog_reads import encode_f64
from sim_hardware.daqmx_server.timing.sample_times import SampleTimes
from sim_hardware.daqmx_server.timing.sampling import Input, Sampler
from sim_hardware.daqmx_server.timing.triggers import Condition, CrossingSearch
from sim_hardware.faults.model import ClockChange, fault_from
from tests.support.server_support import Rig

_steady = settings(max_examples=60)

_changes = st.lists(
    st.builds(
        lambda start, length, factor: ClockChange(start, start + length, factor),
        st.floats(0, 5),
        st.floats(0.01, 2),
        st.sampled_from([0.0, 0.5, 1 + 50e-6, 1 - 50e-6, 2.0]),
    ),
    max_size=4,
)


@_steady
@given(first=st.floats(0, 3), rate=st.sampled_from([10.0, 1000.0, 4000.0, 51.2e3 / 12]), changes=_changes)
def test_counting_is_the_inverse_of_timing(first: float, rate: float, changes: list[ClockChange]) -> None:
    """At the instant of sample k there are k + 1 samples, just before it k; instants ascend."""
    times = SampleTimes(first, rate, changes)
    index = np.unique(np.geomspace(1, 20 * rate, 60).astype(np.int64)) - 1
    instants = times.at(index)
    assert np.all(np.diff(instants) > 0)
    for k, instant in zip(index.tolist(), instants.tolist(), strict=True):
        assert times.count(instant + 1e-9) == k + 1
        assert times.count(instant - 1e-3 / rate) <= k + (1 if _stalled_at(changes, instant) else 0)


def _stalled_at(changes: list[ClockChange], instant: float) -> bool:
    return any(change.factor == 0.0 and abs(change.end_s - instant) < 1e-6 for change in changes)


@_steady
@given(st.lists(st.floats(-20, 20), min_size=1, max_size=50), st.sampled_from([12, 16, 24]))
def test_converters_are_off_by_half_a_step_or_at_a_rail(volts: list[float], bits: int) -> None:
    converter = Converter(-10.0, 10.0, bits)
    values = np.array(volts)
    got = converter.electrical(converter.codes(values))
    inside = np.abs(values) < 10.0 - converter.step
    assert np.all(np.abs(got - values)[inside] <= converter.step / 2 * (1 + 1e-9))
    assert np.all((got >= -10.0) & (got < 10.0))


class _Ramp:
    def volts(self, terminals: tuple[str, ...], times_s: np.ndarray) -> np.ndarray:
        return np.outer(np.arange(1.0, len(terminals) + 1), np.sin(times_s))


class _Untouched:
    def distort(self, terminals: object, times_s: object, volts: np.ndarray) -> np.ndarray:
        return volts


@_steady
@given(cuts=st.lists(st.integers(0, 5000), max_size=12))
def test_a_block_is_the_same_in_any_pieces_and_order(cuts: list[int]) -> None:
    converter = Converter(-5.0, 5.0, 16)
    inputs = [
        Input("a", converter, 0.0),
        Input("b", converter, 1e-4),
        Input("c", converter, 0.0, hold_s=0.01),
    ]
    whole = Sampler(_Ramp(), _Untouched(), inputs, SampleTimes(0.5, 1000.0)).codes(0, 5000)  # type: ignore[arg-type]
    pieces = Sampler(_Ramp(), _Untouched(), inputs, SampleTimes(0.5, 1000.0))  # type: ignore[arg-type]
    edges = sorted({0, 5000, *cuts})
    spans = list(itertools.pairwise(edges))
    for start, stop in spans[::2] + spans[1::2]:
        assert np.array_equal(pieces.codes(start, stop), whole[:, start:stop])


@_steady
@given(
    wave=st.lists(st.floats(-2, 2), min_size=1, max_size=60),
    steps=st.lists(st.integers(1, 20), min_size=1, max_size=8),
    hysteresis=st.floats(0, 1),
)
def test_a_crossing_is_found_whatever_the_pieces(
    wave: list[float], steps: list[int], hysteresis: float
) -> None:
    """Against the definition: the first sample at or above the level after one below level − hysteresis."""
    condition = Condition(0.5, np.inf, 0.5 - hysteresis, np.inf)
    values = np.array(wave)
    armed, expected = False, None
    for k, value in enumerate(wave):
        if armed and value >= 0.5:
            expected = k
            break
        armed = armed or value < 0.5 - hysteresis
    search = CrossingSearch(condition, 0)
    found, stop = None, 0
    for step in [*steps, len(wave)]:
        stop = min(stop + step, len(wave))
        found = search.find(lambda start, end: values[start:end], stop)
        if found is not None:
            break
    assert found == expected


@_steady
@given(
    channels=st.integers(0, 6),
    samples=st.integers(0, 200),
    status=st.sampled_from([0, -200284]),
    seed=st.integers(0, 9),
)
def test_encoded_replies_are_what_protobuf_reads(channels: int, samples: int, status: int, seed: int) -> None:
    values = np.random.default_rng(seed).normal(size=(channels, samples))
    message = pb.ReadAnalogF64Response.FromString(encode_f64(values, status, samples))
    assert (message.status, message.samps_per_chan_read) == (status, samples)
    assert np.array_equal(np.array(message.read_array), values.ravel())


_json = st.recursive(
    st.none() | st.booleans() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)


@_steady
@given(table=st.dictionaries(st.sampled_from(["kind", "target", "at_s", "for_s", "count", "ppm"]), _json))
def test_a_fault_is_understood_or_refused_in_words(table: dict[str, object]) -> None:
    for kind in ("clock_drift", "read_timeout", table.get("kind")):
        try:
            fault = fault_from(table | {"kind": kind})
        except ValueError as error:
            assert len(str(error)) > 10
        else:
            assert fault.for_s >= 0


def test_hostile_messages_to_the_control_service_are_refused(rig: Rig) -> None:
    call = rig.channel.unary_unary("/rocking.SimControl/Command")
    messages = [
        b"",
        b"\xff\xfe",
        b"[]",
        b"7",
        b'{"name": 3}',
        b"[" * 100_000,
        b'{"name": "fault", "arguments": 5}',
    ]
    messages += [json.dumps({"name": "digital_edge", "arguments": {}}).encode()]
    for message in messages:
        with pytest.raises(grpc.RpcError) as caught:
            call(message, timeout=10)
        assert caught.value.code() == grpc.StatusCode.INVALID_ARGUMENT, message[:40]
    assert rig.control.command("bench")["tasks"] == {}
