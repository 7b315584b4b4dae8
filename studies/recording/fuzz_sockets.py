"""Throws rubbish at every socket of a recording acquisition process, for as long as it is told.

    python -m studies.recording.fuzz_sockets --minutes 10 [--seed 1]

Not collected by pytest (it takes minutes). A real acquisition process records from a simulated device server
on which every sample proves its place; meanwhile its two sockets get torn handshakes, wild bytes and changed
messages of the ZeroMQ protocol, changed commands with and without the right token, and floods. A hostile
publisher feeds a viewer. Counted as found: the process dies, a legitimate viewer is not answered, a command
without the right is obeyed, a sample is lost or wrong, memory grows by more than 200 MB, the viewer raises.
"""

from __future__ import annotations

import argparse
import json
import random
import socket
import sys
import tempfile
import threading
import time
from pathlib import Path
from urllib.parse import urlsplit

import psutil
import zmq

from daq_app.acquisition import AcquisitionClient, AcquisitionProcess
from daq_app.acquisition.messages.published import HealthMessage, Message, State, StateMessage
from daq_app.acquisition.process.simulated import SimulatedServer
from daq_app.acquisition.viewers.client import decode
from daq_app.config import load_rig
from daq_app.runfile import open_run, verify
from tests.support.recorder.desk_bench import CALM
from tests.support.recorder.marked_check import check_marked

RIG = Path(__file__).parents[2] / "configs" / "fr1.toml"
GREETING = b"\xff\x00\x00\x00\x00\x00\x00\x00\x01\x7f\x03\x00NULL" + b"\x00" * 48
READY = b"\x04\x19\x05READY\x0bSocket-Type\x00\x00\x00\x03REQ"
COMMANDS = ("hello", "preview", "tare", "arm", "abort", "stop", "marker", "note", "shutdown", "x" * 200)
MOST_MEMORY = 200 * 2**20


def changed(data: bytes, rng: random.Random) -> bytes:
    """Some bytes flipped, doubled, cut or made to mean large sizes."""
    out = bytearray(data)
    for _ in range(rng.randint(0, 5)):
        at = rng.randrange(len(out) + 1)
        match rng.randrange(5):
            case 0 if out:
                out[at % len(out)] ^= 1 << rng.randrange(8)
            case 1:
                out[at:at] = rng.randbytes(rng.randint(1, 40))
            case 2:
                del out[at : at + rng.randint(1, 30)]
            case 3:
                out[at : at + 8] = rng.choice((2**63 - 1, 2**64 - 1, 2**31, 0)).to_bytes(8, "big")
            case 4:
                out += out[:at]
    return bytes(out[:100_000])


def command(rng: random.Random, token: str) -> bytes:
    """A command that looks right and should be refused or be harmless."""
    strange: tuple[object, ...] = (
        None,
        1e308,
        -1,
        "",
        "\x00",
        "é" * 5000,
        [],
        {},
        [[]] * 50,
        True,
        2**70,
        "../../etc/passwd",
    )
    name = rng.choice(COMMANDS)
    arguments = {rng.choice(("test", "notes", "text", "seconds", "force", "")): rng.choice(strange)}
    # With the right token only what does not end the recording: the others are the owner's to give.
    right = name in ("marker", "note", "tare", "preview") and rng.random() < 0.5
    document = {"name": name, "arguments": arguments, "token": token if right else rng.choice(strange)}
    if rng.random() < 0.2:
        document[rng.choice(("extra", "name", "token"))] = rng.choice(strange)
    return json.dumps(document).encode()


