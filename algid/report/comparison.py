"""Results side by side: how far apart in σ, and which settings differ; on a page with a figure."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
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
from algid.report.tables import flat_settings
from algid.results import Estimate, Result
from algid.results.rows import row_of

NAME = "compare.html"
FAR = sigmas()
"""σ, beyond which chance does not explain a difference."""
COLOURS = (BLUE, ORANGE, GREEN, RED, GREY)
SYMBOLS = ("circle", "square", "diamond", "x", "cross")


@dataclass(frozen=True, repr=False)
class Comparison:
    """Results side by side; the first one is what the others are measured against."""

    labels: tuple[str, ...]
    results: tuple[Result, ...]

    def __repr__(self) -> str:
        far = self.largest_sigma
        largest = "no distance" if far is None else f"the largest distance {far:.1f} σ"
        return f"Comparison({', '.join(self.labels)}: {largest})"

    @cached_property
    def by_name(self) -> dict[str, list[Estimate | None]]:
        """The estimates of each parameter that any of the results has."""
        names = dict.fromkeys(name for one in self.results for name in one.estimates)
        return {name: [one.estimates.get(name) for one in self.results] for name in names}

    @cached_property
    def sigma(self) -> dict[str, tuple[float | None, ...]]:
        """By parameter the distance of each other result from the first one, in σ."""
        pairs = self.by_name.items()
        return {name: tuple(distance(first, one) for one in rest) for name, (first, *rest) in pairs}

    @cached_property
    def far(self) -> list[tuple[float, str]]:
        """The size of each distance that is known, the largest first, and what it is of."""
        found = []
        for name, row in self.sigma.items():
            for label, far in zip(self.labels[1:], row, strict=True):
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
        every = list(map(_settings, self.results))
        names = dict.fromkeys(name for settings in every for name in settings)
        rows = {name: [settings.get(name, ABSENT) for settings in every] for name in names}
        return {name: values for name, values in rows.items() if len(set(values)) > 1}

    def tables(self) -> tuple[Table, Table]:
        """The estimates one below the other, as wide for many results as for two; the settings."""
        estimates, settings = [], []
        for name, several in self.by_name.items():
            first = several[0]
            for label, one, far in zip(
                self.labels, several, (None, *self.sigma[name]), strict=True
            ):
                if one is None:
                    continue
                row, change = row_of(name, one), ABSENT
                if one is not first and first and first.estimate and one.estimate is not None:
                    change = percent(one.estimate - first.estimate, first.estimate, 3)
                number = (row.with_half, row.unit, row.status)
                estimates.append((row.name, label, *number, formatted(far, "+.1f"), change))
        for name, values in self.settings.items():
            for label, value in zip(self.labels, values, strict=True):
                settings.append((visible(name), label, visible(value)))
        note = f"Differences are against {self.labels[0]}; ± is 95 %, σ combines both intervals."
        same = "Every setting is the same, and every log was read the same way."
        return (
            Table(
                "Estimates side by side",
                "Parameter | Result | Estimate | Unit | Status | Δ/σ | Δ %",
                tuple(estimates),
                note,
            ),
            Table(
                "Settings that differ",
                "Setting | Result | Value",
                tuple(settings),
                "" if settings else same,
            ),
        )

    def as_json(self) -> str:
        """Estimates, 95 % intervals and distances in σ as the text of a JSON file."""
        parameters = {}
        for name, several in self.by_name.items():
            numbers = {
                key: [None if one is None else getattr(one, key) for one in several]
                for key in ("estimate", "std", "ci95")
            }
            parameters[name] = numbers | {"sigma": [None, *self.sigma[name]]}
        content = {"labels": self.labels, "parameters": parameters, "settings": self.settings}
        return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def compare(results: Sequence[Result], labels: Sequence[str] | None = None) -> Comparison:
    """Lay two `results` or more side by side.

    `labels` are what to call them, by default the names of their first logs.
    """
    shown = list(map(visible, labels or [file_name(result.log.path) for result in results]))
    if len(set(shown)) < len(shown):
        shown = [f"{number} {label}" for number, label in enumerate(shown, start=1)]
    return Comparison(tuple(shown), tuple(results))


def distance(first: Estimate | None, other: Estimate | None) -> float | None:
    """Signed distance of `other` from `first` over their combined half intervals, in σ.

    Of normal intervals that is their combined standard deviation. Of Student's it is larger, so
    that 95 % of the differences that chance makes lie within 1.96 of either.
    """
    if first is None or other is None or first.estimate is None or other.estimate is None:
        return None
    if first.half is None or other.half is None:
        return None
    combined = math.hypot(first.half, other.half) / NORMAL
    return (other.estimate - first.estimate) / combined if combined else None


def _settings(result: Result) -> dict[str, str]:
    """How a result was made: its settings, and how the first log of each kind was read."""
    settings = flat_settings(result.settings)
    settings.pop("command", None)  # it names the logs, and says again what is set
    settings |= {"estimator": result.estimator, "algid": result.version}
    for log in reversed(result.logs):
        if log.reading is not None:
            for name, text in flat_settings(asdict(log.reading)).items():
                # who said so is no difference
                if not name.endswith("told"):
                    settings[f"{log.role} log: {name.removeprefix('channels.')}"] = text or ABSENT
    return settings


def write_comparison(found: Comparison, path: Path, force: bool) -> None:
    """Write the page of a comparison.

    Raises
    ------
    OutputError
        If it cannot be written, or exists and `force` is not set.
    """
    names, (estimates, settings) = found.labels, found.tables()
    figures = [_distances(found)] if found.far else []
    document = Document(
        title="Comparison",
        verdict=verdict(found),
        sections=(
            Section("numbers", "Differences", (*figures, estimates)),
            Section("settings", "Settings that differ", (settings,)),
        ),
        kicker="results side by side",
        name=joined(list(names)) if len(names) < 4 else f"{names[0]} and {len(names) - 1} more",
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
        more = f" and {len(beyond) - 3} more" if len(beyond) > 3 else ""
        differ = "differs" if len(beyond) == 1 else "differ"
        headline = f"{joined(beyond[:3])}{more} {differ} by more than {FAR:.2g} σ"
        return Verdict("reservations", headline, title="Different")
    inside = sum(size <= NORMAL for size, _ in found.far)
    within = f"{inside} of {counted(len(found.far), 'difference')} within {NORMAL:.2f} σ"
    return Verdict("good", f"{within}; the largest is {found.far[0][1]}")


def _distances(found: Comparison) -> Plot:
    """How far each result is from the first, in σ of both intervals."""
    names = [name for name, row in found.sigma.items() if set(row) != {None}]
    panels = Panels([f"Distance from {found.labels[0]}, σ"], height=70 + 24 * len(names))
    for place, label in enumerate(found.labels[1:]):
        far = np.array([found.sigma[name][place] for name in names], dtype=np.float64)
        look = COLOURS[place % len(COLOURS)], 8, SYMBOLS[place % len(SYMBOLS)]
        panels.dots(0, far, names, label, *look)
    reach = max(1.1 * (found.largest_sigma or 0.0), 4.0)
    panels.axes(0, {"range": [-reach, reach]}, names_down(names))
    panels.stretch(0, -NORMAL, NORMAL, BLUE)
    reading = f"Within the band, ± {NORMAL:.2f} σ, chance alone puts 19 of 20 differences."
    return Plot("distances", "Distances in σ", panels, reading)
