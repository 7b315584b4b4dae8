"""The sockets: who may listen, who may command, and that rubbish on the wire harms nobody."""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
import zmq
from hypothesis import given, settings
from hypothesis import strategies as st

from daq_app.acquisition.messages.published import (
    BlockMessage,
    Command,
    EstimateMessage,
    HealthMessage,
    Reply,
    State,
    StateMessage,
)
from daq_app.acquisition.viewers.client import AcquisitionClient, AcquisitionUnreachable, decode
from daq_app.acquisition.viewers.curve import (
    KeyFileError,
    ViewerKeys,
    create_recorder_keys,
    create_viewer_keys,
)
from daq_app.acquisition.viewers.desk import Desk, DeskError

TOKEN = "the right token"


class Counter:
    """A desk that serves in a thread and remembers what it was asked."""

    def __init__(self, bind: str = "tcp://127.0.0.1:0", keys: Path | None = None) -> None:
        self.asked: list[Command] = []
        self.ticks = 0
        self.desk = Desk(bind, self._handle, TOKEN, keys)
        self._serving = threading.Thread(target=lambda: self.desk.serve(self._tick, 0.02))
        self._serving.start()

    @property
    def address(self) -> str:
        return self.desk.addresses.commands

    def _tick(self) -> None:
        self.ticks += 1

    def _handle(self, command: Command) -> Reply | Future[Reply]:
        if command.name == "hello":
            return Reply(ok=True, data={"publisher": self.desk.addresses.publisher})
        self.asked.append(command)
        if command.name == "break":
            raise RuntimeError("a fault of ours")
        if command.name == "later":
            later: Future[Reply] = Future()
            threading.Timer(0.05, lambda: later.set_result(Reply(ok=True, text="now"))).start()
            return later
        return Reply(ok=True, text=command.name)

    def close(self) -> None:
        self.desk.stop()
        self._serving.join(10.0)
        assert not self._serving.is_alive(), "the counter must not hang"
        self.desk.close()


@pytest.fixture
def counters() -> Iterator[Callable[..., Counter]]:
    made: list[Counter] = []

    def make(*arguments: Any) -> Counter:
        made.append(Counter(*arguments))
        return made[-1]

    yield make
    for one in made:
        one.close()


def listen_until_heard(client: AcquisitionClient, counter: Counter) -> Any:
    """A subscription takes a moment to arrive: publish until it does."""
    message = StateMessage(state=State.ARMED, text="hear this")
    for _ in range(200):
        counter.desk.publisher.send("state", message)
        received = client.receive(0.05)
        if received is not None:
            return received.message
    raise AssertionError("nothing was heard")


def test_a_viewer_hears_and_commands(counters: Callable[..., Counter]) -> None:
    counter = counters()
    with AcquisitionClient(counter.address, TOKEN) as client:
        assert client.request("arm", test="FR1-L3-2").text == "arm"
        assert counter.asked[-1].arguments == {"test": "FR1-L3-2"}
        assert client.request("later").text == "now"
        assert listen_until_heard(client, counter).text == "hear this"


def test_a_request_whose_answer_is_lost_is_sent_again() -> None:
    """The first answer never comes, as where a connection breaks."""
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    router = context.socket(zmq.ROUTER)
    port = router.bind_to_random_port("tcp://127.0.0.1")
    asked: list[Command] = []

    def serve() -> None:
        while len(asked) < 3:
            *envelope, body = router.recv_multipart()
            asked.append(Command.model_validate_json(body))
            if len(asked) == 2:
                continue  # the first "stop"
            reply = Reply(ok=True, text=str(len(asked)), data={"publisher": "tcp://127.0.0.1:9"})
            router.send_multipart([*envelope, reply.model_dump_json().encode()])

    serving = threading.Thread(target=serve)
    serving.start()
    with AcquisitionClient(f"tcp://127.0.0.1:{port}", TOKEN) as client:
        assert client.request("stop", timeout_s=30.0).text == "3"
    serving.join(10.0)
    context.destroy(linger=0)
    assert [command.name for command in asked] == ["hello", "stop", "stop"]
    assert asked[1].request == asked[2].request != asked[0].request


