"""`algid convert`: a log in another format, under algid's own names and units."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from algid.cli.completion import written
from algid.cli.output import remark
from algid.cli.settings import Choice, takes_profile
from algid.exits import exit_of

if TYPE_CHECKING:
    from algid.log import Log
    from algid.notices import Notice
    from algid.progress import Progress


@takes_profile
def convert(
    choice: Choice,
    source: Annotated[Path, typer.Argument(metavar="IN", help="The log to read.")],
    target: Annotated[Path, typer.Argument(metavar="OUT", help="The log to write: <written>.")],
    force: Annotated[bool, typer.Option(help="Overwrite OUT.")] = False,
) -> None:
    """Write a log in another format, in SI units, with canonical names.

    A synthetic log keeps its truth.

    Example: algid convert rosbag2_2026/ arm.parquet --joints shoulder,elbow --zero hanging

    Raises
    ------
    OutputError
        If no format has the suffix of OUT.
    typer.Exit
        At the end: with 4 where samples are missing, else with 0.
    """
    from algid.errors import OutputError
    from algid.files import refuse_existing
    from algid.readers import open_log
    from algid.report.progress import progress
    from algid.writers import FORMATS, write_log

    if target.suffix.lstrip(".").lower() not in FORMATS:
        raise OutputError(f"{target}: expected a name that ends in {', '.join(written())}")
    refuse_existing(target, force)
    reader = open_log(source, choice.profile())
    notices: list[Notice] = []

    def noted(shown: Progress | None) -> Iterator[Log]:
        """The blocks; keeps their notices, and tells how far the writing has come."""
        done = 0
        for block in reader.blocks():
            notices.extend(block.notices)
            yield block
            done += len(block)
            if shown is not None:
                shown("writing", done, reader.rows)

    with progress("samples") as shown:
        write_log(target, noted(shown), truth=reader.origin.truth)
    for notice in notices:
        remark(f"{notice.code}: {notice.clause}")
    raise typer.Exit(exit_of(failed=False, lost=any(notice.lossy for notice in notices)))
