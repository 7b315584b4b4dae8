"""One folder with the program, its Python and a shortcut: nothing to install, and it may be moved.

``python .ci/make_folder.py FOLDER`` copies the Python that runs this script, installs the program of this
checkout into the copy with the pinned versions, compiles the simulated wall ahead, and writes what starts it:
``daq-app``, the window by a double click, and ``add-shortcut`` for the menu. Run it on the system that the
folder is for, Linux or Windows.
"""

from __future__ import annotations

import argparse
import os
import shutil
import stat
import subprocess
import sys
import sysconfig
from pathlib import Path

REPOSITORY = Path(__file__).parents[1]
WINDOWS = sys.platform == "win32"
NAME = "Rocking-test recorder"
_NOT_COPIED = ("site-packages", "dist-packages", "test", "tests", "idlelib", "turtledemo", "__pycache__")
_NOT_COPIED_FILES = ("EXTERNALLY-MANAGED", "*.a", "*.pyc")
_STAMP_S = 1_700_000_000
"""Time of every source file: archives round times, and Numba's cache knows a source by its time."""

_LOAD = """
import importlib, sys
for name in ("acquisition.process", "campaign.report", "cli.app", "monitor.window", "runfile.exporters"):
    try:
        importlib.import_module("daq_app." + name)
    except ImportError as missing:  # an extra that was left out, or a system library of the window
        print("not loaded here:", missing)
from sim_hardware.daqmx_server.program import build_bench, parser, warm_up
asked = parser().parse_args(["--config", sys.argv[1], "--wall", "commanded"])
warm_up(build_bench(asked), asked)
"""
_SH = """#!/bin/sh
# Starts the program from wherever this folder stands.
here=$(dirname "$(readlink -f "$0")")
export LD_LIBRARY_PATH="$here/python/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}" PYTHONNOUSERSITE=1
export PYTHONSAFEPATH=1  # a file of the working folder never stands in for a module
unset PYTHONHOME PYTHONPATH
exec "$here/python/bin/python3" -m daq_app.cli "$@"
"""
_SH_WINDOW = """#!/bin/sh
here=$(dirname "$(readlink -f "$0")")
cd && exec "$here/daq-app"
"""
_DESKTOP = f"""[Desktop Entry]
Type=Application
Name={NAME}
Comment=Data acquisition for free-rocking tests
Exec="@FOLDER@/daq-app"
Path=@HOME@
Terminal=false
Categories=Science;
"""
_ADD_SH = """#!/bin/sh
# Puts a shortcut to this folder into the menu and, where there is one, on the desktop.
here=$(dirname "$(readlink -f "$0")")
menu="${XDG_DATA_HOME:-$HOME/.local/share}/applications"
desktop=$(xdg-user-dir DESKTOP 2>/dev/null || echo "$HOME/Desktop")
mkdir -p "$menu"
shortcut="$menu/rocking-test-recorder.desktop"
sed -e "s|@FOLDER@|$here|g" -e "s|@HOME@|$HOME|g" "$here/python/shortcut.desktop" > "$shortcut"
echo "$shortcut"
if [ -d "$desktop" ] && [ "$desktop" != "$HOME" ]; then
  cp "$shortcut" "$desktop/"
  chmod +x "$desktop/rocking-test-recorder.desktop"
  echo "$desktop/rocking-test-recorder.desktop"
fi
"""
_CMD = """@echo off
rem Starts the program from wherever this folder stands.
set PYTHONHOME=
set PYTHONPATH=
set PYTHONNOUSERSITE=1
set PYTHONSAFEPATH=1
"%~dp0python\\python.exe" -m daq_app.cli %*
"""
_CMD_WINDOW = """@echo off
set PYTHONHOME=
set PYTHONPATH=
set PYTHONNOUSERSITE=1
set PYTHONSAFEPATH=1
start "" /d "%USERPROFILE%" "%~dp0python\\pythonw.exe" -m daq_app.cli %*
"""
_CMD_ADD = """@echo off
rem Puts a shortcut to this folder on the desktop and into the start menu.
powershell -NoProfile -ExecutionPolicy Bypass -Command ^
 "$shell = New-Object -ComObject WScript.Shell;" ^
 "foreach ($place in 'Desktop', 'Programs') {" ^
 " $link = $shell.CreateShortcut((Join-Path $shell.SpecialFolders.Item($place) '%NAME%.lnk'));" ^
 " $link.TargetPath = '%~dp0python\\pythonw.exe'; $link.Arguments = '-I -m daq_app.cli';" ^
 " $link.WorkingDirectory = $env:USERPROFILE; $link.Description = 'Free-rocking tests'; $link.Save() }"
""".replace("%NAME%", NAME)


