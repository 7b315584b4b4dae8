"""The header of a run: everything that is known when the test is armed."""

from __future__ import annotations

import datetime as dt
from dataclasses import asdict
from typing import Any

from daq_app.acquisition.course.tare import Tare
from daq_app.config.planning.plan import TaskPlan
from daq_app.config.rig import Rig
from daq_app.runfile import RunHeader, TestPlan, host_name, plan_to_dict, software_versions
from drivers import Opened


def make_header(
    rig: Rig,
    rig_text: str,
    plan: TaskPlan,
    opened: Opened,
    tare: Tare,
    *,
    test: str,
    notes: str = "",
    truth: dict[str, Any] | None = None,
    test_plan: TestPlan | None = None,
) -> RunHeader:
    """Header of the run that begins now. `run_id` is the test's name and the time, and names the files."""
    now = dt.datetime.now(dt.UTC)
    return RunHeader(
        run_id=f"{test}_{now:%Y%m%dT%H%M%S}.{now.microsecond // 1000:03d}Z".replace(".", "-"),
        test=test,
        specimen=rig.specimen.name,
        rig_name=rig.name,
        rig_text=rig_text,
        product_texts=rig.hardware.product_texts,
        channel_ids=rig.channel_ids,
        reading_units=tuple(channel.reading_unit for channel in rig.channels),
        rate_hz=opened.rate_hz,
        plan=plan_to_dict(plan),
        opened=asdict(opened),
        tare=tare.readings,
        tare_record=tare.record,
        start_utc_ns=int(now.timestamp() * 1e9),
        host=host_name(),
        versions=software_versions(),
        notes=notes,
        truth=truth,
        test_plan=test_plan,
    )