class Attack:
    """One kind of rubbish at a time."""

    def __init__(self, client: AcquisitionClient, address: str, token: str, seed: int) -> None:
        self._endpoints = (address, str(client.about["publisher"]))
        self._token = token
        self._rng = random.Random(seed)
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self.count = 0

    def go(self) -> None:
        kind = self._rng.randrange(4)
        (self._bytes, self._handshake, self._message, self._flood)[kind]()

    def _raw(self, data: bytes, pieces: int = 1) -> None:
        self.count += 1
        parts = urlsplit(self._rng.choice(self._endpoints))
        try:
            with socket.create_connection((parts.hostname or "", parts.port or 0), timeout=2.0) as line:
                size = max(1, len(data) // pieces)
                for start in range(0, len(data), size):
                    line.sendall(data[start : start + size])
        except OSError:
            return  # hung up on us: as it should

    def _bytes(self) -> None:
        self._raw(self._rng.randbytes(self._rng.randint(0, 3000)))

    def _handshake(self) -> None:
        body = command(self._rng, self._token)
        frames = b"\x01\x00" + bytes((0, len(body) % 256)) + body
        data = changed(GREETING, self._rng) if self._rng.random() < 0.5 else GREETING
        tail = changed(READY + frames, self._rng)
        self._raw(data + tail, self._rng.randint(1, 5))

    def _message(self) -> None:
        sender = self._context.socket(self._rng.choice((zmq.DEALER, zmq.REQ)))
        sender.linger = 200
        sender.connect(self._endpoints[0])
        for _ in range(1 if sender.type == zmq.REQ else self._rng.randint(1, 20)):
            self.count += 1
            body = command(self._rng, self._token)
            frames = [body if self._rng.random() < 0.6 else changed(body, self._rng)]
            if sender.type == zmq.DEALER:
                frames = [self._rng.randbytes(3) for _ in range(self._rng.randrange(0, 10))] + [b"", *frames]
            try:
                sender.send_multipart(frames, flags=zmq.NOBLOCK)
            except zmq.ZMQError:
                break
        sender.close()

    def _flood(self) -> None:
        sender = self._context.socket(zmq.DEALER)
        sender.linger, sender.sndhwm = 0, 50
        sender.connect(self._endpoints[0])
        for _ in range(200):
            self.count += 1
            try:
                sender.send_multipart(
                    [b"", b"x" * self._rng.choice((10, 60_000, 200_000))], flags=zmq.NOBLOCK
                )
            except zmq.Again:
                break
        sender.close()

    def close(self) -> None:
        self._context.destroy(linger=0)


def hostile_publisher(seed: int, ended: threading.Event, found: list[str]) -> None:
    """What a viewer makes of messages from somebody else."""
    rng = random.Random(seed)
    topics = (b"state", b"block", b"motion", b"estimate", b"health", b"event", b"", b"\xff")
    bodies = [CALM.model_dump_json().encode(), StateMessage(state=State.ARMED).model_dump_json().encode()]
    bodies.append(b'{"first_sample":0,"n_samples":3,"n_channels":2,"rate_hz":4000.0,"overloaded":[]}')
    while not ended.is_set():
        frames = [
            rng.choice(topics),
            changed(rng.choice(bodies), rng),
            rng.randbytes(rng.choice((0, 24, 25))),
        ]
        try:
            decode(frames[: rng.randint(0, 3)])
        except Exception as error:
            found.append(f"a viewer raised {type(error).__name__}: {error} for {frames!r}")
        ended.wait(0.001)


def fuzz(minutes: float, seed: int) -> tuple[int, list[str]]:
    """Record, attack, look after the legitimate viewer; messages sent, and what was found."""
    found: list[str] = []
    ended = threading.Event()
    with (
        tempfile.TemporaryDirectory(prefix="fuzz-") as name,
        SimulatedServer(RIG, ["--wall", "marked"]) as server,
    ):
        options = ["--rig", str(RIG), "--out", name, "--connection", server.connection]
        process = AcquisitionProcess(options)
        client = process.client(("state", "health"))
        wait_for(client, lambda m: isinstance(m, StateMessage) and m.state is State.PREVIEWING)
        assert client.request("arm", test="FUZZ-L3-1").ok
        watched = psutil.Process(process.process.pid)
        before = watched.memory_info().rss
        viewer = threading.Thread(target=hostile_publisher, args=(seed, ended, found))
        viewer.start()
        attack = Attack(client, process.address, process.token, seed)
        until = time.monotonic() + 60.0 * minutes
        next_look = 0.0
        while time.monotonic() < until and process.process.poll() is None and len(found) < 20:
            attack.go()
            if time.monotonic() > next_look:
                next_look = time.monotonic() + 2.0
                found += look(client, process, watched.memory_info().rss - before)
        ended.set()
        viewer.join()
        attack.close()
        if process.process.poll() is not None:
            return attack.count, [*found, f"the process died: {process.said}"]
        client.request("stop", timeout_s=60.0)
        saved = wait_for(client, lambda m: isinstance(m, StateMessage) and m.state is State.SAVED, 1800.0)
        assert isinstance(saved, StateMessage)
        found += judge(Path(saved.run_path))
        client.request("shutdown", timeout_s=60.0, force=1.0)
        client.close()
        process.wait(60.0)
    return attack.count, found


def wait_for(client: AcquisitionClient, right: object, limit_s: float = 120.0) -> Message:
    deadline = time.monotonic() + limit_s
    while time.monotonic() < deadline:
        received = client.receive(0.5)
        if received is not None and right(received.message):  # type: ignore[operator]
            return received.message
    raise RuntimeError("not heard in time")


def look(client: AcquisitionClient, process: AcquisitionProcess, grown: int) -> list[str]:
    """Is the owner still served, and is the recording going on?"""
    problems = []
    try:
        if not client.request("marker", timeout_s=20.0, text="still here").ok:
            problems.append("the owner was refused")
    except Exception as error:
        problems.append(f"the owner was not answered: {error}")
    newest = None
    while (received := client.receive(0.0)) is not None:
        newest = received.message if isinstance(received.message, HealthMessage) else newest
    if newest is not None and not newest.recording:
        problems.append("the recording was ended by somebody without the right")
    if grown > MOST_MEMORY:
        problems.append(f"memory grew by {grown / 2**20:.0f} MB")
    return problems


def judge(path: Path) -> list[str]:
    """Every sample there and right?"""
    report = verify(path)
    problems = list(report.problems)
    marks = check_marked(path, load_rig(RIG), None)
    with open_run(path) as run:
        # A machine that stood still for longer than the device's buffer says so itself.
        asleep = any(event.data.get("alarm") == "asleep" for event in run.events)
    if not marks.ok or (marks.missing and not asleep):
        problems.append(f"{marks.unexplained} wrong samples, {marks.missing} missing")
    return problems


def main() -> int:
    """0 if nothing was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    sent, found = fuzz(options.minutes, options.seed)
    print(f"sockets: {sent} attacks in {options.minutes:g} min, {len(found)} findings", flush=True)
    for line in found[:20]:
        print(f"  {line}", flush=True)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
