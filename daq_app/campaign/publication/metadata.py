"""Metadata of a published campaign for machines: DataCite 4, RO-Crate 1.1, CITATION.cff."""

from __future__ import annotations

import json
import mimetypes
from collections.abc import Mapping, Sequence
from pathlib import PurePosixPath
from typing import Any, Final

from daq_app.campaign.description import Creator, Publication

_CRATE: Final = "ro-crate-metadata.json"
_ORCID: Final = "https://orcid.org/"
_MEDIA: Final = {".nc": "application/x-netcdf", ".toml": "application/toml", ".h5": "application/x-hdf5"}


def datacite_json(publication: Publication) -> str:
    """Kernel 4 as JSON (https://schema.datacite.org). Without a reserved DOI there is none in it."""
    document: dict[str, Any] = {
        "types": {"resourceTypeGeneral": "Dataset", "resourceType": "Measurements of free-rocking tests"},
        "titles": [{"title": publication.title}],
        "creators": [_datacite_creator(creator) for creator in publication.creators],
        "publisher": {"name": publication.publisher},
        "publicationYear": str(publication.published.year),
        "version": publication.version,
        "language": "en",
        "dates": [{"date": publication.published.isoformat(), "dateType": "Issued"}],
        "descriptions": [{"description": publication.abstract, "descriptionType": "Abstract"}],
        "rightsList": [_rights(publication)],
        "formats": ["application/x-netcdf", "text/csv"],
        "schemaVersion": "http://datacite.org/schema/kernel-4",
    }
    if publication.method:
        document["descriptions"].append({"description": publication.method, "descriptionType": "Methods"})
    if publication.keywords:
        document["subjects"] = [{"subject": word} for word in publication.keywords]
    if publication.funding:
        document["fundingReferences"] = [
            {"funderName": one.funder} | ({"awardNumber": one.award} if one.award else {})
            for one in publication.funding
        ]
    if publication.related:
        document["relatedIdentifiers"] = [
            {"relatedIdentifier": doi, "relatedIdentifierType": "DOI", "relationType": "IsSupplementTo"}
            for doi in publication.related
        ]
    if publication.doi:
        prefix, _, suffix = publication.doi.partition("/")
        document |= {"doi": publication.doi, "prefix": prefix, "suffix": suffix}
        document["identifiers"] = [{"identifier": publication.doi, "identifierType": "DOI"}]
    return _text(document)


def _datacite_creator(creator: Creator) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "name": creator.name,
        "nameType": "Personal",
        "givenName": creator.given_name,
        "familyName": creator.family_name,
    }
    if creator.affiliation:
        entry["affiliation"] = [{"name": creator.affiliation}]
    if creator.orcid:
        entry["nameIdentifiers"] = [
            {
                "nameIdentifier": f"{_ORCID}{creator.orcid}",
                "nameIdentifierScheme": "ORCID",
                "schemeUri": "https://orcid.org",
            }
        ]
    return entry


def _rights(publication: Publication) -> dict[str, str]:
    rights = {
        "rights": publication.licence,
        "rightsIdentifier": publication.licence,
        "rightsIdentifierScheme": "SPDX",
        "schemeUri": "https://spdx.org/licenses/",
    }
    if publication.licence_page:
        rights["rightsUri"] = publication.licence_page
    return rights


