"""One door for all foreign formats: read, map, doubt, convert, and save as a proven run."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from daq_app.config import Rig
from daq_app.runfile.digest import file_sha256
from daq_app.runfile.errors import RunFileError
from daq_app.runfile.importers.import_map import ImportMap, SourceMap
from daq_app.runfile.importers.imported import ImportedRun
from daq_app.runfile.importers.mapping import MappedChannel, map_channels
from daq_app.runfile.importers.recording import Reader, Spool
from daq_app.runfile.importers.timing import Timing, timing_of
from daq_app.runfile.integrity.saving import save_run
from daq_app.runfile.model import DerivedData, RunHeader, host_name, software_versions
from daq_app.runfile.source import Provenance, RunSource

Derive = Callable[[RunSource], DerivedData | None]
"""What is computed from the samples of an imported run; must not raise."""
_Opener = Callable[[Path, SourceMap], Reader]


@dataclass(frozen=True, slots=True)
class ImportReport:
    """What became of an import."""

    run: Path
    doubts: tuple[str, ...]
    """What the file says that cannot be true, or does not say: reported, not believed."""
    n_samples: int
    rate_hz: float
    channel_ids: tuple[str, ...]
    quality: Mapping[str, Any]
    """``verdict``, ``reasons`` and ``doubtful_channels``; empty where nobody judged it."""


def _opener(suffix: str) -> _Opener:
    """The reader of a format. Imported on demand: SciPy and npTDMS are slow to load."""
    match suffix:
        case ".tdms":
            from daq_app.runfile.importers.formats.from_tdms import TdmsReader as reader
        case ".lvm":
            from daq_app.runfile.importers.formats.from_lvm import LvmReader as reader  # type: ignore[assignment]
        case ".csv" | ".txt":
            from daq_app.runfile.importers.formats.from_csv import CsvReader as reader  # type: ignore[assignment]
        case ".mat":
            from daq_app.runfile.importers.formats.from_mat import open_mat as reader  # type: ignore[assignment]
        case ".npz":
            from daq_app.runfile.importers.formats.from_npz import NpzReader as reader  # type: ignore[assignment]
        case ".uff" | ".unv":
            from daq_app.runfile.importers.formats.from_uff import UffReader as reader  # type: ignore[assignment]
        case ".mf4" | ".mdf" | ".dat":
            from daq_app.runfile.importers.formats.from_mdf import MdfReader as reader  # type: ignore[assignment]
        case ".h5" | ".journal":
            raise RunFileError(
                "runs and journals of this program need no import",
                advice="Use it as it is; `daq-app recover` makes a run of a journal.",
            )
        case _:
            raise RunFileError(
                f"files of the kind {suffix or '(no suffix)'} cannot be imported",
                advice="Known kinds: .tdms, .lvm, .csv, .txt, .mat, .npz, .uff, .unv, .mf4, .mdf, .dat.",
            )
    return reader


def open_foreign(path: Path, source: SourceMap) -> Reader:
    """The reader of a foreign file, by its suffix. Raises `RunFileError`."""
    return _opener(path.suffix.lower())(path, source)


def import_file(
    path: Path,
    rig: Rig,
    rig_text: str,
    out: Path,
    import_map: ImportMap | None = None,
    derive: Derive | None = None,
) -> ImportReport:
    """Turn a foreign recording into a run of `rig` and save it as `out` (a file, or a folder).

    Numbers in volts are kept as readings, bit for bit.  Numbers in engineering units become the
    readings that the rig's sensors would have given, so that every part of the program treats the run
    like one of its own; ``RunHeader.origin`` says so for each channel.  With `derive` the run gets its
    derived signals and its verdict, as a recorded one; without, nobody has judged it.  Raises
    `RunFileError` (or `ConfigError`) and leaves nothing behind.
    """
    opener = _opener(path.suffix.lower())
    import_map = import_map or ImportMap()
    final = out / f"{_file_stem(import_map.run.test or path.stem)}.h5" if out.is_dir() else out
    if final.exists():
        raise RunFileError(
            f"{final} exists already", advice="A run is never overwritten: choose another name."
        )
    if not final.parent.is_dir():
        raise RunFileError(f"the folder {final.parent} does not exist", advice="Make it first.")
    try:
        return _convert(path, opener, rig, rig_text, final, import_map, derive)
    except OSError as error:
        raise RunFileError(
            f"{path} cannot be brought to {final} ({error.strerror or error})",
            advice="Check that the disk is well and has room for twice the run.",
        ) from error


def _convert(
    path: Path,
    opener: _Opener,
    rig: Rig,
    rig_text: str,
    final: Path,
    import_map: ImportMap,
    derive: Derive | None,
) -> ImportReport:
    digest = _digest(path)
    with closing(opener(path, import_map.source)) as reader:
        mapped = map_channels(path, reader, rig, import_map)
        names = list(dict.fromkeys(item.foreign.name for item in mapped))
        time_name = import_map.source.time_column or reader.time_channel
        hint = None if time_name else reader.time_hint
        names += [name for name in (time_name, hint) if name and name not in names]
        with Spool(final.parent, names) as spool:
            reader.copy(spool)
            timing = timing_of(path, reader, spool, mapped, import_map.source, time_name)
            header = _header(path, digest, rig, rig_text, import_map, mapped, timing)
            run = ImportedRun(header, spool, mapped, timing, reader.findings)
            doubts = (*reader.findings.doubts, *timing.doubts, *run.doubts(rig))
            run = run.with_origin(doubts)
            derived = None if derive is None else derive(run)
            save_run(run, final, Provenance(True, (), path.name, path.stat().st_size), derived)
            quality = {} if derived is None else derived.results.get("quality", {})
            return ImportReport(final, doubts, run.n_samples, timing.rate_hz, header.channel_ids, quality)


def _header(
    path: Path,
    digest: str,
    rig: Rig,
    rig_text: str,
    import_map: ImportMap,
    mapped: tuple[MappedChannel, ...],
    timing: Timing,
) -> RunHeader:
    channels: dict[str, Any] = {item.channel.id: item.origin() for item in mapped}
    return RunHeader(
        run_id=f"import-{digest[:16]}-{dt.datetime.now(dt.UTC):%Y%m%dT%H%M%S}",
        test=import_map.run.test or path.stem,
        specimen=import_map.run.specimen or rig.specimen.name,
        rig_name=rig.name,
        rig_text=rig_text,
        product_texts=rig.hardware.product_texts,
        channel_ids=tuple(item.channel.id for item in mapped),
        reading_units=tuple(item.channel.reading_unit for item in mapped),
        rate_hz=timing.rate_hz,
        start_utc_ns=timing.start_utc_ns,
        host=host_name(),
        versions=software_versions(),
        notes=import_map.run.notes,
        origin={
            "file": path.name,
            "sha256": digest,
            "map": import_map.model_dump(mode="json", by_alias=True),
            "channels": channels,
        },
    )


def _file_stem(name: str) -> str:
    """A test's name as that of a file in the chosen folder, and nowhere else."""
    if any(letter in '/\\:*?"<>|' or not letter.isprintable() for letter in name) or name.strip(". ") != name:
        raise RunFileError(f"{name!r} cannot name a run", advice="Use letters, digits, dash and point.")
    return name


def _digest(path: Path) -> str:
    try:
        return file_sha256(path)
    except OSError as error:
        raise RunFileError(f"{path} cannot be read ({error.strerror})", advice="Check the name.") from error
