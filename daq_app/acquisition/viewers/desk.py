"""The process's counter: publishes to viewers and takes their requests, on the main thread.

Two sockets: PUB for everything that is shown, ROUTER for commands (a REQ or DEALER speaks to it).
Whatever arrives on them, however broken, ends in a refusal or in silence, never in an exception.
"""

from __future__ import annotations

import hmac
import json
import time
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

import zmq
from pydantic import ValidationError

from daq_app.acquisition.messages.items import RequestRefused
from daq_app.acquisition.messages.published import Command, Reply
from daq_app.acquisition.messages.publisher import INBOX, SEND_QUEUE, Publisher
from daq_app.acquisition.viewers.admission import ServerKeys, secure_server
from daq_app.acquisition.viewers.curve import KeyFileError, is_loopback

_MAX_REQUEST_BYTES: Final = 64 * 1024
_KEYS_EVERY_S: Final = 0.5
_REOPENING_S: Final = 5.0
_REMEMBERED: Final = 256
"""Requests whose answers are kept for viewers that ask again: a broken connection took the first one."""

Answer = Reply | Future[Reply]
Handler = Callable[[Command], Answer]


@dataclass(frozen=True, slots=True)
class Addresses:
    """Where viewers find us."""

    commands: str
    publisher: str


class DeskError(Exception):
    """The sockets cannot be opened as asked: why, and what to do."""


