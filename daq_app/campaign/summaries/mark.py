"""What the numbers of an analysis follow from: the run file, the code with its libraries, the options."""

from __future__ import annotations

import hashlib
import platform
from dataclasses import asdict, dataclass
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import numpy as np

from daq_app.rocking.analysis.options import AnalysisOptions
from daq_app.runfile.digest import file_sha256

_PROGRAM: Final = Path(__file__).parents[2]
ANALYSIS_CODE: Final = ("config", "rocking", "runfile", "campaign")
"""Packages that read, scale and analyse a run and sum it up; the modules beside them count as well.
A test holds this against what an analysis imports."""
_LIBRARIES: Final = ("numpy", "scipy", "h5py", "pydantic")
_FILES: Final = (".py", ".toml")
"""Modules, and the tables of products that a rig file refers to."""


@dataclass(frozen=True, slots=True)
class AnalysisMark:
    """Two equal marks: the same analysis of the same run, to the last digit."""

    run_sha256: str
    code_sha256: str
    options: dict[str, Any]

    @classmethod
    def of(cls, run: Path, options: AnalysisOptions) -> AnalysisMark:
        """The mark that an analysis of this run, made here and now, has. Raises `OSError`."""
        return cls(file_sha256(run), code_sha256(), asdict(options))

    def difference(self, other: AnalysisMark) -> str:
        """Why an analysis with the mark `other` does not stand for one with this; empty where it does."""
        if self.run_sha256 != other.run_sha256:
            return "the run file is another one than was analysed"
        if self.code_sha256 != other.code_sha256:
            return "it was analysed by another version of the program or of its libraries"
        if self.options != other.options:
            return "it was analysed with other options"
        return ""


@lru_cache(maxsize=1)
def code_sha256() -> str:
    """SHA-256 of all code that an analysis runs, of the libraries' versions and of the kind of processor.

    The processor counts because NumPy sums in another order where it has wider registers.
    """
    return digest_of(_PROGRAM, surroundings())


def digest_of(program: Path, around: str) -> str:
    """The same of the packages below `program`, and of what is said to be around them."""
    digest = hashlib.sha256(around.encode())
    inside = (path for package in ANALYSIS_CODE for path in (program / package).rglob("*"))
    for path in sorted([*program.glob("*"), *inside]):
        if path.suffix in _FILES:
            content = path.read_bytes()
            digest.update(f"\n{path.relative_to(program).as_posix()} {len(content)}\n".encode())
            digest.update(content)
    return digest.hexdigest()


def surroundings() -> str:
    """Versions and processor, as far as a last digit may hang on them."""
    simd = np.show_config(mode="dicts")["SIMD Extensions"]
    parts = {
        "Python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}",
        "SIMD": " ".join(simd.get("found", ())),
        **{name: version(name) for name in _LIBRARIES},
    }
    return "\n".join(f"{name} {value}" for name, value in parts.items())
