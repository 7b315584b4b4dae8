"""How viewers and commands speak to the acquisition process."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from dataclasses import dataclass
from types import TracebackType
from typing import Final, Self
from uuid import uuid4

import numpy as np
import zmq
from numpy.typing import NDArray
from pydantic import ValidationError

from daq_app.acquisition.messages.published import (
    BlockMessage,
    CheckMessage,
    Command,
    EstimateMessage,
    EventMessage,
    HealthMessage,
    Message,
    MotionMessage,
    Reply,
    StateMessage,
)
from daq_app.acquisition.viewers.curve import ViewerKeys

MODELS: Final[dict[bytes, type[Message]]] = {
    b"state": StateMessage,
    b"block": BlockMessage,
    b"motion": MotionMessage,
    b"estimate": EstimateMessage,
    b"health": HealthMessage,
    b"event": EventMessage,
    b"check": CheckMessage,
}
_RECEIVE_QUEUE: Final = 1000
_AGAIN_S: Final = 2.0
"""Time after which a request that is not answered is sent again."""


class AcquisitionUnreachable(Exception):
    """The acquisition process does not answer: why that may be and what to do."""


@dataclass(frozen=True, slots=True)
class Received:
    """One published message."""

    message: Message
    readings: NDArray[np.float32] | None = None
    """(n_channels, n_samples) in SI, for blocks."""


def decode(frames: list[bytes]) -> Received | None:
    """The message in the frames of a PUB socket; None for anything that is none."""
    if len(frames) not in (2, 3) or frames[0] not in MODELS:
        return None
    try:
        message = MODELS[frames[0]].model_validate_json(frames[1])
    except (ValidationError, ValueError, RecursionError):
        return None
    if not isinstance(message, BlockMessage):
        return Received(message)
    if len(frames) != 3 or len(frames[2]) != 4 * message.n_channels * message.n_samples:
        return None
    flat = np.frombuffer(frames[2], dtype="<f4")
    return Received(message, flat.reshape(message.n_channels, message.n_samples))


class AcquisitionClient:
    """One viewer's link. Not thread-safe: one thread uses it.

    `address` is the command endpoint (``tcp://127.0.0.1:PORT``); the publisher's is asked for. Without a
    `token` everything can be watched and nothing commanded.
    """

    def __init__(
        self,
        address: str,
        token: str = "",
        *,
        keys: ViewerKeys | None = None,
        topics: tuple[str, ...] = ("state", "block", "motion", "estimate", "health", "event", "check"),
        timeout_s: float = 5.0,
    ) -> None:
        """Connect. Raises `AcquisitionUnreachable` if nobody answers within `timeout_s`."""
        self._address = address
        self._token = token
        self._keys = keys
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._commands: zmq.Socket[bytes] | None = None
        self._subscriber = self._context.socket(zmq.SUB)
        try:
            self.about = self.request("hello", timeout_s=timeout_s).data
            self._subscriber.rcvhwm = _RECEIVE_QUEUE
            self._subscriber.linger = 0
            for topic in topics:
                self._subscriber.subscribe(topic.encode())
            if keys is not None:
                keys.apply(self._subscriber)
            self._subscriber.connect(str(self.about["publisher"]))
        except (KeyError, zmq.ZMQError) as error:
            self.close()
            raise AcquisitionUnreachable(f"{address} is no acquisition process ({error})") from error
        except BaseException:
            self.close()
            raise

    def request(self, name: str, timeout_s: float = 10.0, **arguments: float | str) -> Reply:
        """Send one command and wait for its answer. Raises `AcquisitionUnreachable`.

        A connection that breaks takes the request or the answer with it: the same request is sent again every
        two seconds, and the process carries it out once.
        """
        if self._commands is None:
            self._commands = self._context.socket(zmq.REQ)
            self._commands.linger = 0
            # After a time-out the next request must not wait for the lost answer.
            self._commands.setsockopt(zmq.REQ_RELAXED, 1)
            self._commands.setsockopt(zmq.REQ_CORRELATE, 1)
            if self._keys is not None:
                self._keys.apply(self._commands)
            self._commands.connect(self._address)
        command = Command(name=name, arguments=arguments, token=self._token, request=uuid4().hex)
        body, until_s = command.model_dump_json().encode(), time.monotonic() + timeout_s
        self._commands.send(body)
        while not self._commands.poll(int(1e3 * min(max(until_s - time.monotonic(), 0.0), _AGAIN_S))):
            if time.monotonic() >= until_s:
                raise AcquisitionUnreachable(
                    f"No answer from {self._address} within {timeout_s:g} s. "
                    "Is the acquisition process running?"
                )
            with contextlib.suppress(zmq.Again):  # nothing can be sent: the connection is on its way back
                self._commands.send(body, flags=zmq.NOBLOCK)
        try:
            return Reply.model_validate_json(self._commands.recv())
        except ValidationError as error:
            raise AcquisitionUnreachable(f"{self._address} is no acquisition process") from error

    def receive(self, timeout_s: float) -> Received | None:
        """The next published message, or None when none comes in time."""
        deadline = time.monotonic() + timeout_s
        while True:
            left_ms = max(0, int(1e3 * (deadline - time.monotonic())))
            if not self._subscriber.poll(left_ms):
                return None
            received = decode(self._subscriber.recv_multipart())
            if received is not None:
                return received

    def messages(self, timeout_s: float) -> Iterator[Received]:
        """All messages until none comes for `timeout_s`."""
        while (received := self.receive(timeout_s)) is not None:
            yield received

    @property
    def socket(self) -> zmq.Socket[bytes]:
        """The subscriber, for callers with their own event loop; read with `receive(0)`."""
        return self._subscriber

    def close(self) -> None:
        """Hang up. Safe twice."""
        self._context.destroy(linger=0)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