class Desk:
    """Opens the sockets on construction (raises `DeskError`); `serve` runs until `stop`."""

    def __init__(self, bind: str, handle: Handler, token: str, keys: Path | None = None) -> None:
        self._handle = handle
        self._token = token
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._keys: ServerKeys | None = None
        self._stopping = False
        self._waiting: list[tuple[list[bytes], Future[Reply]]] = []
        self._answered: OrderedDict[str, Answer] = OrderedDict()
        try:
            # The library takes a port above 65535 modulo 65536; this raises ValueError.
            if urlsplit(bind).scheme != "tcp" or urlsplit(bind).port is None:
                raise DeskError(f"Cannot listen on {bind}: write it as tcp://127.0.0.1:0 (0: any free port)")
            if not is_loopback(bind) and keys is None:
                raise DeskError(
                    f"{bind} can be reached from other machines, and no keys were given. Bind to "
                    "tcp://127.0.0.1:0, or give --keys FOLDER (made with `daq-app keys recorder FOLDER`)"
                )
            if keys is not None:
                self._keys = secure_server(self._context, keys)
            self._commands = self._bound(zmq.ROUTER, bind)
            host = urlsplit(bind).hostname or "127.0.0.1"
            self._pub = self._bound(zmq.PUB, f"tcp://{f'[{host}]' if ':' in host else host}:0")
        except (KeyFileError, zmq.ZMQError, ValueError) as error:
            self._context.destroy(linger=0)
            raise DeskError(f"Cannot listen on {bind}: {error}") from error
        self._inbox = self._context.socket(zmq.PULL)
        self._inbox.rcvhwm = 10 * SEND_QUEUE
        self._inbox.bind(INBOX)
        self.publisher = Publisher(self._context)
        self.addresses = Addresses(_endpoint(self._commands), _endpoint(self._pub))

    def _bound(self, kind: int, endpoint: str) -> zmq.Socket[bytes]:
        socket = self._context.socket(kind)
        socket.linger = 500
        socket.maxmsgsize = _MAX_REQUEST_BYTES
        socket.sndhwm = SEND_QUEUE
        socket.rcvhwm = 100
        if self._keys is not None:
            self._keys.apply(socket)
        try:
            socket.bind(endpoint)
        except zmq.ZMQError:
            socket.close(linger=0)
            raise
        return socket

    def stop(self) -> None:
        """Make `serve` return after the request that is being handled."""
        self._stopping = True

    def serve(self, tick: Callable[[], None], tick_s: float) -> None:
        """Forward, answer and call `tick` every `tick_s` until `stop`."""
        poller = zmq.Poller()
        poller.register(self._commands, zmq.POLLIN)
        poller.register(self._inbox, zmq.POLLIN)
        ticker = _Ticker(tick, tick_s)
        keys = _Ticker(lambda: self._shut_out_removed(poller), _KEYS_EVERY_S)
        while not self._stopping:
            # Replies of other threads are looked for more often while some are owed.
            wait_s = min(ticker.due_in_s(), 0.01 if self._waiting else tick_s)
            ready = dict(poller.poll(int(1e3 * wait_s) + 1))
            if self._inbox in ready:
                self._forward()
            if self._commands in ready:
                self._take_request()
            self._send_replies()
            ticker.run_if_due()
            keys.run_if_due()
        self._forward()
        self._send_replies()

    def _shut_out_removed(self, poller: zmq.Poller) -> None:
        """A viewer whose key was taken away is cut off: everybody has to show a key anew.

        Keys are asked for when a viewer connects only, so the sockets are closed and opened again; viewers
        that are still admitted come back by themselves within a moment.
        """
        if self._keys is None or not self._keys.admitted.somebody_was_removed():
            return
        poller.unregister(self._commands)
        self._commands = self._reopened(self._commands, zmq.ROUTER, self.addresses.commands)
        self._pub = self._reopened(self._pub, zmq.PUB, self.addresses.publisher)
        poller.register(self._commands, zmq.POLLIN)

    def _reopened(self, socket: zmq.Socket[bytes], kind: int, endpoint: str) -> zmq.Socket[bytes]:
        socket.close(linger=0)
        until_s = time.monotonic() + _REOPENING_S
        while True:
            try:
                return self._bound(kind, endpoint)
            except zmq.ZMQError:  # the library closes a socket on a thread of its own
                if time.monotonic() > until_s:
                    raise
                time.sleep(0.01)

    def _forward(self) -> None:
        while True:
            try:
                frames = self._inbox.recv_multipart(flags=zmq.NOBLOCK, copy=False)
            except zmq.Again:
                return
            self._pub.send_multipart(frames, copy=False)

    def _take_request(self) -> None:
        try:
            frames = self._commands.recv_multipart(flags=zmq.NOBLOCK)
        except zmq.Again:
            return
        # [identity, (request id of a REQ …), empty, body]; a DEALER may leave out the empty frame.
        if len(frames) < 2 or len(frames) > 8:
            return
        envelope, body = frames[:-1], frames[-1]
        answer = self._answer(body)
        if isinstance(answer, Reply):
            self._reply(envelope, answer)
        else:
            self._waiting.append((envelope, answer))

    def _answer(self, body: bytes) -> Answer:
        try:
            command = Command.model_validate_json(body)
        except (ValidationError, ValueError, RecursionError):
            return Reply(ok=False, text="That is no command. See daq_app/acquisition/messages/published.py")
        if command.name != "hello" and not hmac.compare_digest(command.token.encode(), self._token.encode()):
            return Reply(ok=False, text="This viewer may watch, not command: its token is missing or wrong")
        if command.request in self._answered:
            return self._answered[command.request]
        answer = self._carry_out(command)
        if command.request:
            self._answered[command.request] = answer
            if len(self._answered) > _REMEMBERED:
                self._answered.popitem(last=False)
        return answer

    def _carry_out(self, command: Command) -> Answer:
        try:
            return self._handle(command)
        except RequestRefused as error:
            return Reply(ok=False, text=str(error))
        except Exception as error:
            # A fault of ours in a request must not end the recording that is under way.
            return Reply(ok=False, text=f"The request failed ({type(error).__name__}: {error})")

    def _send_replies(self) -> None:
        owed = []
        for envelope, future in self._waiting:
            if not future.done():
                owed.append((envelope, future))
                continue
            error = future.exception()
            self._reply(envelope, future.result() if error is None else Reply(ok=False, text=str(error)))
        self._waiting = owed

    def _reply(self, envelope: list[bytes], reply: Reply) -> None:
        try:
            body = reply.model_dump_json().encode()
        except ValueError as error:
            body = json.dumps({"ok": False, "text": f"The answer could not be written: {error}"}).encode()
        try:
            self._commands.send_multipart([*envelope, body], flags=zmq.NOBLOCK)
        except zmq.ZMQError:  # the asker has gone
            return

    def close(self) -> None:
        """Close the sockets. Safe twice."""
        if self._keys is not None:
            self._keys.close()
            self._keys = None
        self._context.destroy(linger=500)


def _endpoint(socket: zmq.Socket[bytes]) -> str:
    return str(socket.getsockopt_string(zmq.LAST_ENDPOINT)).rstrip("\0")


class _Ticker:
    def __init__(self, call: Callable[[], Any], every_s: float) -> None:
        self._clock = time.monotonic
        self._call = call
        self._every_s = every_s
        self._next_s = self._clock()

    def due_in_s(self) -> float:
        return max(0.0, self._next_s - self._clock())

    def run_if_due(self) -> None:
        if self._clock() >= self._next_s:
            # After a pause of the machine, one tick, not all that were missed.
            self._next_s = self._clock() + self._every_s
            self._call()
