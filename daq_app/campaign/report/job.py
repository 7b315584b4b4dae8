"""``python -m daq_app.campaign.report.job CAMPAIGN.json FOLDER OUT``: the report, made beside a window.

The campaign comes as JSON on the command line. The process has low priority: samples come first.
"""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import psutil

from daq_app.campaign.plan import Campaign
from daq_app.campaign.report.collect import Collected, collect
from daq_app.campaign.report.write import WrittenReport, write_report
from daq_app.campaign.status import CampaignStatus
from daq_app.config import ConfigError
from daq_app.runfile import RunFileError


def write_collected(
    campaign: Campaign, folder: Path, found: Collected, out: Path, *, at_once: bool
) -> WrittenReport:
    """Write the report of what was collected in `folder`; raises `ValueError` where nothing was analysed."""
    made = time.strftime("%Y-%m-%d %H:%M", time.localtime())
    footer = f"Made {made} from {len(found.recorded)} recorded tests in {folder.name}. {found.origin}"
    status = CampaignStatus(campaign, found.recorded)
    return write_report(out, campaign.name, status, found.tests, footer, found.failures, at_once=at_once)


def main(argv: Sequence[str] | None = None) -> int:
    """0 when the report is written; 1 with a sentence on standard output when it is not."""
    campaign, folder, out = list(sys.argv[1:] if argv is None else argv)
    with contextlib.suppress(psutil.Error, OSError, AttributeError):
        psutil.Process().nice(psutil.BELOW_NORMAL_PRIORITY_CLASS if sys.platform == "win32" else 10)
    try:
        collected = collect(Path(folder), workers=1)
        plan = Campaign.model_validate_json(campaign)
        write_collected(plan, Path(folder), collected, Path(out), at_once=False)
    except (ConfigError, RunFileError, OSError, ValueError) as error:
        print(error)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
