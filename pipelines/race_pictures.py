"""Draw the guide's pictures of the race out of the first table of `algid guide measured`.

Usage: python -m pipelines.race_pictures data/pictures
"""

from __future__ import annotations

import re
import sys
from itertools import takewhile
from pathlib import Path

from algid.api.guide import text_of
from pipelines.race_page import svg

PLOTS = {
    "race-errors": ("RMS error over the Cramér-Rao bound", "error over bound", ("simulated",)),
    "race-repeats": ("Real runs repeat to, %", "repeat to, %", ("C.1", "A.0")),
}
"""By picture its title, the column that it shows, and what that column's numbers are of."""


def pictures(text: str) -> dict[str, str]:
    """By name the pictures of a page's first table, as SVG."""
    head, _, *rows = _table(text)
    drawn = {}
    for picture, (title, column, names) in PLOTS.items():
        place = head.index(column)
        series = {row[0]: _figures(row[place], names) for row in rows}
        drawn[picture] = svg(title, series, names)
    return drawn


def _table(text: str) -> list[list[str]]:
    """The cells of the first table, by rows."""
    lines = text[text.index("\n|") + 1 :].splitlines()
    rows = takewhile(lambda line: line.startswith("|"), lines)
    return [[cell.strip() for cell in row.strip("|").split("|")] for row in rows]


def _figures(cell: str, names: tuple[str, ...]) -> dict[str, float]:
    """A cell's numbers by name; none where it has a dash."""
    numbers = [float(number) for number in re.findall(r"[\d.]+", cell)]
    return dict(zip(names, numbers, strict=True)) if numbers else {}


if __name__ == "__main__":
    for name, picture in pictures(text_of("measured")).items():
        (Path(sys.argv[1]) / f"{name}.svg").write_text(picture, encoding="utf-8")
