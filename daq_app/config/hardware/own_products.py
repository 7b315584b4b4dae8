"""Products of a rig's own, from the product files that it names."""

from __future__ import annotations

from functools import lru_cache

from daq_app.config.hardware.product_files import ProductSet, product_set
from daq_app.config.rig import Hardware
from daq_app.config.toml_file import parse_toml


def own_products(hardware: Hardware) -> ProductSet:
    """Products and chassis of the rig's own files; the same objects each time, as products are compared."""
    return _product_set(hardware.product_texts)


@lru_cache(maxsize=32)
def _product_set(texts: tuple[str, ...]) -> ProductSet:
    return product_set([parse_toml(text, "product file") for text in texts])
