"""The part of a test record that says with what the test was recorded, and what proves it."""

from __future__ import annotations

import datetime as dt
import hashlib
from collections.abc import Iterator, Mapping
from typing import Any, Final

from daq_app.campaign.record.number_text import MISSING, figure, moment, said, significant
from daq_app.campaign.record.parts import Grid, Pairs, Part, Section, Signatures, Words
from daq_app.campaign.record.source import RecordSource
from daq_app.config import Rig
from daq_app.config.rig import Channel
from daq_app.config.wording import signed
from daq_app.runfile.seal.format import Seal
from daq_app.runfile.seal.signing import made_here, signature_is_good
from daq_app.runfile.seal.trust import trusted_as

_QUIET: Final = frozenset({"impact", "note", "marker", "result"})
"""Events that have a table of their own, or that tell of the test before."""
_DEVIATIONS: Final = frozenset(
    {"clock", "channel", "travel", "overload", "alarm", "disk", "gap", "backup", "rate"}
)
"""Kinds of events that a reader must weigh."""
_ROLES: Final = ("Operator", "Test leader", "Checked by")


def course_section(source: RecordSource) -> Section:
    """What happened when, on the clock of the samples and on the wall."""
    released = source.event("released", "rocking")
    rows = []
    for event in source.events:
        if event.kind in _QUIET:
            continue
        at = source.seconds(event.sample)
        since = figure(at - source.seconds(released.sample), 2) if released is not None else MISSING
        clock = (source.start_utc + dt.timedelta(seconds=at)).strftime("%H:%M:%S.%f")[:-4]
        rows.append((clock, figure(at, 2), since, event.kind.replace("_", " "), event.text))
    if not rows:
        return Section("6  Course of the test", [Words("The run holds no record of its course.")])
    impacts = sum(event.kind == "impact" for event in source.events)
    parts: list[Part] = [
        Grid(
            ("UTC", "s", "s after release", "Event", "In words"),
            tuple(rows),
            (1.5, 1.0, 1.3, 1.3, 5.5),
            small=True,
        )
    ]
    if impacts:
        parts.append(Words(f"{impacts} impacts were seen while it was recorded; section 5 has the analysis."))
    return Section("6  Course of the test", parts)


def deviations_section(source: RecordSource) -> Section:
    """All by which the test or its record is not as it should be; it says so where there is nothing."""
    lines = [*_of_the_record(source), *_of_the_test(source), *_of_the_sensors(source)]
    if not lines:
        return Section("7  Deviations", [Words("None.", "good")])
    return Section("7  Deviations", [Words(f"•  {line}") for line in dict.fromkeys(lines)])


def _of_the_record(source: RecordSource) -> Iterator[str]:
    yield from (f"The file: {problem}" for problem in source.report.problems)
    for gap in source.gaps:
        start, length = source.seconds(gap.first_sample), gap.n_samples / source.header.rate_hz
        missing = (
            f"{gap.n_samples} samples of each channel are missing from {start:.3f} s on ({length:.3f} s)"
        )
        yield f"{missing}: {gap.reason}"
    if not source.attributes.closed_in_good_order:
        yield "The recorder was cut off; the run was recovered from its journal"
    yield from (f"The journal was damaged: {line}" for line in source.attributes.damage.splitlines())


def _of_the_test(source: RecordSource) -> Iterator[str]:
    quality = source.results.get("quality")
    reasons = quality.get("reasons") if isinstance(quality, dict) else None
    yield from (str(reason) for reason in reasons or ())
    for event in source.events:
        if event.kind in _DEVIATIONS and event.data.get("severity") != "info":
            yield event.text


def _of_the_sensors(source: RecordSource) -> Iterator[str]:
    if source.rig is None:
        yield "The rig file kept in the run is not understood by this version: no engineering units"
        return
    day = source.start_utc.date()
    expired = [channel.id for channel in source.rig.channels if channel.certificate.due < day]
    if expired:
        yield f"Certificates were out of date on {day}: {', '.join(expired)}"
    assumed = sorted({key for channel in source.rig.channels for key in channel.assumed})
    if assumed:
        yield f"The rig file says of these values of its sensors that they are assumed: {', '.join(assumed)}"


def sensors_section(source: RecordSource) -> Section:
    """The rig, its hardware, and every sensor with its certificate and its zero."""
    rig = source.rig
    if rig is None:
        rows = tuple(
            (channel_id, unit)
            for channel_id, unit in zip(source.header.channel_ids, source.header.reading_units, strict=True)
        )
        return Section(
            "8  Rig and sensors", [Grid(("Channel", "Unit of the reading"), rows, (2.0, 5.0), small=True)]
        )
    channels = [channel for channel in rig.channels if channel.id in source.header.channel_ids]
    missing = [channel.id for channel in rig.channels if channel.id not in source.header.channel_ids]
    parts: list[Part] = [Pairs(tuple(_rig_rows(source, rig)))]
    if missing:
        parts.append(Words(f"Not recorded in this run: {', '.join(missing)}", "warning"))
    day = source.start_utc.date()
    parts.append(
        Grid(
            ("Channel", "Terminal", "Sensitivity", "Range, SI", "Certificate", "Due", "Zero", "Noise, SI"),
            tuple(
                _sensor_row(channel, source.header.tare, source.header.tare_record, day)
                for channel in channels
            ),
            (1.5, 2.3, 2.0, 2.4, 2.2, 1.9, 1.8, 1.6),
            small=True,
        )
    )
    parts.append(
        Words(
            "Zero: reading of the wall upright beyond the certificate's offset, in the unit of the reading. "
            "Noise: scatter while the zero was taken. ✗: the certificate was out of date on that day."
        )
    )
    return Section("8  Rig and sensors", parts)


