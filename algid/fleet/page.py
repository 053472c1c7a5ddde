"""The fleet's page: what drifts, changed or stands out, and every robot log by log.

It opens offline.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from algid import __version__
from algid.fleet.drift import ALPHA, SPAN
from algid.fleet.figures import courses, overview, robot_figure
from algid.fleet.history import History
from algid.fleet.tables import (
    MOST_ROWS,
    change_table,
    drift_table,
    finding_table,
    parameter_table,
    robot_table,
)
from algid.notices import Notice
from algid.report.document import (
    Content,
    Depth,
    Document,
    ReadingAid,
    References,
    Section,
    filled,
)
from algid.report.frame import page
from algid.text import joined, significant, visible
from algid.verdict import Verdict, graded
from algid.words import counted

if TYPE_CHECKING:
    import polars as pl

READING = (
    "Read: each parameter has one scale of change for all robots; the band is the 95 % interval "
    "of the mean over "
    f"{SPAN} months. Level within its band is steady{{drifts}}. A robot's name leads to all its "
    "parameters."
)
MOST_ROBOTS = 40  # whose table is printed
MOST_NAMED = 3  # drifts, and logs that stand out
# robots shown log by log: those of which something was found, then the first
MOST_DRAWN = 40


def fleet_html(history: History, reports: Mapping[str, str] | None = None) -> str:
    """The page's text; `reports` says where the report of each job is."""
    return page(fleet_document(history, reports or {}))


def fleet_document(history: History, reports: Mapping[str, str] | None = None) -> Document:
    """The report of a fleet; `reports`, which only a page has, say where the report of each job is.

    A long list of robots is left to the page.
    """
    if reports is None:
        sections = [_table_section(history)]
    else:
        sections = _page_sections(history, reports)
    return Document(
        title="Fleet",
        verdict=verdict(history),
        sections=tuple(sections),
        kicker="a fleet's history",
        name="Fleet",
        facts=f"{counted(history.robots, 'robot')} · {counted(history.logs, 'log')}",
        made=f"Made by algid {__version__}.",
    )


def _table_section(history: History) -> Section:
    """The tables alone."""
    depth = Depth.TERMINAL
    if history.robots > MOST_ROBOTS:
        depth = Depth.PAGE
    content = [robot_table(history).at(depth)]
    content += filled(change_table(history), drift_table(history), finding_table(history))
    return Section(tuple(content))


def _page_sections(history: History, reports: Mapping[str, str]) -> list[Section]:
    """The tables with their drawings and links, what to look at first, then each robot."""
    keys = {robot: f"robot-{place}" for place, robot in enumerate(_drawn(history), start=1)}
    sections = [_linked_tables(history, keys, reports)]
    first = overview(history, reports)
    if first is not None:
        sections.append(Section((first,)))
    if keys:
        which = ReadingAid(_which(history, len(keys)))
        sections.append(Section((which,), "each", "Each robot"))
    shown = _only(history, list(keys))
    for robot, key in keys.items():
        sections.append(_robot_section(shown, robot, key, reports))
    others = _other_reports(history, keys, reports)
    sections.append(Section(others, "reports", "Other robots' reports", fold="closed"))
    return sections


def _linked_tables(
    history: History, keys: Mapping[str, str], reports: Mapping[str, str]
) -> Section:
    """The tables, whose names lead to a robot's section or report, or to a log's report."""
    places = {}
    for robot, job in history.roster.select("robot", "latest").iter_rows():
        if robot in keys:
            places[visible(robot)] = f"#{keys[robot]}"
        elif job in reports:
            places[visible(robot)] = reports[job]
    jobs = {visible(job): place for job, place in reports.items()}
    drawn = tuple(courses(history, MOST_ROWS))
    robots = replace(robot_table(history).at(Depth.PAGE), drawn=drawn, links=places)
    content: list[Content] = [robots]
    if drawn:
        drifts = ", orange drifts" if history.drifts.height else ""
        content.append(ReadingAid(READING.format(drifts=drifts)))
    content += filled(
        replace(change_table(history), links=places),
        replace(drift_table(history), links=places),
        replace(finding_table(history), links=jobs),
    )
    return Section(tuple(content))


