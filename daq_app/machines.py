"""Work on many machines: the jobs of `run_all` on the workers of a dask scheduler (extra ``scale``).

Every worker must have this program installed and see files under the paths of the machine that asks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Final, TypeVar

_Job = TypeVar("_Job")
_Answer = TypeVar("_Answer")

ANSWER_S: Final = 20.0
"""Time within which a scheduler must answer, s. Assumed."""
RETRIES: Final = 2
"""How often a job goes to another worker when its own has died."""


class SchedulerMissing(Exception):
    """dask.distributed is not installed, or no scheduler answers."""


@contextmanager
def scheduler_client(address: str) -> Iterator[Any]:
    """A `distributed.Client` at `address` (``tcp://HOST:PORT``). Raises `SchedulerMissing`."""
    try:
        from distributed import Client
    except ImportError:
        raise SchedulerMissing(
            "dask.distributed is not installed: python -m pip install 'rocking-test-recorder[scale]'"
        ) from None
    try:
        client = Client(address, timeout=ANSWER_S)
    except (OSError, ValueError) as error:
        raise SchedulerMissing(f"no scheduler answers at {address} ({error})") from None
    with client:
        yield client


def run_on_machines(
    work: Callable[[_Job], _Answer],
    jobs: Sequence[_Job],
    address: str,
    done: Callable[[int, _Job], None] | None = None,
) -> list[_Answer]:
    """As `workers.run_all`: answers in the order of the jobs, the first exception of a job ends it all."""
    with scheduler_client(address) as client:
        from distributed import as_completed

        futures = client.map(work, jobs, pure=False, retries=RETRIES)
        places = {future.key: index for index, future in enumerate(futures)}
        answers: dict[int, _Answer] = {}
        try:
            for future in as_completed(futures):
                index = places[future.key]
                answers[index] = future.result()
                if done:
                    done(len(answers), jobs[index])
        except BaseException:
            client.cancel(futures)
            raise
    return [answers[index] for index in range(len(jobs))]
