"""Results side by side: how far apart in σ, and which settings differ."""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from algid.report.document import Column, Table
from algid.report.tables import flat_settings
from algid.results import Estimate, LogSummary, Result, Status
from algid.text import ABSENT, file_name, formatted, resolved, significant, unit_text, visible
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

    def __repr__(self) -> str:
        far = self.largest_sigma
        largest = "no distance" if far is None else f"the largest distance {far:.1f} σ"
        return f"Comparison({', '.join(self.labels)}: {largest})"

    def tables(self) -> tuple[Table, Table]:
        """The estimates side by side, and what was set otherwise."""
        return self.estimates, self.settings

    def as_json(self) -> str:
        """The text of a JSON file: see `comparison_json`."""
        return comparison_json(self, self.results)

    @property
    def largest_sigma(self) -> float | None:
        """The largest distance, None where there is none."""
        return max(map(abs, self.distances()), default=None)

    def distances(self) -> list[float]:
        """Every distance that is known, in the order of the parameters."""
        known: list[float] = []
        for row in self.sigma.values():
            known += [distance for distance in row if distance is not None]
        return known


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
    shown = _distinct(labels or [file_name(result.log.path) for result in results])
    every = [result.estimates for result in results]
    sigma: dict[str, tuple[float | None, ...]] = {}
    for name in _names(every):
        first = every[0].get(name)
        sigma[name] = tuple(distance_sigma(first, other.get(name)) for other in every[1:])
    return Comparison(
        tuple(shown),
        sigma,
        _estimates(results, shown, sigma),
        _settings(results, shown),
        tuple(results),
    )


def _distinct(labels: Sequence[str]) -> list[str]:
    """The labels as they are printed; with their numbers where two would look alike."""
    shown = list(map(visible, labels))
    if len(set(shown)) == len(shown):
        return shown
    return [f"{number} {label}" for number, label in enumerate(shown, start=1)]


def _names(several: Sequence[Mapping[str, Any]]) -> list[str]:
    """The names in several mappings, each once and in the order in which they are met."""
    names: dict[str, None] = {}
    for one in several:
        names |= dict.fromkeys(one)
    return list(names)


def comparison_json(compared: Comparison, results: Sequence[Result]) -> str:
    """The comparison as JSON: estimates, standard deviations and distances in σ by parameter."""
    parameters = {}
    for name, distances in compared.sigma.items():
        values, stds = [], []
        for result in results:
            one = result.estimates.get(name, _NONE)
            values.append(one.estimate)
            stds.append(one.std)
        parameters[name] = {"estimate": values, "std": stds, "sigma": (None,) + distances}
    settings = {row[0]: row[1:] for row in compared.settings.rows}
    content = {"labels": list(compared.labels), "parameters": parameters, "settings": settings}
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


_NONE = Estimate(estimate=None, std=None, ci95=None, unit="", status=Status.NOT_IDENTIFIABLE)
"""In place of what a result does not estimate."""


def distance_sigma(first: Estimate | None, other: Estimate | None) -> float | None:
    """Signed distance of `other` from `first` over their combined standard deviation."""
    if first is None or other is None or first.estimate is None or other.estimate is None:
        return None
    if first.std is None or other.std is None:
        return None
    combined = math.hypot(first.std, other.std)
    if combined == 0:
        return None
    return (other.estimate - first.estimate) / combined


def _estimates(
    results: Sequence[Result], labels: list[str], sigma: dict[str, tuple[float | None, ...]]
) -> Table:
    columns = [Column("Parameter", "name"), Column("Unit", "text"), Column(labels[0], "number")]
    change, distance = Column("Δ %", "number", rank=1), Column("Δ/σ", "number")
    for label in labels[1:]:
        columns += [Column(label, "number"), change, distance]
    rows = []
    for name, distances in sigma.items():
        every, unit = _of_all(results, name)
        cells = [visible(name), unit, with_std(every[0])]
        for other, far in zip(every[1:], distances, strict=True):
            cells += [with_std(other), _change(every[0], other), formatted(far, _SIGMAS)]
        rows.append(tuple(cells))
    note = f"Differences are against {labels[0]}; ± is one standard deviation, σ combines both."
    table = Table("Estimates side by side", tuple(columns), tuple(rows), note).without_empty()
    return replace(table, upright=_upright(results, labels, sigma, note))


