"""A comparison as a page: intervals side by side, and distances in σ with the limit of chance."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from algid import __version__
from algid.arm import FloatArray
from algid.files import whole_file
from algid.report.comparison import Comparison
from algid.report.document import Content, Document, Section
from algid.report.figures.base import (
    Figure,
    Layout,
    Legend,
    Panel,
    Trace,
    axis,
    label,
    packed,
    stretch,
)
from algid.report.frame import page
from algid.results import Estimate, Result
from algid.significance import NORMAL, sigmas
from algid.text import joined, significant, visible
from algid.verdict import Verdict
from algid.words import counted

COLOURS = ("@blue", "@orange", "@green", "@amber", "@red", "@muted")
FAR = sigmas()  # beyond which chance does not explain a difference
FARTHEST = 12.0  # σ that the first view shows
NAME = "compare.html"
ROW, FRAME = 24, 90  # pixels of a parameter, and of what stands around them
READING = "a difference inside the blue band is one that chance explains 19 times of 20"


def write_comparison(
    found: Comparison, results: Sequence[Result], folder: Path, force: bool
) -> Path:
    """Write `compare.html` into `folder`.

    Raises
    ------
    OutputError
        If it cannot be written, or exists and `force` is not set.
    """
    path = folder / NAME
    with whole_file(path, force=force) as temporary:
        temporary.write_text(page(comparison_document(found, results)), encoding="utf-8")
    return path


def comparison_document(found: Comparison, results: Sequence[Result]) -> Document:
    """The report of a comparison."""
    names, count = found.labels, counted(len(results), "result")
    content: list[Content] = []
    for figure in (_intervals(found, results), _distances(found)):
        if figure.panels:
            content.append(figure)
    content += found.tables()
    name = joined(list(names))
    if len(names) > 3:
        name = f"{names[0]} and {len(names) - 1} more"
    return Document(
        title="Comparison",
        verdict=verdict(found),
        sections=(Section(tuple(content)),),
        kicker="results side by side",
        name=name,
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
        lie = "lies" if len(far) == 1 else "lie"
        return Verdict("reservations", f"{joined(far[:3])}{more} {lie} beyond {FAR:.2g} σ")
    inside = sum(size <= NORMAL for size, _ in distances)
    largest = max(distances)[1]
    within = f"{inside} of {counted(len(distances), 'difference')} within {NORMAL:.2f} σ"
    return Verdict("good", f"{within}; the largest is {largest}")


def _legend(found: Comparison) -> list[Legend]:
    """An entry a result, in its colour."""
    entries = []
    for place, words in enumerate(found.labels):
        entries.append(Legend(f"result{place}", words, COLOURS[place % len(COLOURS)]))
    return entries


def _dots(
    found: Comparison, place: int, x: FloatArray, y: FloatArray, size: int, number: str
) -> Trace:
    """The dots of one result; `number` is how a value is written."""
    name = label(found.labels[place])
    return {
        "type": "scatter",
        "mode": "markers",
        "x": packed(x),
        "y": packed(y),
        "marker": {"color": COLOURS[place % len(COLOURS)], "size": size},
        "name": name,
        "legendgroup": f"result{place}",
        "hovertemplate": f"{name} %{{x:{number}<extra></extra>",
    }


def _in_sigmas(found: Estimate | None, first: Estimate, sigma: float) -> tuple[float, float] | None:
    """How far the estimate lies from the first one, and half its interval, in `sigma`."""
    if found is None or found.estimate is None or found.std is None or first.estimate is None:
        return None
    low, high = found.ci95 or (None, None)
    half = NORMAL * found.std
    if low is not None and high is not None:
        half = (high - low) / 2
    return (found.estimate - first.estimate) / sigma, half / sigma


def _sigmas(results: Sequence[Result], names: Sequence[str]) -> dict[str, float]:
    """Each row's largest standard deviation, of the parameters that the first result has."""
    by_parameter = {}
    for name in names:
        first = results[0].estimates.get(name)
        if first is None or first.estimate is None:
            continue
        largest = 0.0
        for result in results:
            if name in result.estimates:
                largest = max(largest, result.estimates[name].std or 0.0)
        if largest > 0:
            by_parameter[name] = largest
    return by_parameter


