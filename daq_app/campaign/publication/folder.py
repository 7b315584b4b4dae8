"""The published folder: gathers runs, writes data and tables, figures, metadata and checksums."""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

from daq_app.campaign.description import Publication
from daq_app.campaign.plan import Campaign
from daq_app.campaign.publication.fields import Values
from daq_app.campaign.publication.metadata import citation_cff, datacite_json, ro_crate_json
from daq_app.campaign.publication.readme import readme
from daq_app.campaign.publication.record import PublishedTest
from daq_app.campaign.publication.tables import channels_csv, columns_csv, results_csv, tests_csv
from daq_app.campaign.recorded import test_of, verdicts_of
from daq_app.campaign.status import RecordedTest
from daq_app.campaign.verdicts import OperatorVerdict
from daq_app.config import Rig
from daq_app.runfile import DerivedData, Run, RunFileError, open_run
from daq_app.runfile.digest import file_sha256
from daq_app.runfile.durable import write_whole
from daq_app.runfile.exporters import export_run
from daq_app.runfile.folder import find_runs
from daq_app.workers import Workers, run_all

Derive = Callable[[Run], DerivedData | None]
_NOTES: Final = ("note", "marker")


@dataclass(frozen=True, slots=True)
class Source:
    """A run of the campaign that is a release of a named test."""

    path: Path
    recorded: RecordedTest


def sources(folder: Path) -> tuple[list[Source], list[str]]:
    """The released tests of a folder in their order of time, and what could not be read, in words.

    Raises what `verdicts_of` raises.
    """
    verdicts: Mapping[str, OperatorVerdict] = verdicts_of(folder)
    usable, left_out = [], []
    for path in find_runs(folder):
        try:
            with open_run(path) as run:
                recorded = test_of(run, verdicts)
        except RunFileError as error:
            left_out.append(f"{path.name}: {error}")
            continue
        if recorded is not None:
            usable.append(Source(path, recorded))
    return sorted(usable, key=lambda source: source.recorded.released_ns), left_out


def publish(
    found: Sequence[Source],
    left_out: Sequence[str],
    campaign: Campaign,
    values: Values,
    out: Path,
    *,
    derive: Derive,
    draw: Callable[[Path], object],
    workers: Workers = None,
    progress: Callable[[int, int, str], None] = lambda done, total, name: None,
) -> Path:
    """Write the folder `out`, which must not exist; returns it.

    `derive` gives rotation, velocity and results of a run, and must be picklable; `draw` writes reports and
    figures into the folder that it is given.
    Raises `RunFileError` where a run cannot be exported or `out` cannot be written, `ValueError` without a
    description.
    """
    publication = campaign.publication
    if publication is None:
        raise ValueError("the campaign file has no table [publication]")
    if out.exists():
        raise RunFileError(f"{out} exists already", advice="Name a folder that does not exist yet.")
    for name in ("data", "tables", "rigs"):
        (out / name).mkdir(parents=True)
    tests = run_all(
        partial(_publish_test, out=out, derive=derive),
        list(found),
        workers,
        lambda done, source: progress(done, len(found), str(source.recorded.name)),
    )
    rigs = {test.rig_name: test.rig for test in tests if test.rig is not None}
    _write_rigs(out / "rigs", found)
    for name, text in {
        "tests.csv": tests_csv(tests, campaign.fields, values),
        "results.csv": results_csv(tests),
        "channels.csv": channels_csv(rigs),
        "columns.csv": columns_csv(campaign.fields),
    }.items():
        write_whole(out / "tables" / name, text)
    draw(out / "report")
    _describe(out, publication, tests, rigs, left_out)
    return out


