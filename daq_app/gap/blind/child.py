"""The process of one diagnosis: ``python -m daq_app.gap.blind.child DIAGNOSER CASE OUT``."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from daq_app.gap.blind.diagnosers import DiagnoserError, load_diagnoser


def main(arguments: list[str]) -> int:
    """Diagnose CASE and write the result to OUT; 0 when there is one, 1 otherwise."""
    name, case, out = arguments
    try:
        result = load_diagnoser(name)(Path(case))
    except DiagnoserError as error:
        print(error, file=sys.stderr)
        return 1
    Path(out).write_text(json.dumps(result, ensure_ascii=False, allow_nan=False), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
