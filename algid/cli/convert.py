"""`algid convert`: a log in another format, under algid's own names and units."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from algid.cli.common import Force, Quiet, out
from algid.cli.output import remark
from algid.cli.settings import Choice, takes_profile
from algid.exits import exit_of


@takes_profile
def convert(
    choice: Choice,
    log: Annotated[Path, typer.Argument(help="The log to read.")],
    out: Annotated[Path, out("File to write: <written>.")],
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Write a log in another format, in SI units, with canonical names.

    A synthetic log keeps its truth.

    Example: algid convert rosbag2_2026/ -o arm.parquet --joints shoulder,elbow --zero hanging

    Raises
    ------
    typer.Exit
        At the end: with 4 where samples are missing, else with 0.
    """
    from algid.api.convert import convert as run
    from algid.report.progress import progress

    with progress("samples", quiet) as shown:
        notices = run(log, out, profile=choice.profile(), force=force, progress=shown)
    if not quiet:
        for notice in notices:
            remark(f"{notice.code}: {notice.clause}")
        remark(f"wrote {out}")
    raise typer.Exit(exit_of(failed=False, lost=any(notice.lossy for notice in notices)))