def _drawn(history: History) -> list[str]:
    """Robots that are shown log by log, in the roster's order."""
    if history.jobs is None:
        return []
    every = history.roster["robot"].to_list()
    marked = history.drifts["robot"].to_list() + history.findings["robot"].to_list()
    if history.changes is not None:
        marked += history.changes["robot"].to_list()
    chosen = set(list(dict.fromkeys(marked + every))[:MOST_DRAWN])
    return [robot for robot in every if robot in chosen]


def _only(history: History, robots: list[str]) -> History:
    """The history of those robots alone, since their logs and windows are searched often."""
    import polars as pl

    own = pl.col("robot").is_in(robots)
    jobs = history.jobs
    if jobs is not None:
        jobs = jobs.filter(own)
    return replace(history, windows=history.windows.filter(own), jobs=jobs)


def _which(history: History, shown: int) -> str:
    if shown == history.robots:
        return "Read: open a robot to see all its parameters, log by log, and its reports."
    return (
        f"Read: open a robot to see all its parameters, log by log. {shown} of "
        f"{counted(history.robots, 'robot')} are "
        "here: those of which something was found, then the first."
    )


def _robot_section(history: History, robot: str, key: str, reports: Mapping[str, str]) -> Section:
    """A robot: its parameters, their courses and its reports, folded."""
    import polars as pl

    assert history.jobs is not None
    jobs = history.jobs.filter(pl.col("robot") == robot)
    title = f"{visible(robot)} · {counted(jobs.height, 'log')}"
    days = jobs["time"].drop_nulls()
    if len(days):
        first, last = days.min(), days.max()
        title += f" · {first.date()} to {last.date()}"  # type: ignore[union-attr]
    own = pl.col("robot") == robot
    drifting = history.drifts.filter(own)["parameter"].sort().to_list()
    if drifting:
        title += f" · {joined(drifting)} drift{'s' * (len(drifting) == 1)}"
    if history.changes is not None and history.changes.filter(own).height:
        title += " · changed at once"
    outlying = history.findings.filter(own)["job"].n_unique()
    if outlying:
        title += f" · {counted(outlying, 'log stands out', 'logs stand out')}"
    content: list[Content] = [
        parameter_table(history, robot, jobs),
        robot_figure(history, robot, jobs, reports, f"{key}-logs"),
    ]
    links = [(visible(job), reports[job]) for job in jobs["job"].to_list() if job in reports]
    if links:
        content.append(References({"Reports, the latest first": links}, MOST_ROWS))
    return Section(tuple(content), key, title, fold="closed", listed=False)


def _other_reports(
    history: History, keys: Mapping[str, str], reports: Mapping[str, str]
) -> tuple[References, ...]:
    """The reports of the robots that are not shown log by log."""
    if not reports or history.jobs is None:
        return ()
    groups: dict[str, list[tuple[str, str]]] = {}
    for (robot,), part in history.jobs.group_by("robot", maintain_order=True):
        if str(robot) not in keys:
            groups[str(robot)] = [
                (job, reports[job]) for job in part["job"].to_list() if job in reports
            ]
    if not groups:
        return ()
    return (References(groups, MOST_ROWS),)


def reports_of(history: History, batch: Path, out: Path) -> dict[str, str]:
    """Where each job's report is, as seen from `out`; jobs without one are left out."""
    if history.jobs is None:
        return {}
    reports, listed = {}, dict[str, frozenset[str]]()
    for job in history.jobs["job"].to_list():
        above = job.rpartition("/")[0]
        if above not in listed:  # a folder is looked into once, not once a job
            listed[above] = _names_in(batch / above)
        if f"{job.rpartition('/')[2]}.algid" not in listed[above]:
            continue
        page = batch / f"{job}.algid" / "report.html"
        if page.is_file():
            there = os.path.relpath(page.resolve(), out.resolve()).replace(os.sep, "/")
            reports[job] = "./" + quote(there)  # a name such as javascript: leads nowhere else
    return reports


def _names_in(folder: Path) -> frozenset[str]:
    """Names of what a folder holds; none where it cannot be read."""
    try:
        return frozenset(path.name for path in folder.iterdir())
    except (OSError, ValueError):
        return frozenset()


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
    return Notice("DRIFTS", numbers={"count": history.drifts.height, "names": names})


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
    return Notice("STAND_OUT", numbers={"count": worst.height, "names": names})


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
    return Notice("CHANGED", numbers=numbers)
