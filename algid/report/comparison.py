"""Results side by side: how far apart in σ, and which settings differ; on a page with a figure."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from algid import __version__
from algid.base.files import whole_file
from algid.base.significance import NORMAL, sigmas
from algid.base.text import (
    ABSENT,
    file_name,
    formatted,
    joined,
    resolved,
    significant,
    unit_text,
    visible,
)
from algid.base.verdict import Verdict
from algid.base.words import counted
from algid.report.document import Document, Kind, Section, Table
from algid.report.plot import BLUE, GREEN, GREY, ORANGE, RED, Panels, Plot
from algid.report.render import page
from algid.report.tables import flat_settings
from algid.results import Estimate, LogSummary, Result, Status

NAME = "compare.html"
FAR = sigmas()
"""σ, beyond which chance does not explain a difference."""
LOOKS = tuple(
    zip(
        (BLUE, ORANGE, GREEN, RED, GREY), ("circle", "square", "diamond", "x", "cross"), strict=True
    )
)


@dataclass(frozen=True)
class Comparison:
    """Results side by side: estimates, their distances from the first one's, other settings.

    `sigma` holds, by parameter, the distance of each result from the first; None where either has
    no estimate or no interval.
    """

    labels: tuple[str, ...]
    sigma: dict[str, tuple[float | None, ...]]
    estimates: Table
    settings: Table
    results: tuple[Result, ...] = ()

    def __repr__(self) -> str:
        far = self.largest_sigma
        largest = "no distance" if far is None else f"the largest distance {far:.1f} σ"
        return f"Comparison({', '.join(self.labels)}: {largest})"

    def tables(self) -> tuple[Table, Table]:
        """The estimates side by side, and what was set otherwise."""
        return self.estimates, self.settings

    def as_json(self) -> str:
        """Estimates, 95 % intervals and distances in σ as the text of a JSON file."""
        parameters = {}
        for name, distances in self.sigma.items():
            every = [result.estimates.get(name) for result in self.results]
            parameters[name] = {
                "estimate": [None if one is None else one.estimate for one in every],
                "std": [None if one is None else one.std for one in every],
                "ci95": [None if one is None else one.ci95 for one in every],
                "sigma": (None, *distances),
            }
        count = len(self.labels)
        settings = {}
        for first in range(0, len(self.settings.rows), count):
            rows = self.settings.rows[first : first + count]
            settings[rows[0][0]] = [row[-1] for row in rows]
        content = {"labels": list(self.labels), "parameters": parameters, "settings": settings}
        return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"

    @property
    def largest_sigma(self) -> float | None:
        """The largest distance, None where there is none."""
        return max(map(abs, self.distances()), default=None)

    def distances(self) -> list[float]:
        """Every distance that is known, in the order of the parameters."""
        return [distance for row in self.sigma.values() for distance in row if distance is not None]


def compare(results: Sequence[Result], labels: Sequence[str] | None = None) -> Comparison:
    """Lay `results` side by side; the first one is what the others are measured against.

    Parameters
    ----------
    results : at least two results
    labels : what to call them, by default the names of their first logs

    Raises
    ------
    ValueError
        If there are fewer than two results or not a label each.
    """
    if len(results) < 2:
        raise ValueError(f"a comparison needs at least two results, got {len(results)}")
    if labels is not None and len(labels) != len(results):
        raise ValueError(f"labels must name {counted(len(results), 'result')}, got {len(labels)}")
    shown = list(map(visible, labels or [file_name(result.log.path) for result in results]))
    if len(set(shown)) < len(shown):
        shown = [f"{number} {label}" for number, label in enumerate(shown, start=1)]
    first, sigma = results[0].estimates, dict[str, tuple[float | None, ...]]()
    for name in dict.fromkeys(name for result in results for name in result.estimates):
        others = [result.estimates.get(name) for result in results[1:]]
        sigma[name] = tuple(distance_sigma(first.get(name), other) for other in others)
    tables = _estimates(results, shown, sigma), _settings(results, shown)
    return Comparison(tuple(shown), sigma, *tables, tuple(results))


def distance_sigma(first: Estimate | None, other: Estimate | None) -> float | None:
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


def _estimates(
    results: Sequence[Result], labels: list[str], sigma: dict[str, tuple[float | None, ...]]
) -> Table:
    """The estimates one below the other: as wide for many results as for two."""
    rows = []
    for name, distances in sigma.items():
        first = results[0].estimates.get(name)
        for label, result, far in zip(labels, results, (None, *distances), strict=True):
            one, change = result.estimates.get(name), None
            if one is None:
                continue
            if (
                first is not None
                and one is not first
                and first.estimate
                and one.estimate is not None
            ):
                change = 100 * (one.estimate - first.estimate) / abs(first.estimate)
            off = (formatted(far, "+.1f"), formatted(change, "+.3g"))
            rows.append((visible(name), label, _with_half(one), unit_text(one.unit), *off))
    note = f"Differences are against {labels[0]}; ± is 95 %, σ combines both intervals."
    columns: dict[str, Kind] = {
        "Parameter": "name", "Result": "text", "Estimate": "number", "Unit": "text",
        "Δ/σ": "number", "Δ %": "number",
    }  # fmt: skip
    return Table("Estimates side by side", columns, tuple(rows), note)


def _with_half(estimate: Estimate) -> str:
    """``estimate ± half its 95 % interval``, and the status where it is not OK."""
    text = resolved(estimate.estimate, estimate.std)
    if estimate.half is not None:
        text += f" ± {significant(estimate.half, 2)}"
    if estimate.status != Status.OK:
        text += f" ({estimate.status.value})"
    return text


def _settings(results: Sequence[Result], labels: list[str]) -> Table:
    """What was set otherwise, and how the first log of each kind was read otherwise."""
    roles = set.intersection(*({log.role for log in result.logs} for result in results))
    every = []
    for result in results:
        settings = flat_settings(result.settings)
        settings.pop("command", None)  # it names the logs, and says again what is set
        settings |= {"estimator": result.estimator, "algid": result.version}
        firsts = {log.role: log for log in reversed(result.logs)}
        for role, log in sorted(firsts.items(), reverse=True):  # the unloaded one first
            if role not in roles:
                settings[f"{role} log"] = file_name(log.path)
                continue
            settings |= {f"{role} log: {name}": text for name, text in _read(log).items()}
        every.append(settings)
    rows = []
    for name in dict.fromkeys(name for settings in every for name in settings):
        values = [settings.get(name, ABSENT) for settings in every]
        if len(set(values)) > 1:
            for label, value in zip(labels, values, strict=True):
                rows.append((visible(name), label, visible(value)))
    note = "" if rows else "Every setting is the same, and every log was read the same way."
    columns: dict[str, Kind] = {"Setting": "name", "Result": "text", "Value": "text"}
    return Table("Settings that differ", columns, tuple(rows), note)


def _read(log: LogSummary) -> dict[str, str]:
    """How a log was read, a channel in one cell; who said so is no difference."""
    if log.reading is None:
        return {}
    plain = asdict(log.reading)
    read: dict[str, str] = {}
    for name, one in plain.pop("channels").items():
        # of a velocity the unit is stated as its angle's
        unit = f"{one['unit']}/s" if name.startswith("omega") else one["unit"]
        factor = "" if one["factor"] == 1 else f", times {one['factor']:.6g}"
        offset = "" if one["offset"] == 0 else f", {one['offset']:+.6g}"
        read[name] = f"{one['source']}, {unit}{factor}{offset}"
    del plain["joints_told"]
    return read | {name: text or ABSENT for name, text in flat_settings(plain).items()}


def write_comparison(found: Comparison, path: Path, force: bool) -> None:
    """Write the page of a comparison.

    Raises
    ------
    OutputError
        If it cannot be written, or exists and `force` is not set.
    """
    with whole_file(path, force=force) as temporary:
        temporary.write_text(page(comparison_document(found)), encoding="utf-8")


def comparison_document(found: Comparison) -> Document:
    """The report of a comparison."""
    names, count = found.labels, counted(len(found.results), "result")
    distances = [_distances(found)] if found.distances() else []
    return Document(
        title="Comparison",
        verdict=verdict(found),
        sections=(
            Section("numbers", "Differences", (*distances, found.estimates)),
            Section("settings", "Settings that differ", (found.settings,)),
        ),
        kicker="results side by side",
        name=joined(list(names)) if len(names) < 4 else f"{names[0]} and {len(names) - 1} more",
        facts=f"{count} · measured against {names[0]}",
        made=f"Made by algid {__version__}.",
    )


def verdict(found: Comparison) -> Verdict:
    """Whether the results agree: distances beyond `FAR` are named, the largest first."""
    distances = []
    for name, row in found.sigma.items():
        for other, distance in zip(found.labels[1:], row, strict=True):
            if distance is not None:
                words = f"{visible(name)} of {other} ({distance:+.1f} σ)"
                distances.append((abs(distance), words))
    if not distances:
        return Verdict("reservations", "no parameter has error bars in two results")
    far = [words for size, words in sorted(distances, reverse=True) if size > FAR]
    if far:
        more = f" and {len(far) - 3} more" if len(far) > 3 else ""
        differ = "differs" if len(far) == 1 else "differ"
        headline = f"{joined(far[:3])}{more} {differ} by more than {FAR:.2g} σ"
        return Verdict("reservations", headline, title="Different")
    inside = sum(size <= NORMAL for size, _ in distances)
    within = f"{inside} of {counted(len(distances), 'difference')} within {NORMAL:.2f} σ"
    return Verdict("good", f"{within}; the largest is {max(distances)[1]}")


def _distances(found: Comparison) -> Plot:
    """How far each result is from the first, in σ of both intervals."""
    names = [name for name, row in found.sigma.items() if set(row) != {None}]
    panels = Panels([f"Distance from {found.labels[0]}, σ"], height=70 + 24 * len(names))
    for place, label in enumerate(found.labels[1:]):
        far = np.array([found.sigma[name][place] for name in names], dtype=np.float64)
        colour, symbol = LOOKS[place % len(LOOKS)]
        panels.dots(0, far, names, label, colour, 8, symbol)
    reach = max(1.1 * (found.largest_sigma or 0.0), 4.0)
    order = {"type": "category", "categoryarray": names, "autorange": "reversed"}
    panels.axes(0, {"range": [-reach, reach]}, order)
    panels.stretch(0, -NORMAL, NORMAL, BLUE)
    reading = f"Within the band, ± {NORMAL:.2f} σ, chance alone puts 19 of 20 differences."
    return Plot("distances", "Distances in σ", panels, reading)