def ro_crate_json(publication: Publication, files: Mapping[str, str]) -> str:
    """RO-Crate 1.1 (https://w3id.org/ro/crate/1.1). `files`: path in the folder → what it is, in words."""
    page = publication.licence_page or f"#{publication.licence}"
    people = [_person(creator, number) for number, creator in enumerate(publication.creators)]
    places = {creator.affiliation for creator in publication.creators if creator.affiliation}
    funders = [
        {"@id": f"#funder-{n}", "@type": "Organization", "name": f.funder}
        for n, f in enumerate(publication.funding)
    ]
    publisher = {"@id": "#publisher", "@type": "Organization", "name": publication.publisher}
    root: dict[str, Any] = {
        "@id": "./",
        "@type": "Dataset",
        "name": publication.title,
        "description": publication.abstract,
        "datePublished": publication.published.isoformat(),
        "version": publication.version,
        "license": {"@id": page},
        "author": _one_or_more([{"@id": person["@id"]} for person in people]),
        "publisher": {"@id": "#publisher"},
        "hasPart": [{"@id": path} for path in files],
    }
    if publication.keywords:
        root["keywords"] = ", ".join(publication.keywords)
    if funders:
        root["funder"] = _one_or_more([{"@id": funder["@id"]} for funder in funders])
    if publication.doi:
        root["identifier"] = f"https://doi.org/{publication.doi}"
    if publication.related:
        root["citation"] = _one_or_more([{"@id": f"https://doi.org/{doi}"} for doi in publication.related])
    graph: list[dict[str, Any]] = [
        {
            "@id": _CRATE,
            "@type": "CreativeWork",
            "conformsTo": {"@id": "https://w3id.org/ro/crate/1.1"},
            "about": {"@id": "./"},
        },
        root,
        {
            "@id": page,
            "@type": "CreativeWork",
            "name": publication.licence,
            "identifier": publication.licence,
        },
        publisher,
        *people,
        *({"@id": _place(name), "@type": "Organization", "name": name} for name in sorted(places)),
        *funders,
        *(
            {"@id": f"https://doi.org/{doi}", "@type": "ScholarlyArticle", "name": f"doi:{doi}"}
            for doi in publication.related
        ),
        *(_file(path, words) for path, words in files.items()),
    ]
    return _text({"@context": "https://w3id.org/ro/crate/1.1/context", "@graph": graph})


def _one_or_more(values: list[dict[str, str]]) -> dict[str, str] | list[dict[str, str]]:
    """RO-Crate wants a single value where there is one."""
    return values[0] if len(values) == 1 else values


def _person(creator: Creator, number: int) -> dict[str, Any]:
    person: dict[str, Any] = {
        "@id": f"{_ORCID}{creator.orcid}" if creator.orcid else f"#person-{number}",
        "@type": "Person",
        "name": f"{creator.given_name} {creator.family_name}",
        "givenName": creator.given_name,
        "familyName": creator.family_name,
    }
    if creator.affiliation:
        person["affiliation"] = {"@id": _place(creator.affiliation)}
    return person


def _place(name: str) -> str:
    return "#" + "-".join("".join(letter if letter.isalnum() else " " for letter in name).split())


def _file(path: str, words: str) -> dict[str, Any]:
    suffix = PurePosixPath(path).suffix
    media = _MEDIA.get(suffix) or mimetypes.guess_type(path)[0] or "text/plain"
    return {
        "@id": path,
        "@type": "File",
        "name": PurePosixPath(path).name,
        "description": words,
        "encodingFormat": media,
    }


def citation_cff(publication: Publication) -> str:
    """CITATION.cff 1.2.0, written as JSON, which is YAML too."""
    document: dict[str, Any] = {
        "cff-version": "1.2.0",
        "message": "If you use these data, please cite them as below.",
        "type": "dataset",
        "title": publication.title,
        "abstract": publication.abstract,
        "version": publication.version,
        "date-released": publication.published.isoformat(),
        "authors": [_cff_author(creator) for creator in publication.creators],
        "license": publication.licence,
    }
    if publication.keywords:
        document["keywords"] = list(publication.keywords)
    if publication.doi:
        document["doi"] = publication.doi
    return _text(document)


def _cff_author(creator: Creator) -> dict[str, str]:
    author = {"family-names": creator.family_name, "given-names": creator.given_name}
    if creator.affiliation:
        author["affiliation"] = creator.affiliation
    if creator.orcid:
        author["orcid"] = f"{_ORCID}{creator.orcid}"
    return author


def cited(publication: Publication) -> str:
    """The data as they are cited, in one line."""
    who = "; ".join(creator.name for creator in publication.creators)
    where = f" https://doi.org/{publication.doi}" if publication.doi else ""
    return (
        f"{who} ({publication.published.year}): {publication.title}. Version {publication.version}. "
        f"{publication.publisher}.{where}"
    )


def _text(document: Mapping[str, Any] | Sequence[Any]) -> str:
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"