@pytest.mark.parametrize("name", ["arm", "later", "break"])
def test_a_request_that_comes_twice_is_carried_out_once_and_answered_twice(
    counters: Callable[..., Counter], name: str
) -> None:
    counter = counters()
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    dealer = context.socket(zmq.DEALER)
    dealer.connect(counter.address)
    answers = {}
    for request in ("first", "second"):
        body = Command(name=name, token=TOKEN, request=request).model_dump_json().encode()
        for _ in range(2):
            dealer.send_multipart([b"", body])
        assert dealer.poll(10_000)
        answers[request] = [dealer.recv_multipart() for _ in range(2)]
    context.destroy(linger=0)
    assert all(one == again for one, again in answers.values())
    assert [command.request for command in counter.asked] == ["first", "second"]


@pytest.mark.parametrize("token", ["", "wrong", TOKEN + "x", TOKEN[:-1], "é"])
def test_without_the_token_one_may_watch_and_not_command(
    counters: Callable[..., Counter], token: str
) -> None:
    counter = counters()
    with AcquisitionClient(counter.address, token) as client:
        for name in ("arm", "stop", "abort", "tare", "shutdown", "marker"):
            reply = client.request(name)
            assert not reply.ok and "watch, not command" in reply.text
        assert listen_until_heard(client, counter).text == "hear this"
    assert counter.asked == []


def test_a_fault_of_ours_in_a_request_is_told_and_the_desk_lives_on(
    counters: Callable[..., Counter],
) -> None:
    counter = counters()
    with AcquisitionClient(counter.address, TOKEN) as client:
        assert "a fault of ours" in client.request("break").text
        assert client.request("arm").ok


def test_nobody_there(unused_port: int) -> None:
    with pytest.raises(AcquisitionUnreachable, match="running"):
        AcquisitionClient(f"tcp://127.0.0.1:{unused_port}", timeout_s=0.2)


@pytest.fixture
def unused_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def test_many_viewers_at_once(counters: Callable[..., Counter]) -> None:
    counter = counters()
    clients = [AcquisitionClient(counter.address, TOKEN) for _ in range(8)]
    try:
        for client in clients:
            assert client.request("marker").ok
            assert listen_until_heard(client, counter).text == "hear this"
    finally:
        for client in clients:
            client.close()


def test_a_viewer_that_never_reads_holds_nobody_up(counters: Callable[..., Counter]) -> None:
    counter = counters()
    with AcquisitionClient(counter.address), AcquisitionClient(counter.address, TOKEN) as awake:
        block = BlockMessage(first_sample=0, n_samples=400, n_channels=41, rate_hz=4000.0)
        readings = np.zeros((41, 400), dtype="<f4").tobytes()
        for _ in range(3000):  # 200 MB: far beyond any buffer
            counter.desk.publisher.send("block", block, readings)
        assert awake.request("marker").ok
        ticks = counter.ticks
        while counter.ticks == ticks:
            pass


# -- beyond this machine ----------------------------------------------------------------------------


def test_nothing_listens_beyond_this_machine_without_keys() -> None:
    for bind in ("tcp://0.0.0.0:0", "tcp://*:0", "tcp://192.0.2.1:0"):
        with pytest.raises(DeskError, match="keys"):
            Desk(bind, lambda command: Reply(ok=True), TOKEN)


@pytest.mark.parametrize(
    "bind", ["tcp://127.0.0.1:99999", "", "localhost", "http://127.0.0.1:0", "tcp://127.0.0.1"]
)
def test_an_address_that_is_none_is_told(bind: str) -> None:
    with pytest.raises(DeskError, match="Cannot listen"):
        Desk(bind, lambda command: Reply(ok=True), TOKEN)


