"""What a finished test took of the memory is the system's again."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

_PROGRAM = """
import numpy, psutil, sys
from daq_app.acquisition.closing.freed_memory import give_back
memory = lambda: psutil.Process().memory_info().rss / 2**20
before = memory()
blocks = [numpy.ones(12_000) for _ in range(2000)]  # 96 KB each: below what the library maps on its own
kept = blocks[::100] + [numpy.ones(12_000)]
del blocks
freed = memory()
give_back()
print(freed - before, memory() - before)
"""


@pytest.mark.skipif(
    platform.libc_ver()[0] != "glibc", reason="other allocators give pages back by themselves"
)
def test_pages_between_what_is_still_in_use_go_back_to_the_system() -> None:
    done = subprocess.run([sys.executable, "-c", _PROGRAM], capture_output=True, text=True, check=True)
    freed, given_back = map(float, done.stdout.split())
    assert freed > 150.0, "the library gives them back by itself"
    assert given_back < 30.0


def test_it_is_nothing_where_the_library_has_no_such_function() -> None:
    program = (
        "import ctypes; from daq_app.acquisition.closing import freed_memory\n"
        "ctypes.CDLL = lambda name: object(); freed_memory.give_back()"
    )
    subprocess.run([sys.executable, "-c", program], check=True)
