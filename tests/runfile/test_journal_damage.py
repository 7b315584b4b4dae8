"""Whatever happens to the bytes of a journal, no wrong sample comes out of it."""

from __future__ import annotations

import itertools
import runpy
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from daq_app.runfile import JournalWriter, RunFileError, RunHeader, read_journal, recover, verify
from daq_app.runfile.journal.frames import HEADING_BYTES, MAX_TEXT_BYTES, FrameType, pack_frame

CHANNELS, BLOCK, BLOCKS, FIRST = 2, 5, 9, 40
GAP = range(FIRST + 4 * BLOCK, FIRST + 4 * BLOCK + 7)
SHIFT = 1000.0
LAST = FIRST + BLOCKS * BLOCK + len(GAP)


def truth(samples: NDArray[np.int64]) -> NDArray[np.float64]:
    """Readings that name their own sample and channel; NaN in the gap."""
    values = samples[None, :] + np.array([[0.25], [0.5]])
    values[:, (samples >= GAP.start) & (samples < GAP.stop)] = np.nan
    return values


def small_header(run_id: str = "r") -> RunHeader:
    return RunHeader(run_id=run_id, channel_ids=("a", "b"), reading_units=("V", "V"), rate_hz=1000.0)


def write_small(path: Path, run_id: str = "r", shift: float = 0.0) -> bytes:
    path.unlink(missing_ok=True)
    with JournalWriter(path, small_header(run_id)) as writer:
        sample = FIRST
        for number in range(BLOCKS):
            if number == 4:
                writer.append_gap(sample, len(GAP), "cable")
                sample += len(GAP)
            writer.append_block(sample, truth(np.arange(sample, sample + BLOCK)) + shift)
            sample += BLOCK
            writer.append_event("marker", sample, "tick")
    return path.read_bytes()


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return write_small(tmp_path_factory.mktemp("sound") / "a.journal")


