"""Run by a Windows Python: ``python.exe windows_probe.py REPOSITORY FOLDER``; prints what it saw as JSON.

Uses the standard library and the modules of this project that need nothing else.
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

CHILD = (
    "import os, stat, sys, ssl, sqlite3, asyncio, decimal\n"
    "print(stat.S_ISFIFO(os.fstat(0).st_mode), sys.stdout.encoding, 'θ', flush=True)\n"
    "import threading\n"
    "threading.Event().wait()\n"
)


def main(repository: str, folder: str) -> None:
    sys.path.insert(0, repository)
    from daq_app.guarded import apart, program
    from daq_app.streams import CHILD_ENVIRONMENT, use_utf8

    # The package of the run files needs HDF5; this module of it does not.
    found = importlib.util.spec_from_file_location("durable", f"{repository}/daq_app/runfile/durable.py")
    assert found is not None and found.loader is not None
    durable = importlib.util.module_from_spec(found)
    found.loader.exec_module(durable)

    use_utf8()
    page = Path(folder) / "report.pdf"
    page.write_text("old", encoding="utf-8")
    with page.open("rb"):
        other = durable.write_whole(page, "new", other_name=True).name
        try:
            durable.write_whole(page, "new")
            refused = False
        except PermissionError:
            refused = True
    Path(folder, "probe_child.py").write_text(CHILD, encoding="utf-8")
    boot = f"import sys; sys.path[:0] = {[repository, folder]!r}; sys.argv = ['', 'probe_child']\n"
    child = subprocess.Popen(
        [program(), "-u", "-c", boot + "from daq_app.guarded import main; main()"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        encoding="utf-8",
        env={**os.environ, **CHILD_ENVIRONMENT},
        **apart(),
    )
    assert child.stdin is not None and child.stdout is not None
    said = child.stdout.readline().split()
    child.stdin.close()
    print(json.dumps({"other": other, "refused": refused, "child": said, "ended": child.wait(60)}))


if __name__ == "__main__":
    main(*sys.argv[1:])
