"""Rubbish on the wire harms nobody, and every message survives it."""

from __future__ import annotations

import json
import socket
from collections.abc import Callable, Iterator
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
import zmq
from hypothesis import given, settings
from hypothesis import strategies as st

from daq_app.acquisition.messages.published import BlockMessage, EstimateMessage, Reply
from daq_app.acquisition.viewers.client import AcquisitionClient, decode
from tests.support.recorder.desk_bench import CALM, TOKEN, Counter, listen_until_heard

RUBBISH = [
    b"",
    b"\x00" * 1000,
    b"{}",
    b"[]",
    b"null",
    b'{"name": 5}',
    b'{"name": "arm", "arguments": {"test": {"a": 1}}}',
    b'{"name": "arm", "more": 1}',
    b'{"name": "arm", "token": null}',
    b"[" * 50_000,
    b'{"a":' * 10_000,
    b'{"name": "\xff\xfe"}',
    json.dumps({"name": "arm", "arguments": {"x": 1e400}}).encode(),
]


@pytest.mark.parametrize("body", RUBBISH, ids=range(len(RUBBISH)))
def test_rubbish_is_refused_and_the_next_request_served(
    counters: Callable[..., Counter], body: bytes
) -> None:
    counter = counters()
    context: zmq.Context[Any] = zmq.Context()
    asker = context.socket(zmq.REQ)
    asker.linger = 0
    asker.connect(counter.address)
    asker.send(body)
    assert asker.poll(5000), "even rubbish gets an answer"
    assert not Reply.model_validate_json(asker.recv()).ok
    context.destroy(linger=0)
    with AcquisitionClient(counter.address, TOKEN) as client:
        assert client.request("arm").ok


@pytest.fixture(scope="module")
def lasting() -> Iterator[Counter]:
    """One desk for all examples of a hypothesis test."""
    counter = Counter()
    yield counter
    counter.close()


@settings(max_examples=60)
@given(frames=st.lists(st.binary(max_size=300), min_size=1, max_size=12))
def test_any_frames_at_all(lasting: Counter, frames: list[bytes]) -> None:
    counter = lasting
    context: zmq.Context[Any] = zmq.Context()
    sender = context.socket(zmq.DEALER)
    sender.linger = 1000
    sender.connect(counter.address)
    sender.send_multipart(frames)
    with AcquisitionClient(counter.address, TOKEN, topics=()) as client:
        assert client.request("arm").ok
    context.destroy(linger=0)


@pytest.mark.parametrize(
    "data",
    [
        b"GET / HTTP/1.1\r\n\r\n",
        b"\xff" + b"\x00" * 8 + b"\x7f" + b"\xff" * 200,
        b"\x00" * 64,
        b"\x16\x03\x01",
    ],
)
def test_a_stranger_on_the_port_who_speaks_another_language(
    counters: Callable[..., Counter], data: bytes
) -> None:
    counter = counters()
    for endpoint in (counter.desk.addresses.commands, counter.desk.addresses.publisher):
        parts = urlsplit(endpoint)
        with socket.create_connection((parts.hostname or "", parts.port or 0), timeout=5.0) as line:
            line.sendall(data)
    with AcquisitionClient(counter.address, TOKEN) as client:
        assert client.request("arm").ok
        assert listen_until_heard(client, counter).text == "hear this"


def test_a_message_that_is_too_long_is_cut_off(counters: Callable[..., Counter]) -> None:
    counter = counters()
    context: zmq.Context[Any] = zmq.Context()
    sender = context.socket(zmq.DEALER)
    sender.linger = 1000
    sender.connect(counter.address)
    sender.send(b"x" * 10_000_000)
    assert not sender.poll(300)
    context.destroy(linger=0)
    with AcquisitionClient(counter.address, TOKEN) as client:
        assert client.request("arm").ok


@given(frames=st.lists(st.binary(max_size=200), max_size=4))
def test_a_viewer_survives_any_published_frames(frames: list[bytes]) -> None:
    assert decode(frames) is None or len(frames) >= 2


@given(
    topic=st.sampled_from([b"state", b"block", b"motion", b"estimate", b"health", b"event"]),
    body=st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
        max_leaves=8,
    ),
    readings=st.binary(max_size=64),
)
def test_a_viewer_survives_any_json(topic: bytes, body: Any, readings: bytes) -> None:
    decode([topic, json.dumps(body).encode(), readings])


def test_every_message_survives_the_wire_nan_included() -> None:
    nan = float("nan")
    estimate = EstimateMessage(
        theta0_rad=nan,
        release_sample=5,
        impact_samples=[1.5],
        peaks_rad=[0.1, nan],
        impact_velocities_rad_s=[nan],
        eav=[],
        crt=[],
        r_max=0.93,
    )
    back = decode([b"estimate", estimate.model_dump_json().encode()])
    assert back is not None
    assert json.loads(estimate.model_dump_json())["peaks_rad"][0] == 0.1
    assert np.isnan(back.message.peaks_rad[1])  # type: ignore[attr-defined]
    back = decode([b"health", CALM.model_dump_json().encode()])
    assert back is not None and back.message == CALM
    block = BlockMessage(first_sample=7, n_samples=3, n_channels=2, rate_hz=4000.0)
    values = np.arange(6, dtype="<f4").reshape(2, 3)
    back = decode([b"block", block.model_dump_json().encode(), values.tobytes()])
    assert back is not None and back.readings is not None
    assert np.array_equal(back.readings, values)
    assert decode([b"block", block.model_dump_json().encode(), values.tobytes()[:-1]]) is None
