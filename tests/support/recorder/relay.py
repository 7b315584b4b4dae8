"""A relay before the simulated device server: what is done to a connection is its subclasses' business."""

from __future__ import annotations

import contextlib
import socket
import threading


class Relay:
    """Takes connections on a port of its own and passes on what they say."""

    def __init__(self, port: int) -> None:
        self._behind = port
        self.closing = threading.Event()
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listening.getsockname()[1]
        self._open: list[socket.socket] = [self._listening]
        self._thread = threading.Thread(target=self._accept, daemon=True)
        self._thread.start()

    def let_in(self, plain: socket.socket) -> socket.socket | None:
        """What is spoken with from then on; None turns the connection away."""
        return plain

    def _accept(self) -> None:
        with contextlib.suppress(OSError):  # closed
            while True:
                plain, _ = self._listening.accept()
                self._open.append(plain)
                threading.Thread(target=self._serve, args=(plain,), daemon=True).start()

    def _serve(self, plain: socket.socket) -> None:
        front = self.let_in(plain)
        if front is None:
            plain.close()
            return
        back = socket.create_connection(("127.0.0.1", self._behind))
        self._open += [front, back]
        threading.Thread(target=self._pass_on, args=(back, front), daemon=True).start()
        self._pass_on(front, back)

    @staticmethod
    def _pass_on(source: socket.socket, target: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(65536):
                target.sendall(data)
        with contextlib.suppress(OSError):
            target.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        self.closing.set()
        for each in self._open:
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()
        self._thread.join()
