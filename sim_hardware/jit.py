"""Compiled functions: one decorator for kernels that Python calls, one for their parts.

Numba's cache on disk notices a change of the file that holds a kernel, but not of files whose parts
it calls; a kernel would then silently run old physics.  The cache is therefore dropped when any
source file of the compiled packages has changed.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar, cast

os.environ.setdefault("NUMBA_OPT", "1")
"""Level of optimisation, which Numba reads when it is imported: its own, 3, takes a tenth longer to
compile, and these kernels run no faster (``python -m benchmarks simulation``)."""

import numba as nb  # noqa: E402
from numba.core.registry import CPUDispatcher  # noqa: E402

F = TypeVar("F", bound=Callable[..., object])

_PACKAGES = ("dynamics", "sensors")


def _drop_stale_cache() -> None:
    """Delete the cache of the compiled packages if their sources are not those it was made from."""
    here = Path(__file__).parent
    digest = hashlib.sha256(nb.__version__.encode())
    for name in _PACKAGES:
        for source in sorted([*(here / name).glob("*.py"), *(here / name).glob("*.txt")]):
            digest.update(source.name.encode() + source.read_bytes())
    stamp = here / "__pycache__" / "kernels.stamp"
    with contextlib.suppress(OSError):  # a read-only installation: its sources do not change either
        if stamp.exists() and stamp.read_text(encoding="ascii") == digest.hexdigest():
            return
        for name in _PACKAGES:
            for stale in (here / name / "__pycache__").glob("*.nb[ic]"):
                stale.unlink(missing_ok=True)
        stamp.parent.mkdir(exist_ok=True)
        fresh = stamp.with_suffix(f".{os.getpid()}")
        fresh.write_text(digest.hexdigest(), encoding="ascii")
        fresh.replace(stamp)


_drop_stale_cache()


def kernel(function: F) -> F:
    """Compile a function that Python calls: cached on disk, releases the GIL, IEEE division."""
    compiled: F = nb.njit(cache=True, nogil=True, error_model="numpy")(function)
    return compiled


class _Part(CPUDispatcher):  # type: ignore[misc]  # Numba has no types
    """A compiled function without an entry for Python, which takes a fifth of the compiling."""

    def __call__(self, *_arguments: object) -> object:
        raise TypeError(f"{self.py_func.__name__} is a part of kernels: call it in one, or its py_func")


def part(function: F) -> F:
    """Compile a function that only kernels call: it becomes part of their code.

    Python cannot call it; `TypeError` says so.
    """
    if nb.config.DISABLE_JIT:
        return function
    options = {"nopython": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return cast("F", _Part(function, targetoptions={**options, "error_model": "numpy"}))
