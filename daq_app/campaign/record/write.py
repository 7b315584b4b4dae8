"""Makes the test record of a run: one PDF, A4, to be printed and signed.

``python -m daq_app.campaign.record.write RUN.h5 OUT.pdf`` for a window that must not be held up.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from daq_app.campaign.record import how_recorded, what_happened
from daq_app.campaign.record.a4 import document_pdf
from daq_app.campaign.record.number_text import moment
from daq_app.campaign.record.parts import Document
from daq_app.campaign.record.source import RecordSource, read_source
from daq_app.config import ConfigError
from daq_app.runfile import RunFileError
from daq_app.runfile.durable import write_whole
from daq_app.runfile.folder import require_replaceable

SUFFIX: Final = ".record.pdf"


def write_record(run: Path, out: Path | None = None, *, overwrite: bool = False) -> Path:
    """Write the record of a run, beside it unless `out` names a file; returns the file.

    Raises `RunFileError` for a run that cannot be read and for a file that may not be replaced, `ConfigError`
    where the operator's verdicts cannot be read, `OSError`.
    """
    target = out or run.with_suffix(SUFFIX)
    require_replaceable(target, [run], overwrite=overwrite)
    return write_whole(target, document_pdf(record_document(read_source(run))))


def record_document(source: RecordSource) -> Document:
    """The record as sections, in the order in which a reader asks."""
    return Document(
        title=f"Test record {source.name}",
        subtitle=f"{source.path.name}, recorded {moment(source.start_utc)}",
        footer=(
            f"{source.header.run_id}, SHA-256 of the run file {source.file_sha256}; "
            f"record made {moment(source.made_utc)}"
        ),
        sections=[
            what_happened.identity_section(source),
            what_happened.verdict_section(source),
            what_happened.plan_section(source),
            what_happened.conditions_section(source),
            what_happened.results_section(source),
            how_recorded.course_section(source),
            how_recorded.deviations_section(source),
            how_recorded.sensors_section(source),
            how_recorded.proof_section(source),
            how_recorded.signatures_section(),
        ],
    )


def main(argv: Sequence[str] | None = None) -> int:
    """0 when the record is written; 1 with a sentence on standard output when it is not."""
    run, out = list(sys.argv[1:] if argv is None else argv)
    try:
        write_record(Path(run), Path(out))
    except (ConfigError, RunFileError, OSError) as error:
        print(error)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
