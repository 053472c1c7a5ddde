"""Results side by side: how far apart in σ, and which settings differ."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

from algid.report.document import Column, Table
from algid.report.tables import flat_settings
from algid.results import Estimate, Result
from algid.text import ABSENT, file_name, resolved, significant, unit_text, visible
from algid.words import counted


@dataclass(frozen=True)
class Comparison:
    """Results side by side: estimates, their distances from the first one's, other settings.

    `sigma` holds, by parameter, the distance of each result from the first in combined standard
    deviations; None where either has no estimate or no standard deviation.
    """

    labels: tuple[str, ...]
    sigma: dict[str, tuple[float | None, ...]]
    estimates: Table
    settings: Table
    results: tuple[Result, ...] = ()

    def tables(self) -> tuple[Table, Table]:
        """The estimates side by side, and what was set otherwise."""
        return self.estimates, self.settings

    def as_json(self) -> str:
        """The text of a JSON file: see `comparison_json`."""
        return comparison_json(self, self.results)

    @property
    def largest_sigma(self) -> float | None:
        """The largest distance, None where there is none."""
        distances = [
            abs(distance) for row in self.sigma.values() for distance in row if distance is not None
        ]
        return max(distances, default=None)


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
    shown = (
        [visible(label) for label in labels] if labels else [file_name(r.log.path) for r in results]
    )
    if len(set(shown)) < len(shown):
        shown = [f"{number} {label}" for number, label in enumerate(shown, start=1)]
    first, others = results[0].estimates, [result.estimates for result in results[1:]]
    names = dict.fromkeys(
        name for result in results for name in result.estimates
    )  # in the order met
    sigma = {
        name: tuple(distance_sigma(first.get(name), other.get(name)) for other in others)
        for name in names
    }
    return Comparison(
        tuple(shown),
        sigma,
        _estimates(results, shown, sigma),
        _settings(results, shown),
        tuple(results),
    )


def comparison_json(found: Comparison, results: Sequence[Result]) -> str:
    """The comparison as JSON: estimates, standard deviations and distances in σ by parameter."""
    parameters = {
        name: {
            "estimate": [_number(result, name, "estimate") for result in results],
            "std": [_number(result, name, "std") for result in results],
            "sigma": [None, *distances],
        }
        for name, distances in found.sigma.items()
    }
    settings = {name: list(values) for name, *values in found.settings.rows}
    content = {"labels": list(found.labels), "parameters": parameters, "settings": settings}
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _number(result: Result, name: str, which: str) -> float | None:
    found = result.estimates.get(name)
    number: float | None = None if found is None else getattr(found, which)
    return number


def distance_sigma(first: Estimate | None, other: Estimate | None) -> float | None:
    """Signed distance of `other` from `first` over their combined standard deviation."""
    if first is None or other is None or first.estimate is None or other.estimate is None:
        return None
    if first.std is None or other.std is None:
        return None
    combined = math.hypot(first.std, other.std)
    return (other.estimate - first.estimate) / combined if combined > 0 else None


def _estimates(
    results: Sequence[Result], labels: list[str], sigma: dict[str, tuple[float | None, ...]]
) -> Table:
    columns = [Column("Parameter", "name"), Column("Unit", "text"), Column(labels[0], "number")]
    for label in labels[1:]:
        columns += [
            Column(label, "number"),
            Column("Δ %", "number", rank=1),
            Column("Δ/σ", "number"),
        ]
    rows = []
    for name, distances in sigma.items():
        first, *others = (result.estimates.get(name) for result in results)
        unit = next(unit_text(one.unit) for one in (first, *others) if one is not None)
        cells = [visible(name), unit, with_std(first)]
        for other, distance in zip(others, distances, strict=True):
            change = ABSENT
            if (
                first is not None
                and other is not None
                and first.estimate
                and other.estimate is not None
            ):
                change = f"{100 * (other.estimate - first.estimate) / abs(first.estimate):+.3g}"
            cells += [with_std(other), change, ABSENT if distance is None else f"{distance:+.1f}"]
        rows.append(tuple(cells))
    note = f"Differences are against {labels[0]}; σ combines both standard deviations."
    table = Table("Estimates side by side", tuple(columns), tuple(rows), note).without_empty()
    return replace(table, upright=_upright(results, labels, sigma, note))


def _upright(
    results: Sequence[Result],
    labels: list[str],
    sigma: dict[str, tuple[float | None, ...]],
    note: str,
) -> Table:
    """The estimates one below the other: as wide for many results as for two."""
    columns = (
        Column("Parameter", "name"),
        Column("Result", "text"),
        Column("Estimate", "number"),
        Column("Unit", "text", rank=1),
        Column("Δ/σ", "number"),
    )
    rows = []
    for name, distances in sigma.items():
        for place, (label, result) in enumerate(zip(labels, results, strict=True)):
            found = result.estimates.get(name)
            unit = "" if found is None else unit_text(found.unit)
            distance = distances[place - 1] if place else None
            far = "" if distance is None else f"{distance:+.1f}"
            rows.append((visible(name) if place == 0 else "", label, with_std(found), unit, far))
    return Table("Estimates side by side", columns, tuple(rows), note)


def with_std(found: Estimate | None) -> str:
    """``estimate ± std``, and the status where it is not OK."""
    if found is None:
        return ABSENT
    spread = "" if found.std is None else f" ± {significant(found.std, 2)}"
    status = "" if found.status == "OK" else f" ({found.status.value})"
    return f"{resolved(found.estimate, found.std)}{spread}{status}"


def _settings(results: Sequence[Result], labels: list[str]) -> Table:
    """What was set otherwise, and how the first log of each kind was read otherwise."""
    every: list[dict[str, str]] = []
    for result in results:
        settings = {
            **flat_settings(result.settings),
            "estimator": result.estimator,
            "algid": result.version,
        }
        for role, log in {log.role: log for log in reversed(result.logs)}.items():
            reading = {} if log.reading is None else flat_settings(asdict(log.reading))
            settings |= {f"{role} log: {name}": value for name, value in reading.items()}
        every.append(settings)
    names = dict.fromkeys(name for settings in every for name in settings)
    differing = [name for name in names if len({settings.get(name) for settings in every}) > 1]
    rows = tuple(
        (visible(n), *(visible(settings.get(n, ABSENT)) for settings in every)) for n in differing
    )
    columns = (Column("Setting", "name"), *(Column(label, "text") for label in labels))
    note = "" if rows else "Every setting is the same, and every log was read the same way."
    table = Table("Settings that differ", columns, rows, note)
    upright = tuple(
        (row[0] if place == 0 else "", label, row[place + 1])
        for row in rows
        for place, label in enumerate(labels)
    )
    headings = (Column("Setting", "name"), Column("Result", "text"), Column("Value", "text"))
    return replace(table, upright=replace(table, columns=headings, rows=upright))
