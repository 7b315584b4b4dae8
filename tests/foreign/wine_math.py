"""Complex functions of the C library, which NumPy asks of Windows and Wine does not have.

    python -m tests.foreign.wine_math FOLDER

Builds a library of them beside FOLDER's python.exe with MinGW's compiler, and makes those modules under
FOLDER that need one import it from there. Everything else of that library goes on to Wine's own.
"""

from __future__ import annotations

import argparse
import shutil
import struct
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final

ASKED: Final = "api-ms-win-crt-math-l1-1-0.dll"
OURS: Final = "api-my-win-crt-math-l1-1-0.dll"
"""As long as the name in whose place it stands."""
_GCC: Final = "x86_64-w64-mingw32-gcc"
_REAL: Final = ("cabs", "carg", "cimag", "creal")
_COMPLEX: Final = ("ccos", "ccosh", "cexp", "clog", "csin", "csinh", "csqrt")
_SOURCE: Final = """
#include <complex.h>
typedef struct { double re, im; } D;
typedef struct { float re, im; } F;
static double complex of_D(D x) { double complex z; __real__ z = x.re; __imag__ z = x.im; return z; }
static float complex of_F(F x) { float complex z; __real__ z = x.re; __imag__ z = x.im; return z; }
static D to_D(double complex z) { D x = {creal(z), cimag(z)}; return x; }
static F to_F(float complex z) { F x = {crealf(z), cimagf(z)}; return x; }
D our__Cbuild(double re, double im) { D x = {re, im}; return x; }
D our__LCbuild(double re, double im) { D x = {re, im}; return x; }
F our__FCbuild(float re, float im) { F x = {re, im}; return x; }
D our_cpow(D x, D y) { return to_D(cpow(of_D(x), of_D(y))); }
F our_cpowf(F x, F y) { return to_F(cpowf(of_F(x), of_F(y))); }
"""


def _library() -> tuple[str, set[str]]:
    """C source, and the names that it gives. A long double of Windows is a double."""
    lines, names = [_SOURCE], {"_Cbuild", "_LCbuild", "_FCbuild", "cpow", "cpowf"}
    for name in _REAL:
        lines += [
            f"double our_{name}(D x) {{ return {name}(of_D(x)); }}",
            f"double our_{name}l(D x) {{ return {name}(of_D(x)); }}",
            f"float our_{name}f(F x) {{ return {name}f(of_F(x)); }}",
        ]
        names |= {name, f"{name}l", f"{name}f"}
    for name in _COMPLEX:
        lines += [
            f"D our_{name}(D x) {{ return to_D({name}(of_D(x))); }}",
            f"F our_{name}f(F x) {{ return to_F({name}f(of_F(x))); }}",
        ]
        names |= {name, f"{name}f"}
    return "\n".join(lines), names


def _asked_by(module: Path) -> set[str]:
    """What a 64-bit module imports of the library (PE format, import directory)."""
    data = module.read_bytes()
    if data[:2] != b"MZ" or ASKED.encode() not in data:
        return set()
    (head,) = struct.unpack_from("<I", data, 0x3C)
    n_sections, n_optional = struct.unpack_from("<H12xH", data, head + 6)
    sections = [
        struct.unpack_from("<IIII", data, head + 24 + n_optional + 40 * i + 8) for i in range(n_sections)
    ]

    def at(address: int) -> int:
        return next(
            address - begins + offset
            for size, begins, stored, offset in sections
            if begins <= address < begins + max(size, stored)
        )

    def text(address: int) -> str:
        start = at(address)
        return data[start : data.index(b"\0", start)].decode("ascii")

    names: set[str] = set()
    entry = at(struct.unpack_from("<I", data, head + 24 + 120)[0])
    while (library := struct.unpack_from("<I", data, entry + 12)[0]) != 0:
        if text(library).lower() == ASKED:
            thunk = at(struct.unpack_from("<I", data, entry)[0])
            while (place := struct.unpack_from("<Q", data, thunk)[0]) != 0:
                names.add(text(place + 2))
                thunk += 8
        entry += 20
    return names


def provide(folder: Path) -> list[Path]:
    """Build the library in a folder and use it; the modules that were changed."""
    source, ours = _library()
    modules = {m: _asked_by(m) for m in folder.rglob("*") if m.suffix.lower() in (".pyd", ".dll")}
    needy = {module: names for module, names in modules.items() if names & ours}
    others = set().union(*needy.values()) - ours
    exports = [f"  {name} = our_{name}" for name in sorted(ours)]
    exports += [f"  {name} = ucrtbase.{name}" for name in sorted(others)]
    with tempfile.TemporaryDirectory() as work:
        c_file, def_file = Path(work) / "math.c", Path(work) / "math.def"
        c_file.write_text(source, encoding="ascii")
        def_file.write_text("\n".join([f'LIBRARY "{OURS}"', "EXPORTS", *exports]), encoding="ascii")
        options = ["-O1", "-fno-builtin", "-static", "-static-libgcc", "-shared", "-o", str(folder / OURS)]
        subprocess.run([_GCC, *options, str(c_file), str(def_file), "-lmingwex"], check=True)
    for module in needy:
        module.write_bytes(module.read_bytes().replace(ASKED.encode(), OURS.encode()))
    return sorted(needy)


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code 2 where the compiler is missing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder with python.exe")
    folder = parser.parse_args(arguments).folder
    if shutil.which(_GCC) is None:
        print(f"{_GCC} is not here: install MinGW-w64 (Debian: gcc-mingw-w64-x86-64)")
        return 2
    for module in provide(folder):
        print(module.relative_to(folder))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
