"""The fleet's page: its robots, what was found of them, and a figure of that."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

from algid.base.files import whole_file
from algid.base.significance import NORMAL
from algid.base.text import cells, counted, joined, percent, significant, unit_text, visible
from algid.fleet.findings import ALPHA, CHANGED, SPAN
from algid.fleet.history import History
from algid.model import UNITS
from algid.notices import Notice, Verdict, graded
from algid.report.document import Document, Section, Table
from algid.report.plot import Panels
from algid.report.render import page, write_texts

ROBOT = "{latest} | {robot} | {logs} | {found} | {first:%Y-%m-%d} | {last:%Y-%m-%d}"
OF = "{job} | {robot} | {parameter} | {kind} | "
ONE = OF + "{value:~5} for {expected:~5} | {sigmas:~2} | {time:%Y-%m-%d}"
DRIFT = OF + "{value} ± {half} % | {sigmas:~2} | {time:%Y-%m-%d}"
STEP = OF + "{value} ± {half} % | {sigmas:~2} | {before:%Y-%m-%d} to {time:%Y-%m-%d}"
MOST_ROBOTS = 40  # whose table is printed
MOST_ROWS = 200
MOST_NAMED = 3  # in a reason of the verdict
MOST_PANELS = 12
MOST_POINTS = 400  # of a robot: the latest logs


def write_history(history: History, out: Path) -> tuple[Document, list[Path]]:
    """The report of a fleet, and the files it is in: ``fleet.html``, and two tables as Parquet.

    Raises
    ------
    OutputError
        If `out` cannot be written.
    """
    for name, frame in (("fleet.parquet", history.windows), ("findings.parquet", history.findings)):
        with whole_file(out / name) as temporary:
            frame.write_parquet(temporary)
    figure = overview(history)
    folded = history.roster.height > MOST_ROBOTS
    document = Document(
        verdict=verdict(history),
        sections=(
            Section("numbers", "Findings", (finding_table(history),)),
            Section("logs", "Log by log", (figure,) if figure else ()),
            Section("robots", "Robots", (robot_table(history),), folded=folded),
        ),
        kicker="a fleet's history",
        name="Fleet",
    )
    written = write_texts(out, {"fleet.html": page(document)})
    return document, [out / "fleet.parquet", out / "findings.parquet", *written]


def verdict(history: History) -> Verdict:
    """Grade a fleet by what drifts, changed or stands out, and by what could not be tested."""
    reasons, counts = list[Notice](), list[str]()
    for (kind,), found in history.findings.group_by("kind", maintain_order=True):
        whose = found["robot" if kind in ("drift", "step") else "job"]
        names = [
            f"{one} of {visible(of)}" for one, of in zip(found["parameter"], whose, strict=True)
        ]
        counts.append(counted(len(names), str(kind)))
        numbers = {"case": kind, "count": len(names), "names": joined(names, MOST_NAMED)}
        reasons.append(Notice("FLEET_CHANGE", numbers=numbers))
    fleet = f"{counted(history.roster.height, 'robot')}, {counted(history.jobs.height, 'log')}"
    headline = f"{fleet}: {joined(counts) or 'no findings'}"
    return graded(headline, reasons + history.untested)


def robot_table(history: History) -> Table:
    """Every robot: its latest log, how many logs, how many findings, and their dates."""
    counts, rows = dict(history.findings["robot"].value_counts().iter_rows()), []
    for row in history.roster.head(MOST_ROWS).iter_rows(named=True):
        found = counts.get(row["robot"]) or ("none" if row["tested"] else "not tested")
        rows.append(cells(ROBOT, found=found, **row))
    columns, cut = "Latest log | Robot | Logs | Findings | From | To", _cut(history.roster, "robot")
    return Table("Robots", columns, rows, cut)


def finding_table(history: History) -> Table:
    """Drifts, steps, payloads unlike their labels and outliers, of each the clearest first."""
    rows = []
    for row in history.findings.head(MOST_ROWS).iter_rows(named=True):
        own, value, expected = ONE, row["value"], row["expected"]
        if row["half"] is not None:
            own = STEP if row["before"] else DRIFT
            row |= {"value": percent(value, expected, 3), "half": percent(row["half"], expected)}
        rows.append(cells(own, **row))
    note = (
        f"± is 95 %. A drift is a slope a month over {SPAN} months with p < "
        f"{significant(ALPHA, 1)}; a step, where an arm, a drive or a convention was replaced, has "
        f"p < {significant(CHANGED, 1)} in a robot's life: what comes before and after is tested "
        f"apart. A payload is unlike its label. {_cut(history.findings, 'finding')}"
    )
    columns = "Log | Robot | Parameter | What | By | σ | When"
    return Table("Findings", columns, rows, note.rstrip())


def _cut(every: pl.DataFrame, things: str) -> str:
    """That a long table is cut; nothing of a short one."""
    cut = f"{counted(every.height, things)}; the first {MOST_ROWS} are shown."
    return cut if every.height > MOST_ROWS else ""


def overview(history: History) -> Panels | None:
    """A point a log on a dated axis: of what was found, the clearest of each kind first.

    Of a fleet without findings, its clearest trends. None without a log that has a time.
    """
    dated, found = history.jobs.drop_nulls("time"), history.findings
    if not dated.height:
        return None
    shown = found if found.height else history.windows.sort("p", nulls_last=True)
    pairs = shown.select("robot", "parameter").unique(maintain_order=True).head(MOST_PANELS).rows()
    titles = [f"{robot}: {name}, {unit_text(UNITS[name])}" for robot, name in pairs]
    panels = Panels("logs", titles)
    for place, (robot, name) in enumerate(pairs):
        logs = dated.filter(pl.col(f"{name}_std") > 0, robot=robot).head(MOST_POINTS)
        half = (NORMAL * logs[f"{name}_std"]).to_list()
        bars = {"type": "data", "array": half, "thickness": 1, "width": 0}
        panels.add(place, _dates(logs["time"]), logs[name].to_numpy(), "log", error_y=bars)
        single = found.filter(pl.col("kind") != "step", robot=robot, parameter=name)
        logs = logs.join(single, on="job", how="semi")
        if logs.height:
            panels.add(place, _dates(logs["time"]), logs[name].to_numpy(), "finding")
        for day in _dates(found.filter(robot=robot, kind="step")["time"].unique().sort()).tolist():
            panels.mark(place, "change", day)
        windows = history.windows.filter(robot=robot, parameter=name)
        for stint in windows.partition_by("stint", maintain_order=True):
            panels.add(place, _dates(stint["end"]), stint["mean"].to_numpy(), "mean")
        panels.axes(place, "date")
    return panels


def _dates(column: pl.Series) -> NDArray[np.int64]:
    """Times as plotly's milliseconds since 1970."""
    return np.asarray(column.dt.epoch("ms").to_numpy(), dtype=np.int64)
