"""How the threads of the acquisition process publish to viewers, whoever holds the outer sockets."""

from __future__ import annotations

import threading
from typing import Final

import zmq

from daq_app.acquisition.messages.published import Message

INBOX: Final = "inproc://outgoing"
"""Where the holder of the outer sockets takes what is to be published."""
SEND_QUEUE: Final = 200
"""Messages held for a slow viewer before its oldest are dropped: it costs the recording nothing."""


class Publisher:
    """How other threads publish: each has its own socket to the desk."""

    def __init__(self, context: zmq.Context[zmq.Socket[bytes]]) -> None:
        self._context = context
        self._local = threading.local()

    def send(self, topic: str, message: Message, readings: bytes | None = None) -> None:
        """Publish one message; never blocks, never raises for a slow or absent viewer."""
        self.send_frames([topic.encode(), message.model_dump_json().encode()], readings)

    def send_frames(self, frames: list[bytes], readings: bytes | None = None) -> None:
        """As `send`, of frames that are ready."""
        socket = getattr(self._local, "socket", None)
        if socket is None:
            socket = self._context.socket(zmq.PUSH)
            socket.linger = 0
            socket.sndhwm = SEND_QUEUE
            socket.connect(INBOX)
            self._local.socket = socket
        if readings is not None:
            frames = [*frames, readings]
        try:
            socket.send_multipart(frames, flags=zmq.NOBLOCK, copy=False)
        except zmq.Again:
            return
        except zmq.ZMQError:  # the desk has been closed: the process is ending
            return