def _of_all(results: Sequence[Result], name: str) -> tuple[list[Estimate | None], str]:
    """Each result's estimate of a parameter, and its unit."""
    estimates = [result.estimates.get(name) for result in results]
    unit = next(unit_text(one.unit) for one in estimates if one is not None)
    return estimates, unit


def _change(first: Estimate | None, other: Estimate | None) -> str:
    """By how many percent `other` differs from `first`."""
    if first is None or not first.estimate or other is None or other.estimate is None:
        return ABSENT
    return f"{100 * (other.estimate - first.estimate) / abs(first.estimate):+.3g}"


_SIGMAS = "+.1f"
"""How a distance in σ is written."""


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
        Column("Δ/σ", "number"),
    )
    rows: list[tuple[str, ...]] = []
    for name, distances in sigma.items():
        estimates, unit = _of_all(results, name)
        headings = [visible(name), unit] + [""] * (len(results) - 2)  # the unit under its name
        for place, (label, estimate) in enumerate(zip(labels, estimates, strict=True)):
            far = ""
            if place > 0 and distances[place - 1] is not None:
                far = formatted(distances[place - 1], _SIGMAS)
            rows.append((headings[place], label, with_std(estimate), far))
    return Table("Estimates side by side", columns, tuple(rows), note)


def with_std(estimate: Estimate | None) -> str:
    """``estimate ± std``, and the status where it is not OK."""
    if estimate is None:
        return ABSENT
    text = resolved(estimate.estimate, estimate.std)
    if estimate.std is not None:
        text += f" ± {significant(estimate.std, 2)}"
    if estimate.status != Status.OK:
        text += f" ({estimate.status.value})"
    return text


def _settings(results: Sequence[Result], labels: list[str]) -> Table:
    """What was set otherwise, and how the first log of each kind was read otherwise."""
    roles = set.intersection(*map(_roles, results))
    every = [_made_with(result, roles) for result in results]
    rows: list[tuple[str, ...]] = []
    for name in _names(every):
        values = [settings.get(name, ABSENT) for settings in every]
        if len(set(values)) > 1:
            rows.append((visible(name),) + tuple(map(visible, values)))
    columns = [Column("Setting", "name")]
    columns += [Column(label, "text") for label in labels]
    note = ""
    if not rows:
        note = "Every setting is the same, and every log was read the same way."
    table = Table("Settings that differ", tuple(columns), tuple(rows), note)
    upright: list[tuple[str, ...]] = []
    for row in rows:
        heading = row[0]
        for label, value in zip(labels, row[1:], strict=True):
            upright.append((heading, label, value))
            heading = ""
    headings = (Column("Setting", "name"), Column("Result", "text"), Column("Value", "text"))
    return replace(table, upright=replace(table, columns=headings, rows=tuple(upright)))


def _roles(result: Result) -> set[str]:
    """Which kinds of logs a result is made from."""
    return {log.role for log in result.logs}


def _made_with(result: Result, roles: Collection[str]) -> dict[str, str]:
    """The settings of a result, and how the first log of each of the roles was read."""
    settings = flat_settings(result.settings)
    settings.pop("command", None)  # it names the logs, and says again what is set
    settings |= {"estimator": result.estimator, "algid": result.version}
    firsts = {log.role: log for log in reversed(result.logs)}
    for role, log in sorted(firsts.items(), reverse=True):  # the unloaded one first
        if role not in roles:
            settings[f"{role} log"] = file_name(log.path)
        else:
            for name, text in _read(log).items():
                settings[f"{role} log: {name}"] = text
    return settings


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
