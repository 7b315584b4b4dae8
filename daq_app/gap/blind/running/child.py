"""The process that diagnoses: ``python -m daq_app.gap.blind.running.child DIAGNOSER``, case by case.

On standard input it is told one case a line, as JSON ``{"case": folder, "out": file}``, and on standard
output it answers each with ``{"failure": words}``, empty where the result is in the file. What the
diagnosis itself prints goes to standard error. It stays for many cases because loading the program takes
as long as a diagnosis; of a case that it has done, nothing is left for it to read.
"""

from __future__ import annotations

import gc
import json
import os
import sys
import traceback
from pathlib import Path

from daq_app.gap.blind.running.diagnosers import Diagnoser, DiagnoserError, load_diagnoser

_WORDS_KEPT = 4000


def diagnose(diagnoser: Diagnoser, case: Path, out: Path) -> str:
    """Diagnose one case into `out`; empty, or why there is no result."""
    home = Path.cwd()
    os.chdir(case.parent)
    try:
        result = diagnoser(case)
        out.write_text(json.dumps(result, ensure_ascii=False, allow_nan=False), encoding="utf-8")
    except DiagnoserError as error:
        return str(error)
    except Exception:
        # Any program may be put to the test; whatever it breaks with is its answer to this case.
        return traceback.format_exc()[-_WORDS_KEPT:].strip()
    finally:
        os.chdir(home)  # no folder can be deleted where a process stands in it
        gc.collect()
    return ""


def main(arguments: list[str]) -> int:
    """Serve until standard input ends; 1 where the diagnoser cannot be loaded."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    try:
        diagnoser = load_diagnoser(arguments[0])
    except DiagnoserError as error:
        print(error, file=sys.stderr)
        return 1
    for line in sys.stdin:
        told = json.loads(line)
        failure = diagnose(diagnoser, Path(told["case"]), Path(told["out"]))
        answers.write(json.dumps({"failure": failure}) + "\n")
        answers.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
