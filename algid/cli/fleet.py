"""`algid fleet`: the history of all robots of a batch."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from algid.cli.output import remark
from algid.cli.report import ResultFormat, print_report


def fleet(
    batch: Annotated[
        Path, typer.Argument(metavar="BATCH", help="Folder of algid batch, with its jobs.parquet.")
    ],
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Folder to write to; BATCH by default.")
    ] = None,
    form: Annotated[
        ResultFormat, typer.Option("--format", help="What to print.")
    ] = ResultFormat.TABLE,
) -> None:
    """Tell which robots' parameters drift, and which logs stand out.

    Write fleet.parquet, findings.parquet, fleet.html.

    Robots come from the manifest or from the logs' folders, times from the manifest or from the
    logs' stamps; robots whose logs have no date are looked at for outliers and wrong labels.

    Example: algid fleet results
    """
    from algid.fleet.history import history_of, write_history
    from algid.fleet.page import fleet_document
    from algid.report.progress import progress

    with progress("parameters") as followed:
        history = history_of(batch / "jobs.parquet", followed)
        written = write_history(history, batch if out is None else out, batch)
    print_report(
        fleet_document(history),
        lambda: json.dumps(history.as_dict(), indent=2, allow_nan=False) + "\n",
        form,
    )
    for path in written:
        remark(f"wrote {path}")
