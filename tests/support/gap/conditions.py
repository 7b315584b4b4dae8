"""What the inspection has found in prepared runs."""

from __future__ import annotations

from collections.abc import Sequence

from daq_app.gap.rocking_model.features.rocking_run import RockingRun


def conditions_found(runs: Sequence[RockingRun]) -> set[str]:
    """Keys of all findings of any size in any run."""
    return {finding.key for run in runs for finding in run.findings if finding.value > 0.0}
