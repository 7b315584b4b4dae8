"""Viewers at the sockets: who may command, what is asked again, and that no viewer holds another up."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable

import numpy as np
import pytest
import zmq

from daq_app.acquisition.messages.published import BlockMessage, Command, Reply
from daq_app.acquisition.viewers.client import AcquisitionClient, AcquisitionUnreachable
from tests.support.recorder.desk_bench import TOKEN, Counter, listen_until_heard


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
