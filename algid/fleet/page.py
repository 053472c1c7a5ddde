"""The fleet's page: its robots, what drifts, changed or stands out, and a figure of that."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from algid import __version__
from algid.base.text import joined, significant, visible
from algid.base.verdict import Verdict, graded
from algid.base.words import counted
from algid.fleet.drift import ALPHA
from algid.fleet.figures import overview
from algid.fleet.history import History
from algid.fleet.tables import MOST_ROWS, change_table, finding_table, robot_table
from algid.notices import Notice
from algid.report.document import Document, Section

if TYPE_CHECKING:
    import polars as pl

MOST_ROBOTS = 40  # whose table is printed
MOST_NAMED = 3  # drifts, and logs that stand out


def fleet_document(
    history: History, batch: Path | None = None, out: Path | None = None
) -> Document:
    """The report of a fleet; with the folders of `batch` and page also its figure and links.

    A long list of robots is left to the page.
    """
    links, latest, figure = dict[str, str](), dict[str, str](), None
    if batch is not None and out is not None:
        worst = history.findings["job"].unique().head(MOST_ROWS).to_list()
        links = {visible(job): place for job in worst if (place := _report(job, batch, out))}
        for robot, job in history.roster.head(MOST_ROWS).select("robot", "latest").iter_rows():
            place = _report(job, batch, out)
            if place:
                latest[visible(robot)] = place
        figure = overview(history)
    robots = robot_table(history, latest)
    tables = (change_table(history), finding_table(history, links))
    return Document(
        title="Fleet",
        verdict=verdict(history),
        sections=(
            Section("numbers", "Findings", tables),
            Section("logs", "" if figure is None else figure.title, (figure,) if figure else ()),
            Section("robots", "Robots", (robots,), folded=history.robots > MOST_ROBOTS),
        ),
        kicker="a fleet's history",
        name="Fleet",
        facts=f"{counted(history.robots, 'robot')} · {counted(history.logs, 'log')}",
        made=f"Made by algid {__version__}.",
    )


def _report(job: str, batch: Path, out: Path) -> str:
    """Where a job's report is, as seen from `out`; empty without one."""
    page = batch / f"{job}.algid" / "report.html"
    try:
        if not page.is_file():
            return ""
    except (OSError, ValueError):  # a name that no file can have
        return ""
    there = os.path.relpath(page.resolve(), out.resolve()).replace(os.sep, "/")
    return "./" + quote(there)  # a name such as javascript: leads nowhere else


def verdict(history: History) -> Verdict:
    """Whether anything drifts or stands out; what could not be tested is the reason to doubt it."""
    import polars as pl

    drifts, findings = history.drifts.height, history.findings.height
    statement = f"{counted(history.robots, 'robot')}, {counted(history.logs, 'log')}: "
    counts = [counted(drifts, "drift"), counted(findings, "finding")]
    if history.changes is not None and history.changes.height:
        steps = history.changes.n_unique(["robot", "after"])
        counts.insert(1, counted(steps, "change"))
    statement += joined(counts)
    tested = history.windows.filter(pl.col("p").is_not_nan() & (pl.col("mean") != 0.0))
    if tested.height:  # the clearest trend of all that were tested, whether it drifts or not
        row = tested.sort("p", "robot", "parameter").row(0, named=True)
        slope, p = 100 * row["slope"] / abs(row["mean"]), significant(row["p"], 2)
        statement += (
            f"; the clearest trend is {row['parameter']} of {visible(row['robot'])}, "
            f"{slope:+.2g} % a month"
        )
        statement += f" (p = {p})"
        if not row["drift"]:
            statement += f", which does not pass p < {significant(ALPHA, 1)}"
    reasons = []
    if drifts:
        reasons.append(_drifting(history))
    if history.changes is not None and history.changes.height:
        reasons.append(_changed(history.changes))
    if findings:
        reasons.append(_standing_out(history))
    if history.scattered is not None:
        reasons.append(history.scattered)
    reasons += history.untested
    return graded(statement, reasons)


def _drifting(history: History) -> Notice:
    """How many parameters drift, and the clearest ones."""
    shown = history.drifts.head(MOST_NAMED).select("robot", "parameter").rows()
    names = [f"{parameter} of {visible(robot)}" for robot, parameter in shown]
    rest = history.drifts.height - len(shown)
    if rest:
        names.append(f"{rest} more")
    return Notice(
        "FLEET_CHANGE", numbers={"case": "drift", "count": history.drifts.height, "names": names}
    )


def _standing_out(history: History) -> Notice:
    """How many logs stand out, and the ones that do so most."""
    import polars as pl

    worst = history.findings.sort(pl.col("sigmas").abs(), descending=True)
    names = []
    for job, parameter, sigmas in worst.select("job", "parameter", "sigmas").rows()[:MOST_NAMED]:
        names.append(f"{visible(job)} ({parameter}, {significant(sigmas, 2)} σ)")
    rest = worst.height - len(names)
    if rest:
        names.append(f"{rest} more")
    return Notice("FLEET_CHANGE", numbers={"case": "log", "count": worst.height, "names": names})


def _changed(changes: pl.DataFrame) -> Notice:
    """The first change, and how many there are where it is not alone."""
    row, count = changes.row(0, named=True), changes.n_unique(["robot", "after"])
    numbers = {
        "before": str(row["before"].date()),
        "after": str(row["after"].date()),
        "robot": visible(row["robot"]),
        "parameter": row["parameter"],
        "percent": 100 * row["share"],
        "count": count if count > 1 else 0,
    }
    return Notice("FLEET_CHANGE", numbers={"case": "step"} | numbers)
