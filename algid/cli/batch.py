"""`algid batch`: many logs, one result folder each, and a table of them all."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from algid.api.ranges import ends
from algid.cli.common import Quiet, out
from algid.cli.output import complain, say
from algid.cli.settings import Choice, takes_settings
from algid.exits import Exit

if TYPE_CHECKING:
    from algid.api.batch import Batched, Progress


@takes_settings
def batch(
    choice: Choice,
    sources: Annotated[
        list[str],
        typer.Argument(
            metavar="SOURCE...", help="Folders, logs, globs, URLs, or a manifest (CSV, TOML)."
        ),
    ],
    out: Annotated[str, out("Folder, or s3://, gs://, az:// URL, for all results.")],
    parameters: Annotated[
        Path | None,
        typer.Option(help="Result of the arm identified before: then logs are of the loaded arm."),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(help="Worker processes; one a core by default.", **ends("batch", "workers")),
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="tcp://HOST:PORT of a Dask scheduler to run on.")
    ] = None,
    memory_limit: Annotated[
        str | None,
        typer.Option(help="Memory of each worker, like 2GB; a job that needs more fails alone."),
    ] = None,
    timeout: Annotated[
        float,
        typer.Option(
            help="Seconds that a job may take; one that takes longer fails alone.",
            **ends("batch", "timeout"),
        ),
    ] = 3600.0,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="Run jobs again that have failed.")
    ] = False,
    watch: Annotated[
        bool, typer.Option("--watch", help="Go on, and take logs as they arrive.")
    ] = False,
    part: Annotated[
        str | None, typer.Option(help="Share of the jobs, like 2/40, for arrays of processes.")
    ] = None,
    report: Annotated[
        bool, typer.Option(help="Write pages and time series beside each result.json.")
    ] = True,
    quiet: Quiet = False,
) -> None:
    """Identify many logs: a result folder a job and OUT/jobs.parquet.

    What is done already is not done again.

    X-unloaded.* and X-loaded.* are one job X. Ctrl-C ends it at once, and what was running is done
    by the next run.

    Example: algid batch logs/ -o results --workers 2

    Raises
    ------
    typer.Exit
        As the table of exit codes has it, where that is not `Exit.OK`.
    """
    from algid.api.batch import batch as run

    with _progress(quiet) as progress:
        ended = run(
            sources,
            out,
            choice.settings(),
            parameters=parameters,
            profile_for=lambda file: choice.profile(None if file is None else Path(file)),
            workers=workers,
            scheduler=scheduler,
            memory_limit=memory_limit,
            timeout=timeout,
            retry_failed=retry_failed,
            watch=watch,
            part=part,
            report=report,
            progress=progress,
            complain=complain,
        )
    for name, why in ended.unreadable.items():
        complain(f"{ended.out}/{name}: no record of a job ({why}); it counts as none: remove it")
    if ended.links:
        named = ", ".join(ended.links[:8])
        complain(f"links to folders are not entered ({named}); name what they lead to as sources")
    _conclude(ended, quiet)


@contextmanager
def _progress(quiet: bool) -> Iterator[Callable[[Progress], None]]:
    """A line for each job that ends, written over the last one.

    Nothing where standard error is no terminal.
    """
    if quiet or not sys.stderr.isatty():
        yield lambda _progress: None
        return

    def show(progress: Progress) -> None:
        text = (
            f"{progress.done}/{progress.total} {progress.last.job.name[:50]}: "
            f"{progress.last.status.value}"
        )
        print(f"\r\x1b[2K{text}", end="", file=sys.stderr, flush=True)

    try:
        yield show
    finally:
        print("\r\x1b[2K", end="", file=sys.stderr, flush=True)


def _conclude(ended: Batched, quiet: bool) -> None:
    """Print what came of the jobs, and leave with the exit code that tells it."""
    from algid.text import visible

    if not quiet:
        for record in ended.failed:
            say(f"{visible(record.job.name)}: {record.status.value}: {visible(record.reason)}")
        if ended.anew:
            why = ", ".join(f"{count} {visible(reason)}" for reason, count in ended.anew.items())
            say(f"run anew: {why}")
        summary = ", ".join(f"{count} {name}" for name, count in ended.counts.items())
        say(
            f"{summary or 'nothing done'}; {ended.ran} run now, {ended.left} left; "
            f"{ended.out}/jobs.parquet"
        )
    if ended.stopped is not None:
        complain(ended.stopped)
    elif ended.interrupted:
        raise typer.Exit(Exit.STOPPED)
    if ended.failed or ended.left or ended.stopped is not None:
        raise typer.Exit(Exit.LIMIT)
    if ended.incomplete:
        raise typer.Exit(Exit.FAILED)
