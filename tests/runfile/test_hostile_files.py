"""Files made to do harm: they must not exhaust memory, reach outside, or raise anything but RunFileError."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from daq_app.runfile import JournalWriter, RunFileError, RunHeader, finalise, open_run, recover, verify
from daq_app.runfile.journal.frames import FrameType, pack_frame


@pytest.fixture
def run(tmp_path: Path, make_journal, without_seal) -> Path:
    """A run without a seal: whoever makes a file to do harm has none that this machine signed."""
    make_journal(tmp_path / "run.journal", n_blocks=3)
    return without_seal(finalise(tmp_path / "run.journal", tmp_path / "run.h5", keep_journal=False))


def _replace(file: h5py.File, name: str, make: Callable[[h5py.Group, str], None]) -> None:
    group, leaf = file[name.rpartition("/")[0] or "/"], name.rpartition("/")[2]
    del group[leaf]
    make(group, leaf)


def _external_link(group: h5py.Group, name: str) -> None:
    group[name] = h5py.ExternalLink("secret.h5", "/data")


def _soft_link(group: h5py.Group, name: str) -> None:
    group[name] = h5py.SoftLink("/raw/WP-1")


def _external_storage(group: h5py.Group, name: str) -> None:
    group.create_dataset(name, shape=(1200,), dtype="<f8", external=[("secret.bin", 0, 9600)])


def _virtual(group: h5py.Group, name: str) -> None:
    layout = h5py.VirtualLayout(shape=(1200,), dtype="<f8")
    layout[:] = h5py.VirtualSource("secret.h5", "data", shape=(1200,))
    group.create_virtual_dataset(name, layout)


def _wrong_type(group: h5py.Group, name: str) -> None:
    group.create_dataset(name, data=np.zeros(1200, dtype="<i8"), chunks=(100,))


def _huge_claim(group: h5py.Group, name: str) -> None:
    group.create_dataset(name, shape=(2**31,), dtype="<f8", chunks=(1024,))


def _huge_chunk(group: h5py.Group, name: str) -> None:
    group.create_dataset(name, data=np.zeros(1200), maxshape=(None,), chunks=(2**24,), compression="gzip")


def _a_group(group: h5py.Group, name: str) -> None:
    group.create_group(name)


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (_external_link, "link to somewhere else"),
        (_soft_link, "link to somewhere else"),
        (_external_storage, "another file"),
        (_virtual, "another file"),
        (_wrong_type, "int64"),
        (_huge_claim, "shape"),
        (_huge_chunk, "absurdly large chunks|more than 280 MB of memory"),  # whoever sees it first
        (_a_group, "not a column"),
    ],
)
def test_a_forged_channel_is_refused(run: Path, make: Callable[[h5py.Group, str], None], why: str) -> None:
    with h5py.File(run, "r+") as file:
        _replace(file, "raw/LV-A01", make)
    with pytest.raises(RunFileError, match=why):
        open_run(run)
    assert not verify(run).ok


def test_a_small_file_that_claims_a_year_is_refused(run: Path) -> None:
    with h5py.File(run, "r+") as file:
        file.attrs["n_samples"] = 2**31
        for name in ("LV-A01", "WP-1", "AC-1", "TL-1X"):
            _replace(file, f"raw/{name}", _huge_claim)
    with pytest.raises(RunFileError, match="claims more data than the file holds"):
        open_run(run)


def test_one_long_text_behind_many_rows_is_refused(run: Path) -> None:
    """Rows of variable-length text may share their bytes: their number is no measure of memory."""

    def many(group: h5py.Group, name: str) -> None:
        text = h5py.string_dtype()
        dataset = group.create_dataset(name, shape=(300,), dtype=text, fillvalue="x" * 10_000_000)
        assert dataset.id.get_storage_size() < 10_000

    with h5py.File(run, "r+") as file:
        _replace(file, "events/sample", lambda group, name: group.create_dataset(name, data=np.zeros(300)))
        _replace(file, "events/kind", many)
    with pytest.raises(RunFileError, match="takes more than 280 MB of memory"):
        open_run(run)


@pytest.mark.parametrize(
    ("attribute", "value"),
    [
        ("rate_hz", -1.0),
        ("rate_hz", 4001.0),
        ("n_samples", 0),
        ("format_version", 99),
        ("run_id", "another"),
        ("raw_sha256", "no hash"),
        ("n_samples", np.zeros(3)),
    ],
)
def test_forged_attributes_are_refused(run: Path, attribute: str, value: object) -> None:
    with h5py.File(run, "r+") as file:
        file.attrs[attribute] = value
    with pytest.raises(RunFileError):
        open_run(run)


@pytest.mark.parametrize(
    "content", [b"", b"\x89HDF\r\n\x1a\n", b"\x89HDF\r\n\x1a\n" + bytes(1000), b"TDSm" * 100, b"text"]
)
def test_what_is_no_run_is_told(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "x.h5"
    path.write_bytes(content)
    with pytest.raises(RunFileError):
        open_run(path)
    report = verify(path)
    assert not report.ok and len(report.problems) == 1


def test_foreign_hdf5_is_told(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file["data"] = np.arange(3)
    with pytest.raises(RunFileError, match="daq-app import"):
        open_run(tmp_path / "x.h5")


def _journal_of(header: dict, path: Path) -> None:
    tag = b"12345678"
    payload = json.dumps(header).encode()
    data = np.ones(2 * len(header["channel_ids"])).tobytes()
    path.write_bytes(
        pack_frame(FrameType.HEADER, tag, 0, payload)
        + pack_frame(
            FrameType.DATA, tag, 1, data, first_sample=0, n_samples=2, n_channels=len(header["channel_ids"])
        )
        + pack_frame(FrameType.EVENT, tag, 2, b'{"kind": "a\\u0000b", "text": "\\ud800", "data": {"x": NaN}}')
        + pack_frame(FrameType.EVENT, tag, 3, b"[" * 100_000)
        + pack_frame(FrameType.EVENT, tag, 4, b"\xff\xfe not json")
    )


GOOD = {"run_id": "r", "channel_ids": ["a"], "reading_units": ["V"], "rate_hz": 10.0}


@pytest.mark.parametrize(
    "change",
    [
        {"run_id": "../../evil"},
        {"rig_text": "x = [" * 50_000},
        {"rig_text": "name\0 = 1"},
        {"plan": {"tasks": 7}},
        {"plan": {"tasks": [{"channels": [{"id": "a", "skew_s": "x"}]}]}},
        {"test": "\0\u2028"},
        {"truth": {"a": [1, {"b": None}]}},
        {"unknown": "key"},
    ],
)
def test_an_odd_header_is_saved_all_the_same(tmp_path: Path, change: dict) -> None:
    """What was read is worth more than what is said about it."""
    folder = tmp_path / "runs"
    folder.mkdir()
    _journal_of(GOOD | change, folder / "a.journal")
    _journal_of(GOOD | {"run_id": "first"}, folder / "b.journal")
    recover(folder / "b.journal")
    (folder / "b.h5").rename(folder / "a.h5")  # so that the run's id must go into a file name
    results = {result.journal.name: result for result in recover(folder)}
    assert results["a.journal"].outcome == "recovered"
    made = results["a.journal"].run
    assert made is not None and made.parent == folder
    with open_run(made) as run:
        np.testing.assert_array_equal(run.readings(), [[1.0, 1.0]])
        assert run.events[0].data == {"x": None}
    assert [path.name for path in tmp_path.iterdir()] == ["runs"]


@pytest.mark.parametrize(
    "change",
    [
        {"channel_ids": ["../a"]},
        {"channel_ids": ["time"]},
        {"channel_ids": ["a", "a"], "reading_units": ["V", "V"]},
        {"channel_ids": []},
        {"reading_units": []},
        {"rate_hz": 0},
        {"rate_hz": 1e300},
        {"start_utc_ns": 10**30},
        {"format_version": 2},
    ],
)
def test_an_impossible_header_is_refused(tmp_path: Path, change: dict) -> None:
    _journal_of(GOOD | change, tmp_path / "a.journal")
    (result,) = recover(tmp_path)
    assert result.outcome == "failed" and "header" in result.text
    assert not verify(tmp_path).ok
    assert [path.name for path in tmp_path.iterdir()] == ["a.journal"]


def test_links_out_of_the_folder_are_not_followed(tmp_path: Path, make_journal) -> None:
    outside, inside = tmp_path / "outside", tmp_path / "inside"
    outside.mkdir()
    inside.mkdir()
    make_journal(outside / "a.journal")
    try:
        (inside / "a.journal").symlink_to(outside / "a.journal")
    except OSError:
        pytest.skip("this system lets no test make links")
    assert recover(inside) == ()
    assert [path.name for path in outside.iterdir()] == ["a.journal"]


def test_what_somebody_puts_into_an_event_never_stops_recording(tmp_path: Path, header: RunHeader) -> None:
    with JournalWriter(tmp_path / "a.journal", header) as writer:
        writer.append_block(0, np.ones((4, 3)))
        writer.append_event(
            "x", 0, "nul \0 and half \ud800", {"a": np.float32(2), "b": {1, 2}, "c": object()}
        )
    path = finalise(tmp_path / "a.journal", tmp_path / "a.h5")
    with open_run(path) as run:
        assert run.events[0].data["a"] == 2.0 and run.events[0].data["b"] == [1, 2]