@pytest.fixture(scope="module")
def foreign(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Another journal of the same shape with other values: what a recycled disk block may hold."""
    return write_small(tmp_path_factory.mktemp("foreign") / "b.journal", "other", SHIFT)


def check(path: Path) -> int | None:
    """Assert that nothing wrong is presented; returns the number of good samples, None if refused."""
    try:
        contents = read_journal(path)
    except RunFileError:
        return None
    # If no frame of ours is left, the file is the other run, and says so.
    shift = 0.0 if contents.header.run_id == "r" else SHIFT
    with contents:
        good = 0
        missing = np.zeros(contents.n_samples, dtype=bool)
        for gap in contents.gaps:
            missing[gap.first_sample - contents.first_sample : gap.end - contents.first_sample] = True
        for first, window in contents.windows(11):
            samples = np.arange(first, first + window.shape[1])
            absent = np.isnan(window)
            np.testing.assert_array_equal(absent.all(axis=0), missing[samples - contents.first_sample])
            present = ~absent
            np.testing.assert_array_equal(window[present], (truth(samples) + shift)[present])
            good += int(present.all(axis=0).sum())
    return good


Damage = Callable[[bytes, bytes], bytes]


@st.composite
def damages(draw: st.DrawFn) -> Damage:
    """One thing that can happen to a file: the places are fractions of its length."""
    kind = draw(
        st.sampled_from(["cut", "flip", "delete", "repeat", "swap", "zero", "noise", "stale", "foreign"])
    )
    a, b, c = (draw(st.floats(0, 1)) for _ in range(3))
    noise = draw(st.binary(max_size=70))
    bit = draw(st.integers(0, 7))

    def apply(data: bytes, other: bytes) -> bytes:
        low, high = sorted((int(a * len(data)), int(b * len(data))))
        middle = int(c * len(data))
        if kind == "cut":
            return data[:low]
        if kind == "flip" and low < len(data):
            return data[:low] + bytes([data[low] ^ (1 << bit)]) + data[low + 1 :]
        if kind == "delete":
            return data[:low] + data[high:]
        if kind == "repeat":
            return data[:middle] + data[low:high] + data[middle:]
        if kind == "swap":
            return data[high:] + data[low:high] + data[:low]
        if kind == "zero":
            return data[:low] + bytes(high - low) + data[high:]
        if kind == "noise":
            return data[:low] + noise + data[low:]
        if kind == "stale":
            return data[:low] + other[low:high] + data[high:]
        return data[:low] + other[: high - low] + data[low:]

    return apply


def test_no_damage_gives_a_wrong_sample(tmp_path: Path, sound: bytes, foreign: bytes) -> None:
    path = tmp_path / "damaged.journal"

    @settings(max_examples=400)
    @given(todo=st.lists(damages(), min_size=1, max_size=4))
    def prove(todo: list[Damage]) -> None:
        data = sound
        for apply in todo:
            data = apply(data, foreign)
        path.write_bytes(data)
        check(path)

    prove()


def frame_offsets(data: bytes) -> list[int]:
    """Where each frame of a sound journal starts, and the end."""
    offsets = [0]
    while offsets[-1] < len(data):
        size = int.from_bytes(data[offsets[-1] + 44 : offsets[-1] + 48], "little")
        offsets.append(offsets[-1] + HEADING_BYTES + size)
    assert offsets[-1] == len(data)
    return offsets


def test_cut_anywhere_keeps_every_whole_block(tmp_path: Path, sound: bytes) -> None:
    path = tmp_path / "cut.journal"
    offsets = frame_offsets(sound)
    ends = [
        end
        for start, end in itertools.pairwise(offsets)
        if int.from_bytes(sound[start + 10 : start + 12], "little") == FrameType.DATA
    ]
    for length in range(offsets[1], len(sound), 7):
        path.write_bytes(sound[:length])
        assert check(path) == BLOCK * sum(end <= length for end in ends)


def test_every_single_flipped_bit_costs_at_most_one_block(tmp_path: Path, sound: bytes) -> None:
    path = tmp_path / "flip.journal"
    for place in range(0, len(sound), 7):
        data = bytearray(sound)
        data[place] ^= 1 << (place % 8)
        path.write_bytes(data)
        good = check(path)
        assert good is not None and good >= (BLOCKS - 1) * BLOCK
        with read_journal(path) as contents:
            assert contents.damage or contents.tail_bytes


def test_a_foreign_journal_over_the_beginning_does_not_take_the_file(
    tmp_path: Path, sound: bytes, foreign: bytes
) -> None:
    """The header's copy at the end still tells whose journal it is."""
    path = tmp_path / "mixed.journal"
    cut = frame_offsets(sound)[3]
    path.write_bytes(foreign[:cut] + sound[cut:])
    with read_journal(path) as contents:
        assert contents.header.run_id == "r"
        assert any("another journal" in sentence for sentence in contents.damage)
    assert check(path) >= (BLOCKS - 2) * BLOCK


def test_contradicting_frames_are_both_left_out(tmp_path: Path, sound: bytes) -> None:
    path = tmp_path / "forged.journal"
    tag = sound[16:24]
    forged = pack_frame(
        FrameType.DATA,
        tag,
        1,
        np.full(10, 9.0).tobytes(),
        first_sample=FIRST,
        n_samples=BLOCK,
        n_channels=CHANNELS,
    )
    path.write_bytes(sound + forged)
    assert check(path) == (BLOCKS - 1) * BLOCK


@pytest.mark.parametrize("first", [FIRST, LAST - 1, GAP.start + 1])
def test_a_block_that_repeats_samples_is_left_out(tmp_path: Path, sound: bytes, first: int) -> None:
    """Whichever program wrote it: what was recorded first stands."""
    path = tmp_path / "repeats.journal"
    late = pack_frame(
        FrameType.DATA,
        sound[16:24],
        1000,
        np.full(10, 9.0).tobytes(),
        first_sample=first,
        n_samples=BLOCK,
        n_channels=CHANNELS,
    )
    path.write_bytes(sound + late)
    assert check(path) == BLOCKS * BLOCK
    with read_journal(path) as contents:
        assert f"a block that repeats sample {first} was left out" in contents.damage


@pytest.mark.parametrize(
    ("frame", "why"),
    [
        ({"type_": FrameType.GAP, "first_sample": LAST, "n_samples": 2**32 - 1}, "cannot be true"),
        ({"type_": FrameType.END, "first_sample": 2**61}, "cannot be true"),
    ],
)
def test_an_absurd_claim_is_refused(tmp_path: Path, sound: bytes, frame: dict, why: str) -> None:
    path = tmp_path / "absurd.journal"
    last = frame_offsets(sound)[-2]
    number = int.from_bytes(sound[last + 24 : last + 32], "little")
    path.write_bytes(sound[:last] + pack_frame(tag=sound[16:24], sequence=number, payload=b"x", **frame))
    with pytest.raises(RunFileError, match=why):
        read_journal(path)


def test_a_file_of_forged_headings_is_given_up_quickly(tmp_path: Path, sound: bytes) -> None:
    """Each heading is right and claims the rest of the file, whose CRC is wrong."""
    path = tmp_path / "bomb.journal"
    size = 2_000_000
    frame = pack_frame(FrameType.EVENT, sound[16:24], 5, bytes(size))[:HEADING_BYTES]
    path.write_bytes(sound + frame * (2 * size // HEADING_BYTES))
    with pytest.raises(RunFileError, match="too many broken frames"):
        read_journal(path)


def test_the_reference_reader_agrees(tmp_path: Path, sound: bytes, foreign: bytes, repository: Path) -> None:
    """The reader in docs, which shares no code with the program, sees the same samples."""
    reader = runpy.run_path(str(repository / "docs" / "reference" / "journal_reader.py"))
    middle = len(sound) // 2
    broken = bytearray(sound)
    broken[middle] ^= 4
    for data in (sound, sound[:middle], bytes(broken), sound[:middle] + foreign[:300] + sound[middle:]):
        path = tmp_path / "a.journal"
        path.write_bytes(data)
        header, blocks, events, gaps = reader["read_journal"](path)
        assert header["channel_ids"] == ["a", "b"]
        with read_journal(path) as contents:
            expected = {
                first + column: tuple(window[:, column])
                for first, window in contents.windows(1000)
                for column in range(window.shape[1])
                if not np.isnan(window[0, column])
            }
            assert len(events) == len(contents.events)
            assert [(first, count) for first, count, _ in gaps] == [
                (gap.first_sample, gap.n_samples) for gap in contents.gaps if gap.reason == "cable"
            ]
        seen = {}
        for first, rows in blocks:
            for column in range(len(rows[0])):
                seen[first + column] = tuple(row[column] for row in rows)
        assert seen == expected


def test_an_end_of_noise_is_damage_with_a_count_of_what_may_be_missing(tmp_path: Path, sound: bytes) -> None:
    path = tmp_path / "noise.journal"
    keep = frame_offsets(sound)[4]
    noise = np.random.default_rng(1).bytes(len(sound) - keep)
    path.write_bytes(sound[:keep] + noise)
    report = verify(path)
    assert not report.ok
    (problem,) = report.problems
    assert f"at least {len(noise)} bytes at its end cannot be read" in problem
    assert f"up to {len(noise) // (8 * CHANNELS)} samples of each channel may be missing" in problem


def test_a_run_made_of_a_journal_with_a_lost_end_says_so_for_ever(tmp_path: Path, sound: bytes) -> None:
    path = tmp_path / "noise.journal"
    path.write_bytes(sound[: frame_offsets(sound)[4]] + bytes(len(sound)))
    (made,) = recover(path)
    assert made.run is not None
    assert any("bytes at its end cannot be read" in note for note in verify(made.run).notes)


@pytest.mark.parametrize("left", [1, 30, HEADING_BYTES, HEADING_BYTES + 10])
def test_one_frame_torn_at_the_end_is_no_damage(tmp_path: Path, sound: bytes, left: int) -> None:
    path = tmp_path / "torn.journal"
    path.write_bytes(sound[: frame_offsets(sound)[5] + left])
    report = verify(path)
    assert report.ok and any("unfinished frame" in note for note in report.notes)


def test_bytes_after_the_end_frame_are_damage(tmp_path: Path, sound: bytes) -> None:
    path = tmp_path / "longer.journal"
    path.write_bytes(sound + b"x" * 20)
    assert not verify(path).ok


def test_an_event_too_long_to_be_read_is_told(tmp_path: Path, sound: bytes) -> None:
    path = tmp_path / "long.journal"
    last = frame_offsets(sound)[-2]
    number = int.from_bytes(sound[last + 24 : last + 32], "little")
    long = pack_frame(FrameType.EVENT, sound[16:24], number + 1, b'"' + b"x" * MAX_TEXT_BYTES + b'"')
    path.write_bytes(sound[:last] + long)
    assert any("absurdly long" in problem for problem in verify(path).problems)
