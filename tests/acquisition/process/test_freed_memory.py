"""What a finished test took of the memory is the system's again."""

from __future__ import annotations

import os
import platform
import subprocess
import sys

import pytest

_IN_THREADS = """
import numpy, psutil, sys, threading
from daq_app.acquisition.closing.freed_memory import share_one_heap
if sys.argv[1] == "one heap":
    share_one_heap()
numpy.ones(400_000)  # freed at once, it raises the size from which the library maps memory
memory = lambda: psutil.Process().memory_info().rss / 2**20
turn = threading.Barrier(4)
def use_blocks(place):
    for taking in range(4):
        turn.wait()
        if taking == place:
            blocks = [numpy.ones(100_000) for _ in range(100)]  # 80 MB
            kept = bytes(50_000)
            del blocks
    turn.wait()
    turn.wait()
threads = [threading.Thread(target=use_blocks, args=(place,)) for place in range(3)]
before = memory()
for thread in threads:
    thread.start()
for _ in range(5):
    turn.wait()
print(memory() - before)
turn.wait()
"""

_WITHOUT_ANY_LEFT = """
import numpy, resource, sys
from daq_app.acquisition.closing.freed_memory import give_back, share_one_heap
if sys.argv[1] == "reserve":
    share_one_heap()
blocks = [numpy.ones(12_000) for _ in range(2000)]
kept = blocks[:10]
del blocks
give_back()
resource.setrlimit(resource.RLIMIT_AS, (2**25, resource.RLIM_INFINITY))  # less than there is already
held = []
try:
    while True:
        held.append(numpy.ones(12_000))
except MemoryError:
    count = len(held)
    del held
print(count * 0.096)
"""

_USED_UP = """
import resource, sys
from daq_app.acquisition.closing.freed_memory import renew_reserve, share_one_heap
share_one_heap()
blocks = [bytes(100_000) for _ in range(int(sys.argv[1]))]
renew_reserve()
resource.setrlimit(resource.RLIMIT_AS, (2**25, resource.RLIM_INFINITY))  # less than there is already
held = []
try:
    while True:
        held.append(bytes(1_000_000))
except MemoryError:
    count = len(held)
    del held
print(count)
"""


def _glibc() -> bool:
    return platform.libc_ver()[0] == "glibc"


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


@pytest.mark.skipif(not _glibc(), reason="other allocators give pages back by themselves")
def test_what_one_thread_has_freed_the_next_one_takes() -> None:
    def held(how: str) -> float:
        program = [sys.executable, "-c", _IN_THREADS, how]
        return float(subprocess.run(program, capture_output=True, text=True, check=True).stdout)

    assert held("one heap") < 100.0 < 200.0 < held("a heap for each thread")


@pytest.mark.skipif(not _glibc(), reason="other allocators keep what they keep")
def test_some_memory_is_left_for_the_last_words_where_the_system_gives_none() -> None:
    # Threads of NumPy's own take memory or not before the limit is set, as they happen to start.
    alone = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}

    def left_mb(how: str) -> float:
        program = [sys.executable, "-c", _WITHOUT_ANY_LEFT, how]
        return float(subprocess.run(program, capture_output=True, text=True, check=True, env=alone).stdout)

    # What is left goes in steps of 13.7 MB, as the size of the environment moves the end of the heap: with
    # the reserve it is 20, 33 or 47 MB more; with one of nothing 14 less, as much, or 14 more.
    assert left_mb("reserve") > left_mb("none") + 16.7


@pytest.mark.skipif(not _glibc(), reason="other allocators keep what they keep")
def test_the_reserve_is_there_again_however_much_of_it_was_used() -> None:
    def left_mb(blocks: int) -> int:
        program = [sys.executable, "-c", _USED_UP, str(blocks)]
        return int(subprocess.run(program, capture_output=True, text=True, check=True).stdout)

    # 33 MB of reserve are used up by 0.1 MB at a time; without renewal 0 to 31 MB of it are left.
    assert min(map(left_mb, range(0, 400, 40))) >= 14


@pytest.mark.skipif(not _glibc(), reason="other allocators give pages back by themselves")
def test_pages_between_what_is_still_in_use_go_back_to_the_system() -> None:
    done = subprocess.run([sys.executable, "-c", _PROGRAM], capture_output=True, text=True, check=True)
    freed, given_back = map(float, done.stdout.split())
    assert freed > 150.0, "the library gives them back by itself"
    assert given_back < 30.0


def test_nothing_is_done_where_the_library_has_no_such_function() -> None:
    program = (
        "import ctypes; from daq_app.acquisition.closing import freed_memory\n"
        "ctypes.CDLL = lambda name: object(); freed_memory.give_back(); freed_memory.renew_reserve()"
    )
    subprocess.run([sys.executable, "-c", program], check=True)
