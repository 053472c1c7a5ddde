"""`algid compare`: results side by side."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from algid.cli.common import Force, Form, Quiet, ResultFormat, out, print_tables
from algid.cli.output import remark


def compare(
    results: Annotated[
        list[Path], typer.Argument(metavar="RESULT RESULT...", help="Two results or more.")
    ],
    out: Annotated[
        Path | None, out("Page NAME.html, or the folder to write compare.html into.")
    ] = None,
    force: Force = False,
    form: Form = ResultFormat.TABLE,
    quiet: Quiet = False,
) -> None:
    """Lay results side by side: differences in σ from the first one, and which settings differ.

    Example: algid compare monday.algid friday.algid -o friday
    """
    from algid.api.compare import compare as run
    from algid.api.compare import page_of

    comparison = run(*results, out=out, force=force)
    if quiet:
        return
    print_tables(comparison.tables(), comparison.as_json, form)
    if out is not None:
        remark(f"wrote {page_of(out)}")