def _rig_rows(source: RecordSource, rig: Rig) -> Iterator[tuple[str, str]]:
    specimen = rig.specimen
    yield "Rig", f"{rig.name}: {rig.description}" if rig.description else rig.name
    yield (
        "Specimen",
        f"{specimen.name}: W = {specimen.weight_n / 1e3:g} kN, R = {specimen.r0_m:g} m, "
        f"I = {specimen.rotational_inertia_kg_m2:g} kg m², α = {specimen.alpha0_rad:g} rad, "
        f"p = {specimen.p_rad_s:g} rad/s" + (f" ({specimen.source})" if specimen.source else ""),
    )
    yield "Rate", f"{source.header.rate_hz:g} Hz, read back from the hardware"
    devices = source.header.opened.get("devices")
    for number, device in enumerate(devices if isinstance(devices, list) else []):
        if isinstance(device, dict):
            kind = "simulated" if device.get("simulated") else f"serial {device.get('serial') or MISSING}"
            yield "Hardware" if number == 0 else "", f"{device.get('name')}: {device.get('product')}, {kind}"

    yield from _told_by_the_hardware(source.header.opened)


def _told_by_the_hardware(opened: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Data sheets (TEDS) of sensors and timing modes of converters, as far as the hardware has them."""
    sheets, modes = opened.get("data_sheets"), opened.get("adc_timing")
    for name, sheet in sheets.items() if isinstance(sheets, dict) else ():
        if isinstance(sheet, dict):
            yield (
                "Data sheet (TEDS)",
                f"{name}: maker {sheet.get('manufacturer')}, model {sheet.get('model')}, "
                f"version {sheet.get('version')}, serial {sheet.get('serial')}",
            )
    if isinstance(modes, dict) and modes:
        yield "Converter timing", ", ".join(f"{name}: {mode}" for name, mode in modes.items())


def _sensor_row(
    channel: Channel, tare: Mapping[str, float], record: Mapping[str, Any], day: dt.date
) -> tuple[str, ...]:
    scatter = record.get("scatter_si")
    noise = scatter.get(channel.id) if isinstance(scatter, dict) else None
    low, high = channel.range_si
    certificate = channel.certificate
    return (
        channel.id,
        channel.physical_channel,
        f"{signed(channel.polarity * channel.sensitivity)} {channel.sensitivity_unit}",
        f"{signed(low)} … {signed(high)} {channel.si_unit}",
        certificate.number,
        f"{certificate.due}" + (" ✗" if certificate.due < day else ""),
        f"{figure(tare.get(channel.id), 4)} {channel.reading_unit}",
        significant(noise, 2),
    )


def proof_section(source: RecordSource) -> Section:
    """Files, hashes, signature, versions: what shows years later that nothing was changed."""
    attributes, seal = source.attributes, source.seal
    rows = [
        (
            "Run file",
            f"{source.path.name}, {source.path.stat().st_size} bytes, format {attributes.format_version}",
        ),
        ("SHA-256 of the file", source.file_sha256),
        ("SHA-256 of readings", attributes.raw_sha256),
        ("SHA-256 of the rig", hashlib.sha256(source.header.rig_text.encode()).hexdigest()),
        ("Made from", f"{attributes.source_name}, {attributes.source_bytes} bytes"),
    ]
    if seal is None:
        rows.append(("Seal", "none: a run of format version 1"))
    else:
        rows.append(("Seal, root", seal.root.hex()))
        if not seal.public_key:
            rows.append(("Signature", "not signed"))
        else:
            good = "good" if signature_is_good(seal) else "WRONG: the file was sealed by somebody else"
            rows += [
                ("Signature", f"{good}, {_signer(seal)}"),
                ("Key of the recorder", seal.public_key.hex()),
            ]
    proven = f"{source.report.proven} proven" if source.report.proven else "nothing proven"
    verified = f"{'good' if source.report.ok else 'BAD'}, {proven}, {moment(source.made_utc)}"
    rows.append(("Verified", f"{verified}; {source.attributes.lost_samples} samples missing"))
    rows += [("Note", note) for note in source.report.notes]
    rows += [
        ("Version" if n == 0 else "", f"{name} {value}")
        for n, (name, value) in enumerate(source.header.versions.items())
    ]
    rows.append(("Run id", source.header.run_id))
    rows.append(("Task notes", said("; ".join(_task_notes(source.header.plan)))))
    return Section("9  Files, hashes and versions", [Pairs(tuple(rows))])


def _signer(seal: Seal) -> str:
    if made_here(seal):
        return "by this recorder"
    name = trusted_as(seal)
    return f"by the trusted recorder {name}" if name is not None else "by a recorder that is not trusted here"


def _task_notes(plan: Mapping[str, Any]) -> list[str]:
    notes = plan.get("notes")
    return [
        f"{note.get('where', '')}: {note.get('text', '')}"
        for note in (notes if isinstance(notes, list) else [])
        if isinstance(note, dict) and note.get("severity") != "info"
    ]


def signatures_section() -> Section:
    """Who vouches for it."""
    return Section("10  Signatures", [Signatures(_ROLES)])
