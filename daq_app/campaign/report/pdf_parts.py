"""One PDF from several, page after page."""

from __future__ import annotations

import io
from collections.abc import Sequence

from pypdf import PdfReader, PdfWriter


def joined(parts: Sequence[bytes]) -> bytes:
    """All pages in the order of the parts; title and date of the document are those of the first."""
    document = PdfWriter(clone_from=io.BytesIO(parts[0]))
    for part in parts[1:]:
        document.append(PdfReader(io.BytesIO(part)), import_outline=False)
    buffer = io.BytesIO()
    document.write(buffer)
    return buffer.getvalue()
