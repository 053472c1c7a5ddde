"""A comparison as a page: intervals side by side, and distances in σ with the limit of chance."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from algid import __version__
from algid.arm import FloatArray
from algid.files import whole_file
from algid.report.comparison import Comparison
from algid.report.document import Document, Section
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
    figures = [
        figure for figure in (_intervals(found, results), _distances(found)) if figure.panels
    ]
    return Document(
        title="Comparison",
        verdict=verdict(found),
        sections=(Section((*figures, found.estimates, found.settings)),),
        kicker="results side by side",
        name=joined(list(names)) if len(names) < 4 else f"{names[0]} and {len(names) - 1} more",
        facts=f"{count} · measured against {names[0]}",
        made=f"Made by algid {__version__}.",
    )


def verdict(found: Comparison) -> Verdict:
    """Whether the results agree: distances beyond `FAR` are named, the largest first."""
    distances = [
        (abs(distance), f"{visible(name)} of {other} ({distance:+.1f} σ)")
        for name, row in found.sigma.items()
        for other, distance in zip(found.labels[1:], row, strict=True)
        if distance is not None
    ]
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


def _legend(found: Comparison, first: int = 0) -> tuple[Legend, ...]:
    return tuple(
        Legend(f"result{place}", words, COLOURS[place % len(COLOURS)])
        for place, words in enumerate(found.labels[first:], start=first)
    )


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
    half = NORMAL * found.std if low is None or high is None else (high - low) / 2
    return (found.estimate - first.estimate) / sigma, half / sigma


def _sigmas(results: Sequence[Result], names: Sequence[str]) -> dict[str, float]:
    """Each row's largest standard deviation, of the parameters that the first result has."""
    by_parameter = {}
    for name in names:
        first = results[0].estimates.get(name)
        every = [result.estimates.get(name) for result in results]
        stds = [one.std for one in every if one is not None and one.std]
        if first is not None and first.estimate is not None and stds:
            by_parameter[name] = max(stds)
    return by_parameter


def _intervals(found: Comparison, results: Sequence[Result]) -> Figure:
    """A forest plot: intervals about the first result's estimate, a row each in its own σ."""
    known = _sigmas(results, list(found.sigma))
    first = results[0].estimates
    apart = 0.6 / len(results)
    traces: list[Trace] = []
    widest = [0.0]
    for place, result in enumerate(results):
        rows = [
            (at, _in_sigmas(result.estimates.get(name), first[name], sigma))
            for at, (name, sigma) in enumerate(known.items())
        ]
        shown = [(at, *share) for at, share in rows if share is not None]
        x, half = (np.array([row[column] for row in shown]) for column in (1, 2))
        y = np.array([row[0] for row in shown]) + (place - (len(results) - 1) / 2) * apart
        widest += [float(value) for value in np.abs(x) + half]
        dots = _dots(found, place, x, y, 7, "+.2f} σ")
        bar = {
            "type": "data",
            "array": half.tolist(),
            "color": dots["marker"]["color"],
            "thickness": 2,
            "width": 0,
        }
        traces.append({**dots, "error_x": bar})
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
    panels = (
        (Panel(traces, layout, says, height=FRAME + (ROW + 8 * (len(results) - 2)) * len(known)),)
        if known
        else ()
    )
    reading = (
        "Read: intervals of one row that overlap agree; one that stands apart has changed "
        "or was made otherwise."
    )
    return Figure(
        "intervals", "Estimates with their 95 % intervals", panels, reading, _legend(found)
    )


def _distances(found: Comparison) -> Figure:
    """How far each result is from the first, in combined standard deviations."""
    names = [
        name for name, row in found.sigma.items() if any(distance is not None for distance in row)
    ]
    traces: list[Trace] = []
    for place in range(1, len(found.labels)):
        pairs = [(found.sigma[name][place - 1], at) for at, name in enumerate(names)]
        shown = np.array(
            [(distance, at) for distance, at in pairs if distance is not None]
        ).reshape(-1, 2)
        traces.append(_dots(found, place, shown[:, 0], shown[:, 1], 8, "+.2f} σ"))
    sizes = [
        abs(distance) for row in found.sigma.values() for distance in row if distance is not None
    ]
    reach = max(1.1 * max(sizes, default=0.0), 4.0)
    inside = sum(size <= NORMAL for size in sizes)
    layout = {
        "xaxis": axis("distance, σ", range=[-reach, reach]),
        "yaxis": _names(names),
        "shapes": [stretch(-NORMAL, NORMAL, "@blue/0.25")],
        "hovermode": "closest",
    }
    largest = significant(max(sizes, default=0.0), 2)
    note = (
        f"{inside} of {counted(len(sizes), 'difference')} within ± {NORMAL:.2f} σ, the largest "
        f"at {largest} σ."
    )
    panels = (
        (Panel(traces, layout, f"Distances in σ. {note}", height=FRAME + ROW * len(names)),)
        if names
        else ()
    )
    legend = (
        *_legend(found, 1),
        Legend("", f"± {NORMAL:.2f} σ, 95 % by chance", "@blue/0.25", "area"),
    )
    return Figure(
        "distances", f"Distances from {found.labels[0]}", panels, f"Read: {READING}.", legend, note
    )


def _names(names: Sequence[str]) -> Layout:
    """An axis of names from the top down."""
    ticks: Layout = {
        "tickvals": list(range(len(names))),
        "ticktext": [label(name) for name in names],
    }
    return axis(range=[len(names) - 0.4, -0.6], zeroline=False, fixedrange=True, **ticks)
