"""What a storm of orders needs around the session: a random wall, a driver, a listener, a bad disk."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from daq_app.acquisition.closing.finaliser import Finished
from daq_app.acquisition.messages.published import HealthMessage, StateMessage
from daq_app.config import Rig, Scaling
from daq_app.rocking import RotationGeometry, free_rocking
from daq_app.runfile import RunFileError, finalise
from drivers import Block, DriverError, Opened

RATE_HZ = 4000


@dataclass
class Wall:
    """Readings (n_channels, n) of a random day, and the samples of its releases."""

    readings: NDArray[np.float64]
    releases: list[int]


def random_wall(rig: Rig, rng: np.random.Generator, tests: int) -> Wall:
    """Upright, pulled, held, then released or lowered; so often."""
    alpha, p = rig.specimen.alpha0_rad, rig.specimen.p_rad_s
    pieces, releases, n = [], [], 0
    for _ in range(tests):
        theta0 = rng.choice([-1.0, 1.0]) * alpha * rng.uniform(0.12, 0.42)
        pieces.append(np.zeros(round(RATE_HZ * rng.uniform(2.5, 5.0))))
        pieces.append(np.linspace(0.0, theta0, round(RATE_HZ * rng.uniform(0.8, 2.0))))
        pieces.append(np.full(round(RATE_HZ * rng.uniform(0.2, 6.0)), theta0))
        n = sum(piece.size for piece in pieces)
        if rng.random() < 0.3:
            pieces.append(np.linspace(theta0, 0.0, round(RATE_HZ * rng.uniform(1.5, 3.0))))
        else:
            motion = free_rocking(abs(theta0), 0.7, p, alpha, smallest_peak_rad=1e-5)
            last_s = float(motion.impacts_s[-1])
            after = np.arange(round(RATE_HZ * last_s)) / RATE_HZ
            pieces.append(np.sign(theta0) * motion.at(np.minimum(after, last_s - 1e-9))[0])
            pieces.append(np.zeros(round(RATE_HZ * 2.5)))
            releases.append(n)
    pieces.append(np.zeros(2 * RATE_HZ))
    rotation = np.concatenate(pieces)
    si = rng.normal(size=(len(rig.channels), rotation.size))
    si *= np.array([channel.noise_si for channel in rig.channels])[:, None]
    wires = RotationGeometry.from_rig(rig).wires
    for name, shortening in zip(wires.ids, wires.shortening(rotation), strict=True):
        si[rig.channel_ids.index(name)] += shortening
    for row, channel in enumerate(rig.channels):
        if channel.family == "tiltmeter" and channel.axis == "x":
            si[row] += rotation
    return Wall(Scaling.of(rig.channels).to_readings(si), releases)


class WallDriver:
    """Plays a wall up to the sample that is allowed."""

    def __init__(self, wall: Wall) -> None:
        self._wall = wall
        self.allowed = 0
        self._more = threading.Condition()
        self._next = 0
        self._read_samples = 400

    def allow(self, sample: int) -> None:
        """Let the wall be read up to this sample."""
        with self._more:
            self.allowed = sample
            self._more.notify_all()

    def open(self, plan: Any) -> Opened:
        self._read_samples = plan.read_samples
        return Opened(float(RATE_HZ), dict.fromkeys(plan.channel_ids, (-10.0, 10.0)), 80_000, (), "a storm")

    def start(self) -> None:
        self._next = 0

    def read(self, timeout_s: float, n_samples: int | None = None) -> Block:
        stop = self._next + (n_samples or self._read_samples)
        with self._more:
            there = self._more.wait_for(lambda: stop <= self.allowed, timeout_s)
        if not there:
            raise DriverError("No samples", advice="Wait", retryable=True)
        block = Block(self._next, np.ascontiguousarray(self._wall.readings[:, self._next : stop]), 0, 0)
        self._next = stop
        return block

    def recover(self) -> str:
        return ""

    def stop(self) -> None:
        pass

    def close(self) -> None:
        pass


class Listener:
    """Stands where the publisher stands, and keeps what was said."""

    def __init__(self) -> None:
        self.states: list[StateMessage] = []
        self.health: HealthMessage | None = None
        self._said = threading.Condition()

    def send(self, topic: str, message: Any, readings: bytes | None = None) -> None:
        del topic, readings
        if isinstance(message, StateMessage):
            self.states.append(message)
        elif isinstance(message, HealthMessage):
            self.health = message
        with self._said:
            self._said.notify_all()

    def until(self, condition: Callable[[], bool]) -> None:
        """Wait until something holds, looking again whenever something is said; at most a minute."""
        deadline = time.monotonic() + 60.0
        with self._said:
            while not condition() and time.monotonic() < deadline:
                self._said.wait(0.02)


class QuickFinaliser:
    """Makes run files at once and without an analysis: what they hold is what is judged here."""

    def warm(self) -> None:
        """Nothing to load."""

    def submit(self, job: dict[str, str], then: Callable[[Finished], None] | None = None) -> Future[Finished]:
        done: Future[Finished] = Future()
        if job["job"] == "finalise":
            done.set_result(self._finalised(Path(job["journal"]), Path(job["out"])))
        else:
            done.set_result(Finished(True, ""))
        if then is not None:
            then(done.result())
        return done

    @staticmethod
    def _finalised(journal: Path, out: Path) -> Finished:
        try:
            path = finalise(journal, out, None, keep_journal=False)
        except (OSError, RunFileError) as error:
            return Finished(False, f"{out.name} could not be made: {error}")
        return Finished(True, f"Saved as {path.name}", str(path))


class BadDisk:
    """Makes writes fail while `trouble` is set; files of other programs are not touched."""

    def __init__(self) -> None:
        self.trouble = 0

    @contextmanager
    def in_place(self) -> Iterator[None]:
        real = os.write

        def write(fd: int, data: Any) -> int:
            if self.trouble:
                raise OSError(self.trouble, os.strerror(self.trouble))
            return real(fd, data)

        os.write = write  # type: ignore[assignment]
        try:
            yield
        finally:
            os.write = real
