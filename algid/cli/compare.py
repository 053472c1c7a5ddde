"""`algid compare`: results side by side."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from algid.cli.output import console, remark, say
from algid.cli.report import ResultFormat
from algid.errors import SettingError


def compare(
    results: Annotated[
        list[Path], typer.Argument(metavar="RESULT RESULT...", help="Two results or more.")
    ],
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Folder to write the page compare.html to.")
    ] = None,
    form: Annotated[
        ResultFormat, typer.Option("--format", help="How to print the comparison.")
    ] = ResultFormat.TABLE,
) -> None:
    """Lay results side by side: differences in σ from the first one, and which settings differ.

    Example: algid compare monday.algid friday.algid -o friday

    Raises
    ------
    SettingError
        If there are fewer than two results.
    """
    from algid.report.comparison import compare as compared
    from algid.report.comparison import comparison_json
    from algid.report.markdown import markdown_table
    from algid.report.terminal import print_table
    from algid.results import read_result

    if len(results) < 2:
        raise SettingError(
            f"compare: expected two results or more, found {len(results)}; name another one"
        )
    read = [read_result(path) for path in results]
    found = compared(read, labels(results))
    if form is ResultFormat.TABLE:
        terminal = console()
        for table in (found.estimates, found.settings):
            print_table(table, terminal)
            terminal.print()
    elif form is ResultFormat.MARKDOWN:
        say("\n".join(markdown_table(table) for table in (found.estimates, found.settings)), end="")
    else:
        say(comparison_json(found, read), end="")
    if out is not None:
        from algid.report.comparison_page import write_comparison

        remark(f"wrote {write_comparison(found, read, out)}")


def labels(paths: list[Path]) -> list[str]:
    """The folders' names without the suffix, with as many folders above them as tell them apart."""
    folders = [(path.parent if path.name == "result.json" else path).resolve() for path in paths]
    parts = [(*folder.parent.parts, folder.name.removesuffix(".algid")) for folder in folders]
    for depth in range(1, max(map(len, parts)) + 1):
        names = ["/".join(part[-depth:]) for part in parts]
        if len(set(names)) == len(names):
            return names
    return [str(folder) for folder in folders]  # one of them is named twice
