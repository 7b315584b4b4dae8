"""One case on disk: run files that any command of this program reads, the rig file, and the seal.

Nothing in these files tells what was hidden: the header has no truth, no notes, no seed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from daq_app.config import Rig, plan_tasks
from daq_app.gap.blind.layout import RIG_FILE
from daq_app.gap.blind.world.campaign import MadeRun, World
from daq_app.runfile import Event, Gap, RunHeader, plan_to_dict
from daq_app.runfile.hdf5.write import write_run
from daq_app.runfile.source import Provenance


@dataclass(frozen=True, slots=True)
class MemoryRun:
    """A whole run in memory: satisfies `daq_app.runfile.source.RunSource`."""

    header: RunHeader
    values: NDArray[np.float64]
    first_sample: int = 0
    events: tuple[Event, ...] = ()
    gaps: tuple[Gap, ...] = ()

    @property
    def n_samples(self) -> int:
        return int(self.values.shape[1])

    def windows(self, size: int) -> Iterator[tuple[int, NDArray[np.float64]]]:
        for first in range(0, self.n_samples, size):
            yield first, np.ascontiguousarray(self.values[:, first : first + size])


def write_case(folder: Path, case: str, world: World, rig_text: str, start_utc_ns: int) -> list[MadeRun]:
    """Make the runs of a case and write them as ``TEST.h5`` beside the rig file; returns how they went.

    `start_utc_ns`: wall clock of the first run. The readings are dropped from what is returned.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / RIG_FILE).write_text(rig_text, encoding="utf-8")
    made = []
    for run in world.make():
        header = _header(case, run, world, rig_text, start_utc_ns)
        path = folder / f"{run.plan.test}.h5"
        part = path.with_suffix(".tmp")
        # Not read back as a recording is: the seal holds what was written, and it can be made again.
        write_run(part, MemoryRun(header, run.readings), Provenance(closed=True))
        part.replace(path)
        made.append(MadeRun(run.plan, np.empty((0, 0)), run.motion))
    return made


def _header(case: str, run: MadeRun, world: World, rig_text: str, start_utc_ns: int) -> RunHeader:
    rig: Rig = world.rig
    return RunHeader(
        run_id=f"{case}-{run.plan.test}",
        test=run.plan.test,
        specimen=rig.specimen.name,
        rig_name=rig.name,
        rig_text=rig_text,
        channel_ids=rig.channel_ids,
        reading_units=tuple(channel.reading_unit for channel in rig.channels),
        rate_hz=rig.acquisition.rate_hz,
        plan=plan_to_dict(plan_tasks(rig)),
        tare=dict(world.calibration.tare_reading),
        start_utc_ns=start_utc_ns + round(run.plan.campaign_s * 1e9),
    )
