"""Results side by side: how far apart in σ, and which settings differ; on a page with a figure."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from algid import __version__
from algid.base.files import whole_file
from algid.base.significance import NORMAL, sigmas
from algid.base.text import ABSENT, file_name, formatted, joined, percent, visible
from algid.base.verdict import Verdict
from algid.base.words import counted
from algid.report.document import Document, Section, Table
from algid.report.plot import BLUE, GREEN, GREY, ORANGE, RED, Panels, Plot, names_down
from algid.report.render import page
from algid.report.tables import settings_of
from algid.results import Result
from algid.results.rows import row_of

NAME = "compare.html"
FAR = sigmas()
"""σ, beyond which chance does not explain a difference."""
COLOURS = (BLUE, ORANGE, GREEN, RED, GREY)
SYMBOLS = ("circle", "square", "diamond", "x", "cross")


@dataclass(frozen=True, repr=False)
class Comparison:
    """Results side by side; the first one is what the others are measured against."""

    labels: Sequence[str]
    results: Sequence[Result]

    def __repr__(self) -> str:
        return f"Comparison({', '.join(self.labels)}: {verdict(self).headline})"

    @cached_property
    def sigma(self) -> dict[str, list[float | None]]:
        """By parameter of any result the distance of each from the first one, in σ."""
        names = dict.fromkeys(name for one in self.results for name in one.estimates)
        return {
            name: [distance(self.results[0], one, name) for one in self.results] for name in names
        }

    @cached_property
    def far(self) -> list[tuple[float, str]]:
        """The size of each distance that is known, the largest first, and what it is of."""
        found = []
        for name, row in self.sigma.items():
            for label, far in zip(self.labels, row, strict=True):
                if far is not None:
                    found.append((abs(far), f"{visible(name)} of {label} ({far:+.1f} σ)"))
        return sorted(found, reverse=True)

    @property
    def largest_sigma(self) -> float | None:
        """The largest distance, None where there is none."""
        return self.far[0][0] if self.far else None

    @cached_property
    def settings(self) -> dict[str, list[str]]:
        """What was set otherwise, and how the first log of each kind was read otherwise."""
        every = []
        for one in self.results:
            every.append(settings_of(one) | {"estimator": one.estimator, "algid": one.version})
        differ = dict[str, list[str]]()
        for name in dict.fromkeys(name for settings in every for name in settings):
            values = [settings.get(name, ABSENT) for settings in every]
            # a command names the logs and says again what is set; who told is no difference
            aside = name == "command" or name.startswith("used.") or name.endswith("told")
            if not aside and len(set(values)) > 1:
                differ[name] = values
        return differ

    def tables(self) -> tuple[Table, Table]:
        """The estimates one below the other, as wide for many results as for two; the settings."""
        estimates, settings = [], []
        for name, row in self.sigma.items():
            first = self.results[0].estimates.get(name)
            for label, result, far in zip(self.labels, self.results, row, strict=True):
                one, change = result.estimates.get(name), ABSENT
                if one is None:
                    continue
                if far is not None and first and first.estimate and one.estimate is not None:
                    change = percent(one.estimate - first.estimate, first.estimate, 3)
                of = row_of(name, one)
                number = (of.with_half, of.unit, of.status)
                estimates.append((of.name, label, *number, formatted(far, "+.1f"), change))
        for name, values in self.settings.items():
            for label, value in zip(self.labels, values, strict=True):
                settings.append((visible(name), label, visible(value)))
        note = f"Differences are against {self.labels[0]}; ± is 95 %, σ combines both intervals."
        same = "Every setting is the same, and every log was read the same way."
        columns = "Parameter | Result | Estimate | Unit | Status | Δ/σ | Δ %"
        return (
            Table("Estimates side by side", columns, estimates, note),
            Table(
                "Settings that differ",
                "Setting | Result | Value",
                settings,
                "" if settings else same,
            ),
        )

    def as_json(self) -> str:
        """Estimates, 95 % intervals and distances in σ as the text of a JSON file."""
        parameters = {}
        for name, row in self.sigma.items():
            several = [one.estimates.get(name) for one in self.results]
            keys = ("estimate", "std", "ci95")
            numbers = {key: [getattr(one, key, None) for one in several] for key in keys}
            parameters[name] = numbers | {"sigma": row}
        content = {"labels": self.labels, "parameters": parameters, "settings": self.settings}
        return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def compare(results: Sequence[Result], labels: Sequence[str] | None = None) -> Comparison:
    """Lay two `results` or more side by side.

    `labels` are what to call them, by default the names of their first logs.
    """
    shown = list(map(visible, labels or [file_name(result.log.path) for result in results]))
    if len(set(shown)) < len(shown):
        shown = [f"{number} {label}" for number, label in enumerate(shown, start=1)]
    return Comparison(shown, results)


def distance(first: Result, other: Result, name: str) -> float | None:
    """Signed distance of a parameter of `other` from `first` over combined half intervals, in σ.

    Of normal intervals that is their combined standard deviation. Of Student's it is larger, so
    that 95 % of the differences that chance makes lie within 1.96 of either.
    """
    values, halves = [], []
    for one in (first.estimates.get(name), other.estimates.get(name)):
        if first is not other and one and one.estimate is not None and one.half is not None:
            values.append(one.estimate)
            halves.append(one.half)
    combined = math.hypot(*halves) / NORMAL
    return (values[1] - values[0]) / combined if len(values) == 2 and combined else None


def write_comparison(found: Comparison, path: Path, force: bool) -> None:
    """Write the page of a comparison.

    Raises
    ------
    OutputError
        If it cannot be written, or exists and `force` is not set.
    """
    names, (estimates, settings) = found.labels, found.tables()
    figure = _distances(found) if found.far else None
    document = Document(
        title="Comparison",
        verdict=verdict(found),
        sections=(
            Section("numbers", "Differences", (figure, estimates)),
            Section("settings", "Settings that differ", (settings,)),
        ),
        kicker="results side by side",
        name=joined(names, 3),
        facts=f"{counted(len(names), 'result')} · measured against {names[0]}",
        made=f"Made by algid {__version__}.",
    )
    with whole_file(path, force=force) as temporary:
        temporary.write_text(page(document), encoding="utf-8")


def verdict(found: Comparison) -> Verdict:
    """Whether the results agree: distances beyond `FAR` are named, the largest first."""
    if not found.far:
        return Verdict("reservations", "no parameter has error bars in two results")
    beyond = [words for size, words in found.far if size > FAR]
    if beyond:
        headline = f"more than {FAR:.2g} σ apart: {joined(beyond, 3)}"
        return Verdict("reservations", headline, title="Different")
    inside = sum(size <= NORMAL for size, _ in found.far)
    within = f"{inside} of {counted(len(found.far), 'difference')} within {NORMAL:.2f} σ"
    return Verdict("good", f"{within}; the largest is {found.far[0][1]}")


def _distances(found: Comparison) -> Plot:
    """How far each result is from the first, in σ of both intervals."""
    rows = {name: row for name, row in found.sigma.items() if any(far is not None for far in row)}
    panels = Panels([f"Distance from {found.labels[0]}, σ"], height=70 + 24 * len(rows))
    for place, far in enumerate(np.array(list(rows.values()), dtype=np.float64).T[1:]):
        look = COLOURS[place % len(COLOURS)], 8, SYMBOLS[place % len(SYMBOLS)]
        panels.dots(0, far, list(rows), found.labels[place + 1], *look)
    reach = max(1.1 * found.far[0][0], 4.0)
    panels.axes(0, {"range": [-reach, reach]}, names_down(list(rows)))
    panels.mark(0, -NORMAL, NORMAL, colour=BLUE)
    reading = f"Within the band, ± {NORMAL:.2f} σ, chance alone puts 19 of 20 differences."
    return Plot("distances", "Distances in σ", panels, reading)
