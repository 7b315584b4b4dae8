"""Spread the cases over machines with dask.distributed (optional extra ``scale``)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from daq_app.gap.blind.layout import RESULTS
from daq_app.gap.blind.running.runner import Outcome, diagnose_apart, pending, save_outcome
from daq_app.machines import RETRIES, scheduler_client


def run_on_scheduler(
    folder: Path, diagnoser: str, address: str, timeout_s: float, kept: str = RESULTS
) -> Iterator[Outcome]:
    """As `runner.run_pending`, on the workers of the scheduler at `address` (``tcp://HOST:PORT``).

    Every worker must see the folder under the same path and have this program installed. Outcomes
    come back to this process, which alone writes them. Raises `SchedulerMissing`.
    """
    with scheduler_client(address) as client:
        from distributed import as_completed

        cases = [case.resolve() for case in pending(folder, diagnoser, kept)]
        jobs = client.map(
            diagnose_apart, cases, diagnoser=diagnoser, timeout_s=timeout_s, pure=False, retries=RETRIES
        )
        for job in as_completed(jobs):
            outcome: Outcome = job.result()
            save_outcome(folder, outcome, kept)
            yield outcome
