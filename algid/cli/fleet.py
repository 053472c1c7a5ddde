"""`algid fleet`: the history of all robots of a batch."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from algid.cli.common import Form, Quiet, ResultFormat, out, print_report
from algid.cli.output import remark


def fleet(
    batch: Annotated[
        Path, typer.Argument(metavar="BATCH", help="Folder of algid batch, with its jobs.parquet.")
    ],
    out: Annotated[Path | None, out("Folder to write into; BATCH by default.")] = None,
    form: Form = ResultFormat.TABLE,
    quiet: Quiet = False,
) -> None:
    """Tell which robots' parameters drift, and which logs stand out.

    Write fleet.parquet, findings.parquet, fleet.html.

    Robots come from the manifest or from the logs' folders, times from the manifest or from the
    logs' stamps; robots whose logs have no date are looked at for outliers and wrong labels.

    Example: algid fleet results
    """
    from algid.api.fleet import as_json, document
    from algid.api.fleet import fleet as run
    from algid.report.progress import progress

    with progress("parameters", quiet) as followed:
        history, written = run(batch, out, progress=followed)
    if quiet:
        return
    print_report(document(history), lambda: as_json(history), form)
    for path in written:
        remark(f"wrote {path}")
