"""README of a published campaign: what a stranger must know to use the data without any program of ours."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from daq_app.campaign.description import Publication
from daq_app.campaign.publication.metadata import cited
from daq_app.campaign.publication.record import PublishedTest
from daq_app.config import Rig
from daq_app.config.families import AUXILIARY

_FAMILIES = {
    "lvdt": "LVDTs across the base joint",
    "wire": "wire potentiometers to a fixed frame",
    "accelerometer": "accelerometers",
    "tiltmeter": "tiltmeter axes",
    **{name: family.plural for name, family in AUXILIARY.items()},
}


def readme(
    publication: Publication,
    tests: Sequence[PublishedTest],
    rigs: Mapping[str, Rig],
    files: Mapping[str, str],
    left_out: Sequence[str],
) -> str:
    """Markdown. `files`: path → what it is; `left_out`: recordings that could not be read, in words."""
    creators = "\n".join(
        f"- {c.given_name} {c.family_name}"
        + (f", {c.affiliation}" if c.affiliation else "")
        + (f", https://orcid.org/{c.orcid}" if c.orcid else "")
        for c in publication.creators
    )
    parts = [
        f"# {publication.title}\n\n{publication.abstract}",
        f"## How to cite\n\n{cited(publication)}",
        f"## Creators\n\n{creators}",
        f"## Licence\n\n{publication.licence}: {publication.licence_page or 'see LICENCE.txt'}",
        _instrument(rigs),
        _method(publication),
        _tests(tests, left_out),
        _files(files),
        _OPEN,
    ]
    if publication.funding:
        paid = "\n".join(
            f"- {one.funder}" + (f": {one.award}" if one.award else "") for one in publication.funding
        )
        parts.insert(4, f"## Funding\n\n{paid}")
    if publication.related:
        papers = "\n".join(f"- https://doi.org/{doi}" for doi in publication.related)
        parts.append(f"## Papers that these data belong to\n\n{papers}")
    if publication.contact:
        parts.append(f"## Contact\n\n{publication.contact}")
    return "\n\n".join(parts) + "\n"


def _instrument(rigs: Mapping[str, Rig]) -> str:
    lines = ["## Instrument"]
    for name, rig in rigs.items():
        counts = Counter(channel.family for channel in rig.channels)
        sensors = ", ".join(f"{n} {_FAMILIES[family]}" for family, n in counts.items())
        wall = rig.specimen
        lines.append(
            f"{wall.name} (`{name}`): wall {wall.height_m:g} m high, {wall.base_width_m:.3f} m thick, "
            f"{wall.length_m:g} m long, weight {wall.weight_n / 1e3:g} kN, α = {wall.alpha0_rad:g} rad, "
            f"p = {wall.p_rad_s:g} rad/s. {len(rig.channels)} channels at "
            f"{rig.acquisition.rate_hz:g} Hz: {sensors}. Positions, sensitivities and "
            "certificates are in `tables/channels.csv`."
        )
    lines.append(
        "Frame of all positions: origin at the centre of the wall's base, x through the thickness, "
        "y along the length, z upwards. A positive rotation tilts the top towards +x."
    )
    return "\n\n".join(lines)


def _method(publication: Publication) -> str:
    text = (
        "The wall is pulled to a rotation, held, released, and rocks to rest. Restitution r is the ratio of "
        "the angular velocities after and before an impact."
    )
    return f"## Method\n\n{text}" + (f"\n\n{publication.method}" if publication.method else "")


def _tests(tests: Sequence[PublishedTest], left_out: Sequence[str]) -> str:
    verdicts = Counter(test.recorded.verdict.value for test in tests)
    counted = ", ".join(f"{n} {verdict}" for verdict, n in sorted(verdicts.items()))
    text = f"## Tests\n\n{len(tests)} recorded releases ({counted}); `tables/tests.csv` has a row for each."
    if left_out:
        text += "\n\nRecordings that could not be read and are not here:\n\n" + "\n".join(
            f"- {w}" for w in left_out
        )
    return text


def _files(files: Mapping[str, str]) -> str:
    rows = "\n".join(f"| `{path}` | {words} |" for path, words in files.items())
    sums = "`SHA256SUMS` has the SHA-256 of each: `sha256sum -c SHA256SUMS`."
    return f"## Files\n\n| file | what |\n|---|---|\n{rows}\n\n{sums}"


_OPEN = """## How to open the data

Samples are netCDF-4 with CF-1.11 names and units, tables are CSV (UTF-8, comma, decimal point). What each
column means stands in `tables/columns.csv`.

Python:

```python
import pandas, xarray

tests = pandas.read_csv("tables/tests.csv")
run = xarray.open_dataset(tests.data_file[0])
run.rotation.plot()
```

R:

```r
tests <- read.csv("tables/tests.csv")
run <- ncdf4::nc_open(tests$data_file[1])
rotation <- ncdf4::ncvar_get(run, "rotation")
```"""