def _describe(
    out: Path,
    publication: Publication,
    tests: Sequence[PublishedTest],
    rigs: Mapping[str, Rig],
    left_out: Sequence[str],
) -> None:
    """README, licence, metadata and checksums of what lies in `out`."""
    licence = f"{publication.title}\n\n{publication.licence}\n{publication.licence_page or ''}\n"
    write_whole(out / "LICENCE.txt", licence)
    write_whole(out / "CITATION.cff", citation_cff(publication))
    write_whole(out / "datacite.json", datacite_json(publication))
    files = {path: _WORDS.get(path) or _words(path) for path in _names(out)}
    write_whole(out / "README.md", readme(publication, tests, rigs, files, left_out))
    described = {"README.md": "how the data were made, and how to read them", **files}
    write_whole(out / "ro-crate-metadata.json", ro_crate_json(publication, described))
    write_checksums(out)


def write_checksums(out: Path) -> None:
    """``SHA256SUMS`` of all files, as `sha256sum -c` reads it."""
    sums = [f"{file_sha256(out / name)}  {name}" for name in _names(out) if name != "SHA256SUMS"]
    write_whole(out / "SHA256SUMS", "\n".join(sums) + "\n")


_WORDS: Final = {
    "tables/tests.csv": "a row for each test: plan, verdict, r, operator, fields, files",
    "tables/results.csv": "every number of every test with its uncertainty",
    "tables/channels.csv": "every sensor: place, axis, unit, certificate",
    "tables/columns.csv": "what each column of these tables means, and its unit",
    "LICENCE.txt": "licence",
    "CITATION.cff": "how to cite, for machines",
    "datacite.json": "metadata, DataCite kernel 4",
}


def _words(name: str) -> str:
    if name.startswith("data/"):
        return f"all channels, rotation, velocity and phase of {Path(name).stem}"
    if name.startswith("rigs/"):
        return "rig file: wall, sensors, modules"
    if name.endswith(".csv"):
        return "numbers behind the report"
    return "figure" if name.endswith(".svg") else "report of all tests"


def _names(out: Path) -> Iterator[str]:
    yield from sorted(path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file())


def _publish_test(source: Source, out: Path, derive: Derive) -> PublishedTest:
    """Export one run, and say what the tables need of it."""
    derived: list[DerivedData | None] = []

    def once(run: Run) -> DerivedData | None:
        derived.append(derive(run))
        return derived[0]

    data = Path("data") / f"{source.path.stem}.nc"
    export_run(source.path, out / data, "netcdf", derive=once)
    with open_run(source.path) as run:
        header, plan = run.header, run.header.test_plan
        started = (
            dt.datetime.fromtimestamp(header.start_utc_ns / 1e9, dt.UTC).isoformat()
            if header.start_utc_ns
            else ""
        )
        # The tidy table of all tests holds these rows too.
        (out / data).with_suffix(".results.csv").unlink(missing_ok=True)
        results = derived[0].results if derived and derived[0] is not None else {}
        return PublishedTest(
            recorded=source.recorded,
            started_utc=started,
            planned_level=plan.theta0_over_alpha if plan is not None else None,
            side=plan.side if plan is not None else "",
            operator=plan.operator if plan is not None else "",
            conditions=plan.conditions if plan is not None else "",
            notes=tuple(event.text for event in run.events if event.kind in _NOTES),
            rig=run.rig,
            rig_name=rig_file(header.rig_name),
            analysis=results.get("analysis") or {},
            data_file=data,
            source_name=source.path.name,
            source_sha256=file_sha256(source.path),
        )


def rig_file(name: str) -> str:
    """Name of a rig's file in the folder, whatever the rig is called."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", name)[:60] + ".toml"


def _write_rigs(folder: Path, found: Sequence[Source]) -> None:
    """The rig file of each wall, as the runs keep it."""
    for source in found:
        with open_run(source.path) as run:
            path = folder / rig_file(run.header.rig_name)
            if run.header.rig_text and not path.exists():
                write_whole(path, run.header.rig_text)
                rig = run.rig
                for name, text in zip(
                    rig.hardware.products if rig else (), run.header.product_texts, strict=False
                ):
                    write_whole(folder / Path(name).name, text)
