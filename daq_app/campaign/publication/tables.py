"""Tables of a published campaign: tests, results, sensors; every column with unit and meaning."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from daq_app.campaign.description import FieldSpec
from daq_app.campaign.publication.fields import Values
from daq_app.campaign.publication.record import PublishedTest
from daq_app.config import Rig
from daq_app.config.shown_text import csv_cell
from daq_app.runfile.exporters.results import COLUMNS, result_rows

_TESTS: Final = (
    ("test", "", "name: specimen, level, number; R stands for a repetition at the end"),
    ("specimen", "", "wall"),
    ("started_utc", "", "wall clock at the first sample, ISO 8601"),
    ("verdict", "", "good, bad, lost or unchecked, by the recorder or the operator"),
    ("reason", "", "why a test is bad or lost"),
    ("planned_theta0_over_alpha", "1", "rotation to be released from, over α"),
    ("side", "", "side that the wall was to be pulled to"),
    ("theta0", "rad", "rotation at release, of the family that knows it best"),
    ("alpha", "rad", "slenderness angle of the rig file"),
    ("r", "1", "coefficient of restitution: fusion of all sensor families"),
    ("r_sigma", "1", "its standard uncertainty"),
    ("r_trust", "", "what the sensor families say of it together"),
    ("impacts", "1", "number of impacts that were found"),
    ("operator", "", "who took the test"),
    ("conditions", "", "what may matter later, as written before the test"),
    ("notes", "", "notes and markers during the test"),
    ("data_file", "", "netCDF file of all channels"),
    ("source_file", "", "run file of the recorder"),
    ("source_sha256", "", "SHA-256 of the run file"),
)
_CHANNELS: Final = (
    ("rig", "", "rig file"),
    ("channel", "", "name of the channel; the netCDF variable has underscores for other signs"),
    ("family", "", "lvdt, wire, accelerometer, tiltmeter, or one beside the rocking analysis"),
    ("unit", "", "unit of the values"),
    ("x", "m", "position: through the thickness, from the centre of the base"),
    ("y", "m", "position: along the length"),
    ("z", "m", "position: upwards"),
    ("axis", "", "axis that is measured"),
    ("sensitivity", "", "of the certificate, in sensitivity_unit"),
    ("sensitivity_unit", "", "unit of the sensitivity"),
    ("certificate", "", "number of the calibration certificate"),
    ("calibrated", "", "date of the calibration"),
)
_RESULT_WORDS: Final = {
    "test": "name of the test",
    "level": "level of the test, as in its name",
    "quantity": "what was found",
    "source": "method, family or empty",
    "n": "impact that begins the half-cycle (0: the release), or empty",
    "value": "the value, in `unit`",
    "sigma": "its standard uncertainty, in `unit`",
    "unit": "unit of value and sigma",
}


def tests_csv(tests: Sequence[PublishedTest], specs: Sequence[FieldSpec], values: Values) -> str:
    """A row for each test; the campaign's own fields stand last."""
    rows = []
    for test in tests:
        row = _test_row(test)
        row.update({spec.name: values.get(test.name, {}).get(spec.name, "") for spec in specs})
        rows.append(row)
    return _csv([name for name, _, _ in _TESTS] + [spec.name for spec in specs], rows)


def _test_row(test: PublishedTest) -> dict[str, Any]:
    verdict = test.analysis.get("verdict") or {}
    return {
        "test": test.name,
        "specimen": test.recorded.name.specimen,
        "started_utc": test.started_utc,
        "verdict": test.recorded.verdict.value,
        "reason": test.recorded.reason,
        "planned_theta0_over_alpha": test.planned_level,
        "side": test.side,
        "theta0": test.analysis.get("theta0_rad"),
        "alpha": test.rig.specimen.alpha0_rad if test.rig is not None else None,
        "r": verdict.get("r"),
        "r_sigma": verdict.get("standard_error"),
        "r_trust": verdict.get("trust"),
        "impacts": max(0, len(test.analysis.get("half_cycles") or []) - 1) if test.analysis else None,
        "operator": test.operator,
        "conditions": test.conditions,
        "notes": " | ".join(test.notes),
        "data_file": test.data_file.as_posix(),
        "source_file": test.source_name,
        "source_sha256": test.source_sha256,
    }


def results_csv(tests: Sequence[PublishedTest]) -> str:
    """Every number of every test, a row each."""
    rows = [
        {
            "test": test.name,
            "level": test.recorded.name.level,
            "quantity": row.quantity,
            "source": row.source,
            "n": None if row.n < 0 else row.n,
            "value": row.value,
            "sigma": row.sigma,
            "unit": row.unit,
        }
        for test in tests
        for row in result_rows(test.analysis)
    ]
    return _csv(list(COLUMNS), rows)


def channels_csv(rigs: Mapping[str, Rig]) -> str:
    """A row for each sensor of each rig."""
    rows = [
        {
            "rig": name,
            "channel": channel.id,
            "family": channel.family,
            "unit": channel.si_unit,
            "x": channel.position_m[0],
            "y": channel.position_m[1],
            "z": channel.position_m[2],
            "axis": channel.axis,
            "sensitivity": channel.sensitivity,
            "sensitivity_unit": channel.sensitivity_unit,
            "certificate": channel.certificate.number,
            "calibrated": channel.certificate.calibrated.isoformat(),
        }
        for name, rig in rigs.items()
        for channel in rig.channels
    ]
    return _csv([name for name, _, _ in _CHANNELS], rows)


def columns_csv(specs: Sequence[FieldSpec]) -> str:
    """What every column of the other tables means, and its unit."""
    described = [("tests.csv", *column) for column in _TESTS]
    described += [("tests.csv", spec.name, spec.unit, spec.title) for spec in specs]
    described += [("results.csv", name, "", words) for name, words in _RESULT_WORDS.items()]
    described += [("channels.csv", *column) for column in _CHANNELS]
    names = ("table", "column", "unit", "meaning")
    return _csv(names, [dict(zip(names, row, strict=True)) for row in described])


def _csv(columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> str:
    out = io.StringIO()
    writer = csv.DictWriter(out, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(
        {name: "" if row[name] is None else csv_cell(row[name]) for name in columns} for row in rows
    )
    return out.getvalue()
