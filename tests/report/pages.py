"""A page taken apart again: its tables, its figures' numbers, its tags."""

from __future__ import annotations

import base64
import gzip
import json
import re
from dataclasses import dataclass, field
from html.parser import HTMLParser
from typing import Any

import numpy as np

from algid.arm import FloatArray


@dataclass
class Page(HTMLParser):
    """Tables by caption, each the heads and the rows of their cells; tags with attributes."""

    text: str
    tables: dict[str, tuple[list[str], list[list[str]]]] = field(default_factory=dict)
    tags: list[tuple[str, dict[str, str]]] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()
        self._kept: list[str] | None = None
        self._row: list[str] = []
        self.feed(self.text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, {name: value or "" for name, value in attrs}))
        if tag in ("caption", "th", "td"):
            self._kept = []
        elif tag == "tr":
            self._row = []

    def handle_data(self, data: str) -> None:
        if self._kept is not None:
            self._kept.append(data)

    def handle_endtag(self, tag: str) -> None:
        if tag in ("caption", "th", "td") and self._kept is not None:
            text, self._kept = "".join(self._kept), None
            if tag == "caption":
                self.tables[text] = [], []
            else:
                self._row.append(text)
        elif tag == "tr":
            heads, rows = list(self.tables.values())[-1]
            if heads:
                rows.append(self._row)
            else:
                heads += self._row

    @property
    def figures(self) -> dict[str, Any]:
        """Data and layout of each figure, and the frames of the arm."""
        packed = re.search(r'id="figures">([^<]*)<', self.text)
        assert packed is not None
        found: dict[str, Any] = json.loads(gzip.decompress(base64.b64decode(packed[1])))
        return found

    @property
    def prose(self) -> str:
        """The page less scripts and style."""
        return re.sub(r"<(script|style)[^>]*>.*?</\1>", "", self.text, flags=re.DOTALL)


def typed(packed: Any) -> FloatArray:
    """Numbers of a typed array, or of a list."""
    if not isinstance(packed, dict):
        return np.array(packed, dtype=np.float64)
    values = np.frombuffer(base64.b64decode(packed["bdata"]), f"<{packed['dtype']}").astype(float)
    shape = packed.get("shape")
    return values.reshape(tuple(map(int, shape.split(",")))) if shape else values


def named(data: list[dict[str, Any]], name: str) -> list[dict[str, Any]]:
    """The traces of that name."""
    return [trace for trace in data if trace["name"] == name]
