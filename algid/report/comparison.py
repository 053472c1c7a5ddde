"""Results side by side: how far apart in σ, and which settings differ; on a page with a figure."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from pydantic_core import to_json

from algid.arm import FloatArray
from algid.base.files import whole_file
from algid.base.significance import NORMAL, sigmas
from algid.base.text import ABSENT, cells, counted, joined, percent, visible
from algid.notices import Grade, Verdict
from algid.report.document import Document, Section, Table
from algid.report.plot import down
from algid.report.render import page
from algid.report.tables import settings_of
from algid.results import Result
from algid.results.rows import rows_of

ROW = "{0.name} | {1} | {0.with_half} | {2:+.1f} | {0.unit} | {0.status} | {3}"
ASIDE = re.compile(r"command|used\..*|.*told")
"""Settings that are no difference: a command names the logs and says again what is set."""
FAR = sigmas()
"""σ, beyond which chance does not explain a difference."""


@dataclass(frozen=True, repr=False)
class Comparison:
    """Results side by side; the first one is what the others are measured against."""

    labels: Sequence[str]
    results: Sequence[Result]

    def __repr__(self) -> str:
        return f"Comparison({', '.join(self.labels)}: {verdict(self).headline})"

    @cached_property
    def names(self) -> list[str]:
        """The parameters that any of the results has."""
        return list(dict.fromkeys(name for one in self.results for name in one.estimates))

    def numbers(self, key: str) -> FloatArray:
        """What each result's estimates have under `key` (R, P), NaN where they have none."""
        of = [
            [getattr(one.estimates.get(name), key, None) for name in self.names]
            for one in self.results
        ]
        return np.array(of, dtype=np.float64)

    @cached_property
    def sigma(self) -> FloatArray:
        """Signed distances (R, P) from the first result over combined half intervals, in σ.

        Of normal intervals that is their combined standard deviation. Of Student's it is larger,
        so that 95 % of the differences that chance makes lie within 1.96 of either. NaN where one
        is not known, and of the first result itself.
        """
        value, half = self.numbers("estimate"), self.numbers("half")
        combined = np.hypot(half, half[0])
        combined[0] = np.nan
        return NORMAL * (value - value[0]) / np.where(combined > 0, combined, np.nan)

    @property
    def largest_sigma(self) -> float | None:
        """The largest distance, None where there is none."""
        known = np.abs(self.sigma[~np.isnan(self.sigma)])
        return float(known.max()) if known.size else None

    @cached_property
    def settings(self) -> dict[str, list[str]]:
        """What was set otherwise, and how the first log of each kind was read otherwise."""
        every, differ = list[dict[str, str]](), dict[str, list[str]]()
        for one in self.results:
            every.append(settings_of(one) | {"estimator": one.estimator, "algid": one.version})
        for name in dict.fromkeys(name for settings in every for name in settings):
            values = [settings.get(name, ABSENT) for settings in every]
            role, of_log, _ = name.partition(" log.")
            # a result without logs of a role reads none otherwise
            compared = {
                value
                for value, one in zip(values, self.results, strict=True)
                if not of_log or any(log.role == role for log in one.logs)
            }
            if len(compared) > 1 and not ASIDE.fullmatch(name):
                differ[name] = values
        return differ

    def tables(self) -> tuple[Table, Table]:
        """The estimates one below the other, as wide for many results as for two; the settings."""
        estimates, settings, numbers = [], [], self.numbers("estimate")
        for place, name in enumerate(self.names):
            for log, (label, result) in enumerate(zip(self.labels, self.results, strict=True)):
                if name in result.estimates:
                    row = next(rows_of(result, {name: result.estimates[name]}))
                    far = self.sigma[log, place]
                    off = percent(numbers[log, place] - numbers[0, place], numbers[0, place], 3)
                    estimates.append(cells(ROW, row, label, far, off))
        for name, values in self.settings.items():
            for label, value in zip(self.labels, values, strict=True):
                settings.append((visible(name), label, visible(value)))
        note = f"Differences are against {self.labels[0]}; ± is 95 %, σ combines both intervals."
        same = "Every setting is the same, and every log was read the same way."
        columns = "Parameter | Result | Estimate | Δ/σ | Unit | Status | Δ %"
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
        for name, far in zip(self.names, self.sigma.T.tolist(), strict=True):
            several = [one.estimates.get(name) for one in self.results]
            keys = ("estimate", "std", "ci95")
            numbers = {key: [getattr(one, key, None) for one in several] for key in keys}
            parameters[name] = numbers | {"sigma": far}
        content = {"labels": self.labels, "parameters": parameters, "settings": self.settings}
        return to_json(content, indent=2, inf_nan_mode="null").decode() + "\n"


def compare(results: Sequence[Result], labels: Sequence[str]) -> Comparison:
    """Lay two `results` or more side by side; `labels` are what to call them."""
    shown = list(map(visible, labels))
    if len(set(shown)) < len(shown):
        shown = [f"{number} {label}" for number, label in enumerate(shown, start=1)]
    return Comparison(shown, results)


def verdict(found: Comparison) -> Verdict:
    """Whether the results agree: the largest distance, and whether chance explains it."""
    far, count = found.largest_sigma, int(np.count_nonzero(~np.isnan(found.sigma)))
    if far is None:
        return Verdict("reservations", "no parameter has error bars in two results")
    log, place = divmod(int(np.nanargmax(np.abs(found.sigma))), len(found.names))
    words = f"{visible(found.names[place])} of {found.labels[log]}"
    words += f" ({found.sigma[log, place]:+.1f} σ)"
    grade: Grade = "good" if far <= FAR else "reservations"
    return Verdict(grade, f"the largest of {counted(count, 'difference')} is {words}")


def write_comparison(found: Comparison, path: Path, force: bool) -> None:
    """Write the page of a comparison, with a figure of the distances from the first result.

    Raises
    ------
    OutputError
        If it cannot be written, or exists and `force` is not set.
    """
    labels, figure, (estimates, settings) = found.labels, None, found.tables()
    if found.largest_sigma is not None:
        known = np.flatnonzero(~np.isnan(found.sigma).all(axis=0)).tolist()
        names, reach = [found.names[place] for place in known], max(1.1 * found.largest_sigma, 4.0)
        figure = down("distances", f"Distance from {labels[0]}, σ", names, reach)
        for place, label in enumerate(labels[1:]):
            figure.add(0, found.sigma[place + 1, known], names, label, f"result {place % 5}")
        figure.mark(0, "chance", -NORMAL, NORMAL)
    document = Document(
        verdict=verdict(found),
        sections=(
            Section("numbers", "Differences", (figure, estimates)),
            Section("settings", "Settings that differ", (settings,)),
        ),
        kicker="results side by side",
        name=joined(labels, 3),
        facts=f"{counted(len(labels), 'result')} · measured against {labels[0]}",
    )
    with whole_file(path, force=force) as temporary:
        temporary.write_text(page(document), encoding="utf-8")
