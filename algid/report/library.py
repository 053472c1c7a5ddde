"""The plotting library of a page: packed, and unpacked by the page itself.

A build with npm at hand leaves plotly's bundle for figures with two axes among the assets; without it the whole
library comes out of the package `plotly`.
"""

from __future__ import annotations

import base64
import gzip
from dataclasses import dataclass
from functools import cache
from importlib import resources

BUNDLE = "plotly.min.js.gz"


@dataclass(frozen=True)
class Library:
    """A script, and the same in gzip and base64."""

    script: str
    packed: str


@cache
def library() -> Library:
    """The library that this installation has."""
    asset = resources.files("algid.report") / "assets" / BUNDLE
    content = asset.read_bytes() if asset.is_file() else _whole()
    return Library(gzip.decompress(content).decode(), base64.b64encode(content).decode())


def _whole() -> bytes:
    from plotly.offline import get_plotlyjs

    return gzip.compress(get_plotlyjs().encode(), mtime=0)
