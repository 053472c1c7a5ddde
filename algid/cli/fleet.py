"""`algid fleet`: the history of all robots of a batch."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def fleet(
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Folder of algid batch, with its jobs.parquet.")],
) -> None:
    """Tell which robots' parameters drift, and which logs stand out; write fleet.parquet, findings.parquet, fleet.html.

    Robots come from the manifest or from the logs' folders, times from the manifest or from the logs' stamps.

    Example: algid fleet results
    """
    from rich.console import Console

    from algid.fleet.history import history_of, write_history
    from algid.fleet.page import drift_table, finding_table
    from algid.report.progress import progress
    from algid.report.terminal import print_one

    with progress("parameters") as told:
        history = history_of(out / "jobs.parquet", told)
        written = write_history(history, out)
    console = Console()
    for table in (drift_table(history), finding_table(history)):
        if table.rows:
            print_one(table, console)
            console.print()
    typer.echo(f"{history.robots} robots, {history.logs} logs: {history.drifts.height} drifts found")
    for path in written:
        typer.echo(f"wrote {path}", err=True)