def copy_python(folder: Path) -> Path:
    """Copy the running Python without its packages. Returns the copy's interpreter."""
    target = folder / "python"
    ignore = shutil.ignore_patterns(*_NOT_COPIED, *_NOT_COPIED_FILES)
    if WINDOWS:
        shutil.copytree(sys.base_prefix, target, ignore=ignore)
        return target / "python.exe"
    stdlib = Path(sysconfig.get_path("stdlib"))
    shutil.copytree(stdlib, target / "lib" / stdlib.name, ignore=ignore, symlinks=True)
    for library in Path(sys.base_prefix, "lib").glob("libpython*.so*"):
        shutil.copy2(library, target / "lib" / library.name, follow_symlinks=False)
    (target / "bin").mkdir()
    python = target / "bin" / "python3"
    shutil.copy2(Path(sys.base_prefix, "bin", stdlib.name).resolve(), python)
    return python


def install(python: Path, extras: str, options: list[str]) -> None:
    """The program of this checkout, with the pinned versions, into that Python."""
    wheels = python.parents[0 if WINDOWS else 1] / "wheel"
    uv = _uv()
    subprocess.run([*uv, "build", "-q", "--wheel", "--out-dir", str(wheels), str(REPOSITORY)], check=True)
    (wheel,) = wheels.glob("*.whl")
    pins = ["--constraint", str(REPOSITORY / "constraints.txt")]
    command = [*uv, "pip", "install", "-q", "--python", str(python), "--link-mode", "copy", *pins, *options]
    subprocess.run([*command, f"{wheel}[{extras}]"], check=True, env=_environment(python))
    shutil.rmtree(wheels)


def compile_ahead(python: Path) -> None:
    """Byte code of what the program loads, and the simulated wall for this kind of processor."""
    packages = Path(_said(python, "import sysconfig; print(sysconfig.get_path('purelib'))"))
    for source in packages.rglob("*.py"):
        os.utime(source, (_STAMP_S, _STAMP_S))
    rig = packages / "daq_app" / "configs" / "fr1.toml"
    subprocess.run([str(python), "-I", "-c", _LOAD, str(rig)], check=True, env=_environment(python))


def write_starters(folder: Path) -> None:
    """What starts the program, for this system."""
    if WINDOWS:
        (folder / "daq-app.cmd").write_text(_CMD, encoding="ascii", newline="\r\n")
        (folder / f"{NAME}.cmd").write_text(_CMD_WINDOW, encoding="ascii", newline="\r\n")
        (folder / "add-shortcut.cmd").write_text(_CMD_ADD, encoding="ascii", newline="\r\n")
        return
    # No desktop entry stands beside the program: most launchers do not tell one where it stands.
    for name, text in {"daq-app": _SH, NAME: _SH_WINDOW, "add-shortcut": _ADD_SH}.items():
        (folder / name).write_text(text, encoding="utf-8")
        (folder / name).chmod(0o755)
    (folder / "python" / "shortcut.desktop").write_text(_DESKTOP, encoding="utf-8")


def _uv() -> list[str]:
    """The uv that runs this script, else the one of the PATH, else that of this Python."""
    program = os.environ.get("UV") or shutil.which("uv")
    return [program] if program else [sys.executable, "-m", "uv"]


def _said(python: Path, code: str) -> str:
    done = subprocess.run(
        [str(python), "-I", "-c", code], capture_output=True, text=True, check=True, env=_environment(python)
    )
    return done.stdout.strip()


def _environment(python: Path) -> dict[str, str]:
    """The environment of the copy's own files, without anything of the Python that runs this script."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL"))}
    if WINDOWS:
        return kept
    return {**kept, "LD_LIBRARY_PATH": str(python.parents[1] / "lib"), "PYTHONNOUSERSITE": "1"}


def _make_removable(folder: Path) -> None:
    """A copied Python may be read-only, as the system's is: the folder belongs to who made it."""
    for path in folder.rglob("*"):
        if not path.is_symlink():
            path.chmod(path.stat().st_mode | stat.S_IWUSR)


def main(argv: list[str] | None = None) -> int:
    """Build the folder. 2 if it exists."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, help="folder to make; it must not be there")
    parser.add_argument("--extras", default="window,sim,report,formats", help="extras of the program")
    parser.add_argument("options", nargs="*", help="further options of `uv pip install`, after --")
    asked = parser.parse_args(argv)
    folder = asked.folder.resolve()
    if folder.exists():
        print(f"{folder} exists. Name another folder", file=sys.stderr)
        return 2
    print("1 of 4: Python", flush=True)
    python = copy_python(folder)
    _make_removable(folder)
    print("2 of 4: the program and its packages", flush=True)
    install(python, asked.extras, asked.options)
    print("3 of 4: compiling ahead", flush=True)
    compile_ahead(python)
    print("4 of 4: starters and shortcut", flush=True)
    write_starters(folder)
    print(f"{folder}: {sum(p.stat().st_size for p in folder.rglob('*') if p.is_file()) / 1e6:.0f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
