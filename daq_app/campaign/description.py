"""What a campaign file says for its publication: who made the data, their licence, fields of each test.

Identifiers are those of the DataCite metadata schema 4 and of RO-Crate 1.1.
"""

from __future__ import annotations

import datetime as dt
from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

LICENCES: Final = {
    "CC-BY-4.0": "https://creativecommons.org/licenses/by/4.0/",
    "CC-BY-SA-4.0": "https://creativecommons.org/licenses/by-sa/4.0/",
    "CC-BY-NC-4.0": "https://creativecommons.org/licenses/by-nc/4.0/",
    "CC0-1.0": "https://creativecommons.org/publicdomain/zero/1.0/",
    "ODbL-1.0": "https://opendatacommons.org/licenses/odbl/1-0/",
    "ODC-By-1.0": "https://opendatacommons.org/licenses/by/1-0/",
    "PDDL-1.0": "https://opendatacommons.org/licenses/pddl/1-0/",
}
"""SPDX identifier → page of the licence."""
_Text = Annotated[str, Field(min_length=1, max_length=5000)]
_ORCID: Final = r"^\d{4}-\d{4}-\d{4}-\d{3}[\dX]$"


class _Table(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Creator(_Table):
    """A person who made the data."""

    family_name: _Text
    given_name: _Text
    orcid: Annotated[str, Field(pattern=_ORCID)] | None = None
    affiliation: _Text | None = None

    @field_validator("orcid")
    @classmethod
    def _orcid_holds(cls, orcid: str | None) -> str | None:
        """The last digit is the check of the others (ISO 7064, MOD 11-2)."""
        if orcid is None:
            return None
        digits = orcid.replace("-", "")
        total = 0
        for digit in digits[:-1]:
            total = (total + int(digit)) * 2
        check = (12 - total % 11) % 11
        if digits[-1] != ("X" if check == 10 else str(check)):
            raise ValueError("is no ORCID: its last digit does not fit the others; copy it again")
        return orcid

    @property
    def name(self) -> str:
        return f"{self.family_name}, {self.given_name}"


class Funding(_Table):
    """Who paid."""

    funder: _Text
    award: str = ""
    """Number or title of the grant."""


class Publication(_Table):
    """The table ``[publication]`` of a campaign file."""

    title: _Text
    abstract: _Text
    licence: _Text
    """SPDX identifier."""
    licence_url: Annotated[str, Field(pattern=r"^https?://\S+$")] | None = None
    """Where the licence can be read; known for those of `LICENCES`."""
    creators: Annotated[tuple[Creator, ...], Field(min_length=1)]
    publisher: _Text
    """Repository or institution that keeps the data."""
    published: dt.date
    version: str = "1.0"
    doi: Annotated[str, Field(pattern=r"^10\.\d{4,9}/\S+$")] | None = None
    """DOI that the repository has reserved."""
    method: str = ""
    """How the tests were made, beyond what rig files and runs say."""
    keywords: tuple[_Text, ...] = ()
    funding: tuple[Funding, ...] = ()
    related: tuple[Annotated[str, Field(pattern=r"^10\.\d{4,9}/\S+$")], ...] = ()
    """DOIs of papers that the data belong to."""
    contact: str = ""

    @property
    def licence_page(self) -> str | None:
        """Address of the licence; None where nobody said it."""
        return self.licence_url or LICENCES.get(self.licence)


class FieldSpec(_Table):
    """One thing to be noted of every test: mortar age, temperature, cracks."""

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=40)]
    """Column in ``fields.csv``."""
    title: _Text
    kind: Literal["number", "integer", "text", "date"] = "text"
    unit: str = ""
    required: bool = False


def missing_words(publication: Publication | None) -> list[tuple[str, str]]:
    """What a reader of the data would miss, as (key, sentence); empty where everything is there."""
    if publication is None:
        wanted = "title, abstract, licence, creators, publisher and date"
        return [("publication", f"there is no table [publication] with {wanted}")]
    missing = []
    if publication.licence_page is None:
        known = ", ".join(LICENCES)
        words = f"`{publication.licence}` has no known page: give licence_url, or one of {known}"
        missing.append(("publication.licence", words))
    for index, creator in enumerate(publication.creators):
        if creator.orcid is None:
            missing.append((f"publication.creators[{index}].orcid", f"{creator.name} has no ORCID"))
        if creator.affiliation is None:
            missing.append(
                (f"publication.creators[{index}].affiliation", f"{creator.name} has no affiliation")
            )
    for key, words in (
        ("keywords", "no keywords: nobody finds the data by its subject"),
        ("funding", "no funding is named; say who paid, or that nobody did"),
        ("method", "no method: say what rig files and runs do not"),
        ("contact", "no contact"),
    ):
        if not getattr(publication, key):
            missing.append((f"publication.{key}", words))
    return missing