def _intervals(found: Comparison, results: Sequence[Result]) -> Figure:
    """A forest plot: intervals about the first result's estimate, a row each in its own σ."""
    known = _sigmas(results, list(found.sigma))
    first = results[0].estimates
    apart = 0.6 / len(results)
    traces: list[Trace] = []
    widest = [0.0]
    for place, result in enumerate(results):
        shown = []
        for row, (name, sigma) in enumerate(known.items()):
            share = _in_sigmas(result.estimates.get(name), first[name], sigma)
            if share is not None:
                shown.append((row,) + share)
        at, x, half = np.array(shown, dtype=np.float64).reshape(-1, 3).T
        y = at + (place - (len(results) - 1) / 2) * apart
        widest += (np.abs(x) + half).tolist()
        dots = _dots(found, place, x, y, 7, "+.2f} σ")
        bar = {
            "type": "data",
            "array": half.tolist(),
            "color": dots["marker"]["color"],
            "thickness": 2,
            "width": 0,
        }
        traces.append(dots | {"error_x": bar})
    reach = 1.1 * min(max(widest), FARTHEST)
    layout = {
        "xaxis": axis(
            f"from {label(found.labels[0])}, in the row's largest σ", range=[-reach, reach]
        ),
        "yaxis": _names(list(known)),
        "hovermode": "closest",
    }
    says = (
        f"95 % intervals of {counted(len(known), 'parameter')}, {counted(len(results), 'result')}"
    )
    row_height = ROW + 8 * (len(results) - 2)
    reading = (
        "Read: intervals of one row that overlap agree; one that stands apart has changed "
        "or was made otherwise."
    )
    return Figure(
        "intervals",
        "Estimates with their 95 % intervals",
        _panels(traces, layout, says, row_height, len(known)),
        reading,
        tuple(_legend(found)),
    )


def _panels(
    traces: list[Trace], layout: Layout, says: str, row_height: int, rows: int
) -> tuple[Panel, ...]:
    """A panel of so many rows; none without a row."""
    if rows == 0:
        return ()
    return (Panel(traces, layout, says, height=FRAME + row_height * rows),)


def _distances(found: Comparison) -> Figure:
    """How far each result is from the first, in combined standard deviations."""
    rows = {name: row for name, row in found.sigma.items() if set(row) != {None}}
    names = list(rows)
    traces: list[Trace] = []
    for place in range(1, len(found.labels)):
        shown = []
        for at, row in enumerate(rows.values()):
            if row[place - 1] is not None:
                shown.append((row[place - 1], at))
        x, y = np.array(shown, dtype=np.float64).reshape(-1, 2).T
        traces.append(_dots(found, place, x, y, 8, "+.2f} σ"))
    sizes = np.abs(found.distances())
    widest = found.largest_sigma or 0.0
    reach = max(1.1 * widest, 4.0)
    inside = np.count_nonzero(sizes <= NORMAL)
    layout = {
        "xaxis": axis("distance, σ", range=[-reach, reach]),
        "yaxis": _names(names),
        "shapes": [stretch(-NORMAL, NORMAL, "@blue/0.25")],
        "hovermode": "closest",
    }
    note = (
        f"{inside} of {counted(len(sizes), 'difference')} within ± {NORMAL:.2f} σ, the largest "
        f"at {significant(widest, 2)} σ."
    )
    legend = _legend(found)[1:]
    legend.append(Legend("", f"± {NORMAL:.2f} σ, 95 % by chance", "@blue/0.25", "area"))
    return Figure(
        "distances",
        f"Distances from {found.labels[0]}",
        _panels(traces, layout, f"Distances in σ. {note}", ROW, len(names)),
        f"Read: {READING}.",
        tuple(legend),
        note,
    )


def _names(names: Sequence[str]) -> Layout:
    """An axis of names from the top down."""
    return axis(
        range=[len(names) - 0.4, -0.6],
        zeroline=False,
        fixedrange=True,
        tickvals=list(range(len(names))),
        ticktext=[label(name) for name in names],
    )
