"""``python -m daq_app.gap.job OUT RUN…``: a diagnosis as a process of its own, for a window to watch.

On standard output it tells its progress, one JSON object a line: ``{"done", "total", "text"}``, and at
the end ``{"result": path}`` or ``{"refused": reason}``. Beside the JSON it leaves the report as HTML
and PDF. It runs below the priority of everything that records.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import psutil

from daq_app.gap.core import CannotDiagnose, Options
from daq_app.runfile import RunFileError, open_run
from daq_app.runfile.durable import write_whole


def step_back() -> None:
    """Leave the processor to the recording: lower this process's priority."""
    process = psutil.Process()
    process.nice(psutil.BELOW_NORMAL_PRIORITY_CLASS if sys.platform == "win32" else 10)


def diagnose_files(runs: Sequence[Path], out: Path, options: Options) -> None:
    """Diagnose run files with the rig each carries, and write JSON, HTML and PDF.

    Raises `CannotDiagnose`, `RunFileError`, `OSError`.
    """
    for run in runs:
        with open_run(run):
            pass  # a file that cannot be read is told at once, not after the model has been loaded
    # Imported here: whoever only reads a result needs neither the model nor matplotlib.
    from daq_app.gap.report import write_report
    from daq_app.gap.rocking_model.records import load_run
    from daq_app.gap.rocking_model.study import diagnose_runs

    loaded = [load_run(run) for run in runs]
    result = diagnose_runs(loaded, options)
    page = out.with_suffix(".html")
    write_report(result, page, loaded)
    write_whole(out, result.to_json())


def _say(**words: Any) -> None:
    print(json.dumps(words, ensure_ascii=False), flush=True)


def main(arguments: Sequence[str]) -> int:
    """0 for a result, 1 for a refusal."""
    out, *runs = (Path(argument) for argument in arguments)
    step_back()
    # One process: whoever stops it has stopped all of it, and the other cores stay with the recording.
    options = Options(workers=1, progress=lambda done, total, text: _say(done=done, total=total, text=text))
    _say(done=0, total=1, text="reading the runs")
    try:
        diagnose_files(runs, out, options)
    except (CannotDiagnose, RunFileError, OSError) as refusal:
        _say(refused=str(refusal))
        return 1
    _say(result=str(out))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
