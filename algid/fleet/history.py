"""`algid fleet`: from ``jobs.parquet`` to ``fleet.parquet``, ``findings.parquet`` and ``fleet.html``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from algid.errors import ResultError
from algid.fleet.findings import mislabelled, outliers
from algid.fleet.windows import parameters_in, read_jobs, windows
from algid.outfiles import whole_file
from algid.progress import Told

if TYPE_CHECKING:
    import polars as pl


@dataclass(frozen=True, eq=False)
class History:
    """A fleet's history: windows (`algid.fleet.windows`), findings (`algid.fleet.findings`), and what they rest on."""

    windows: pl.DataFrame
    findings: pl.DataFrame
    robots: int
    logs: int

    @property
    def drifts(self) -> pl.DataFrame:
        """The latest drifting window of each robot and parameter, the clearest first."""
        import polars as pl

        found = self.windows.filter("drift").sort("month").group_by("robot", "parameter").last()
        return found.sort(pl.col("p"), "robot", "parameter")


def history_of(path: Path, told: Told | None = None) -> History:
    """The history in ``jobs.parquet`` at `path`; `told` hears how many parameters have been followed.

    Raises
    ------
    ResultError
        If it cannot be read, or no finished job has both a robot and a time.
    """
    import polars as pl

    jobs = read_jobs(path)
    names = parameters_in(jobs)
    if not jobs.height or not names:
        raise ResultError(f"{path}: no finished job has a robot, a time and parameters; name them in a manifest")
    followed = []
    for place, name in enumerate(names):
        if told is not None:
            told("following", place, len(names))
        followed.append(windows(jobs, name))
    history = pl.concat(followed)
    findings = pl.concat([mislabelled(jobs), outliers(jobs)]).sort(
        "kind", "robot", "time", "parameter", descending=False
    )
    return History(history, findings, jobs["robot"].n_unique(), jobs.height)


def write_history(history: History, out: Path) -> list[Path]:
    """Write ``fleet.parquet``, ``findings.parquet`` and ``fleet.html`` into `out`. Raises `OutputError`."""
    from algid.fleet.page import fleet_html

    written = []
    for name, frame in (("fleet.parquet", history.windows), ("findings.parquet", history.findings)):
        with whole_file(out / name) as temporary:
            frame.write_parquet(temporary)
        written.append(out / name)
    with whole_file(out / "fleet.html") as temporary:
        temporary.write_text(fleet_html(history), encoding="utf-8")
    return [*written, out / "fleet.html"]
