"""Pages in HTML: what somebody typed is text in them, and every character of it is seen."""

from __future__ import annotations

from jinja2 import Environment, PackageLoader, select_autoescape
from markupsafe import Markup

from daq_app.config.shown_text import visible


def page_environment(package: str = "daq_app.campaign") -> Environment:
    """Templates of a package; tags are escaped, characters without a picture shown by their code."""
    return Environment(
        loader=PackageLoader(package),
        autoescape=select_autoescape(),
        trim_blocks=True,
        finalize=_shown,
    )


def _shown(value: object) -> object:
    """Strings that are no markup of ours."""
    return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value