def test_with_keys_only_known_viewers_are_heard(counters: Callable[..., Counter], tmp_path: Path) -> None:
    recorder = create_recorder_keys(tmp_path / "keys")
    public, secret = create_viewer_keys(tmp_path / "mine", "bench")
    _, stranger = create_viewer_keys(tmp_path / "theirs", "stranger")
    (tmp_path / "keys" / "viewers" / public.name).write_bytes(public.read_bytes())
    counter = counters("tcp://0.0.0.0:0", tmp_path / "keys")
    address = f"tcp://127.0.0.1:{urlsplit(counter.address).port}"
    with pytest.raises(AcquisitionUnreachable):
        AcquisitionClient(address, TOKEN, timeout_s=0.3)
    with pytest.raises(AcquisitionUnreachable):
        AcquisitionClient(address, TOKEN, keys=ViewerKeys(stranger, recorder), timeout_s=0.3)
    with AcquisitionClient(address, TOKEN, keys=ViewerKeys(secret, recorder)) as client:
        assert client.request("arm").ok
        assert listen_until_heard(client, counter).text == "hear this"
    assert secret.stat().st_mode & 0o077 == 0, "a secret key is for its owner only"


def test_a_viewer_whose_key_is_removed_is_cut_off_at_once(
    counters: Callable[..., Counter], tmp_path: Path
) -> None:
    recorder = create_recorder_keys(tmp_path / "keys")
    admitted = tmp_path / "keys" / "viewers"
    secrets = {}
    for name in ("stays", "goes"):
        public, secrets[name] = create_viewer_keys(tmp_path / name, name)
        (admitted / public.name).write_bytes(public.read_bytes())
    counter = counters("tcp://0.0.0.0:0", tmp_path / "keys")
    address = counter.desk.addresses.commands.replace("0.0.0.0", "127.0.0.1")

    def client(name: str, timeout_s: float) -> AcquisitionClient:
        return AcquisitionClient(
            address, TOKEN, keys=ViewerKeys(secrets[name], recorder), timeout_s=timeout_s
        )

    with client("goes", 5.0) as goes, client("stays", 5.0) as stays:
        assert goes.request("arm", timeout_s=5.0).ok
        (admitted / "goes.key").unlink()
        with pytest.raises(AcquisitionUnreachable):
            while True:  # ends when the counter has looked at its folder
                goes.request("arm", timeout_s=1.0)
        assert stays.request("arm", timeout_s=5.0).ok
    with pytest.raises(AcquisitionUnreachable):
        client("goes", 0.5)


def test_keys_are_never_replaced_silently(tmp_path: Path) -> None:
    public = create_recorder_keys(tmp_path)
    before = public.read_bytes()
    with pytest.raises(KeyFileError, match="exists already"):
        create_recorder_keys(tmp_path)
    assert public.read_bytes() == before
    create_viewer_keys(tmp_path / "mine", "bench")
    with pytest.raises(KeyFileError, match="exists already"):
        create_viewer_keys(tmp_path / "mine", "bench")


def test_keys_that_are_missing_or_broken_are_told(tmp_path: Path) -> None:
    with pytest.raises(DeskError, match="daq-app keys"):
        Desk("tcp://0.0.0.0:0", lambda command: Reply(ok=True), TOKEN, tmp_path)


# -- hostile wire -----------------------------------------------------------------------------------

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
    health = HealthMessage(
        sample=1,
        acknowledged_sample=1,
        recording=True,
        backlog_samples=0,
        buffer_samples=1,
        gaps=0,
        lost_samples=0,
    )
    back = decode([b"health", health.model_dump_json().encode()])
    assert back is not None and back.message == health
    block = BlockMessage(first_sample=7, n_samples=3, n_channels=2, rate_hz=4000.0)
    values = np.arange(6, dtype="<f4").reshape(2, 3)
    back = decode([b"block", block.model_dump_json().encode(), values.tobytes()])
    assert back is not None and back.readings is not None
    assert np.array_equal(back.readings, values)
    assert decode([b"block", block.model_dump_json().encode(), values.tobytes()[:-1]]) is None
