"""``python installer/build.py``: one folder with the whole program and a shortcut to its window.

The folder needs no Python and can be copied to any machine of the same system. Run it in an environment that
holds the program with its extra ``all``, and PyInstaller.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

NAME = "Rocking-test recorder"
_SHORTCUT = (
    "$link = (New-Object -ComObject WScript.Shell).CreateShortcut($env:SHORTCUT);"
    "$link.TargetPath = $env:TARGET; $link.WorkingDirectory = [Environment]::GetFolderPath('MyDocuments');"
    "$link.Save()"
)


def build(here: Path, out: Path) -> Path:
    """Build the folder under `out`. Raises `subprocess.CalledProcessError`."""
    options = ["--noconfirm", "--log-level", "WARN", "--distpath", str(out), "--workpath", str(out / "work")]
    subprocess.run([sys.executable, "-m", "PyInstaller", *options, str(here / "daq-app.spec")], check=True)
    return out / "daq-app"


def add_shortcut(folder: Path) -> Path:
    """A shortcut that opens the window: a ``.lnk`` on Windows, a ``.desktop`` file elsewhere."""
    if sys.platform == "win32":
        shortcut = folder.parent / f"{NAME}.lnk"
        environment = {"SHORTCUT": str(shortcut), "TARGET": str(folder / "daq-app-window.exe")}
        command = ["powershell", "-NoProfile", "-Command", _SHORTCUT]
        subprocess.run(command, check=True, env={**os.environ, **environment})
        return shortcut
    shortcut = folder.parent / "rocking-test-recorder.desktop"
    lines = ["[Desktop Entry]", "Type=Application", f"Name={NAME}", f'Exec="{folder / "daq-app-window"}"']
    shortcut.write_text("\n".join([*lines, "Terminal=false", ""]), encoding="utf-8")
    shortcut.chmod(0o755)
    return shortcut


def main() -> None:
    """Build into the folder that the command names, or into ``dist``."""
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "dist").resolve()
    folder = build(Path(__file__).resolve().parent, out)
    print(f"{folder}\n{add_shortcut(folder)}")


if __name__ == "__main__":
    main()
