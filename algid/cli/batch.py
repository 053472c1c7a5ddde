"""`algid batch`: many logs, one result folder each, and a table of them all."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from algid.cli.output import complain, say
from algid.cli.settings import Choice, takes_settings
from algid.exits import Exit

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from algid.batches.run import Batch, Ended, Progress


@takes_settings
def batch(
    choice: Choice,
    sources: Annotated[
        list[str],
        typer.Argument(
            metavar="SOURCE...", help="Folders, logs, globs, URLs, or a manifest (CSV, TOML)."
        ),
    ],
    out: Annotated[
        str,
        typer.Option("-o", "--out", help="Folder, or s3://, gs://, az:// URL, for all results."),
    ],
    parameters: Annotated[
        Path | None,
        typer.Option(help="Result of the arm identified before: then logs are of the loaded arm."),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="Worker processes; one a core by default.", min=1, max=4096)
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
            min=1e-3,
            max=1e7,
        ),
    ] = 3600.0,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="Run jobs again that have failed.")
    ] = False,
    watch: Annotated[
        bool, typer.Option("--watch", help="Go on, and take logs as they arrive.")
    ] = False,
    report: Annotated[
        bool, typer.Option(help="Write pages and time series beside each result.json.")
    ] = True,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Identify many logs: a result folder a job and OUT/jobs.parquet.

    What is done already is not done again.

    X-unloaded.* and X-loaded.* are one job X. Ctrl-C ends it at once, and what was running is done
    by the next run.

    Example: algid batch logs/ -o results --workers 2

    Raises
    ------
    SettingError
        If workers or their memory are given beside a scheduler, there is no OUT, or the sources
        hold no log.
    """
    from algid.batches.discover import jobs_of
    from algid.batches.lock import locked
    from algid.batches.run import Batch, Recipe, stopped_by_signals, sweep
    from algid.errors import SettingError
    from algid.results import read_result
    from algid.stores import absolute, open_store, shown

    if not out.strip():
        raise SettingError("-o: expected a folder or a URL, found none; name where results go")
    bytes_each = None if memory_limit is None else _bytes(memory_limit)
    if scheduler is not None and (workers is not None or memory_limit is not None):
        raise SettingError(
            "--scheduler: workers and their memory are the cluster's; set them where it is started"
        )
    known = None if parameters is None else read_result(parameters)
    profile = cache(
        lambda file: choice.profile(None if file is None else Path(file))
    )  # each file is read once
    if scheduler is not None:  # a worker's own folder is another
        sources, out = [absolute(source) for source in sources], absolute(out)
    recipe = Recipe(out, choice.settings(), profile, known, report)
    recipe.profile(None)
    alone = "logs" if known is None else "loaded"
    jobs = [] if watch else jobs_of(sources, out, alone)
    if not (jobs or watch):
        raise SettingError(
            f"{' '.join(sources)}: expected logs in MCAP, Parquet or CSV, found none"
        )
    store = open_store(out)
    with locked(out):
        sweep(store)
        try:
            with (
                _workers(out, scheduler, workers, bytes_each, timeout) as (executor, slots),
                _progress(quiet) as progress,
            ):
                running = Batch(store, recipe, executor, slots, progress)
                with stopped_by_signals(running.stop):
                    ended = (
                        _watch(running, sources, out, alone, retry_failed)
                        if watch
                        else running.run(jobs, retry_failed)
                    )
        finally:
            sweep(store)
    for name, why in running.unreadable.items():
        complain(f"{shown(out)}/{name}: no record of a job ({why}); it counts as none: remove it")
    _conclude(ended, running.stop.is_set() and not watch, out, quiet)


@contextmanager
def _workers(
    out: str, scheduler: str | None, workers: int | None, memory_limit: int | None, timeout: float
) -> Iterator[tuple[Executor, int]]:
    """The workers, and how many jobs to hand out at once; they end with the block."""
    from algid.batches.workers import Workers
    from algid.runtime import OPEN_FILES, OPEN_FILES_A_WORKER, cores, may_open

    if scheduler is not None:
        from algid.batches.cluster import cluster

        with cluster(scheduler, out, timeout) as found:
            yield found
        return
    count = workers or cores()
    may_open(OPEN_FILES + OPEN_FILES_A_WORKER * count)
    executor = Workers(count, memory_limit, timeout)
    try:
        yield executor, 2 * count
    finally:
        executor.shutdown(cancel_futures=True)


def _bytes(text: str) -> int:
    from algid.errors import SettingError

    if sys.platform == "darwin":
        raise SettingError(
            "--memory-limit: macOS does not bound the memory of a process; leave it out"
        )
    units = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9, "ki": 2**10, "mi": 2**20, "gi": 2**30}
    number = text.strip().lower().removesuffix("b")
    unit = number.lstrip("0123456789.").strip()
    try:
        size = int(float(number.removesuffix(unit)) * units[unit])
    except (ValueError, KeyError, OverflowError):
        size = 0
    if size < 1 << 29:
        raise SettingError(f"--memory-limit: expected at least 512MiB, like 2GB, found {text!r}")
    return size


@contextmanager
def _progress(quiet: bool) -> Iterator[Callable[[Progress], None]]:
    """A line for each job that ends, written over the last one.

    Nothing where standard error is no terminal.
    """
    if quiet or not sys.stderr.isatty():
        yield lambda _progress: None
        return

    def show(progress: Progress) -> None:
        text = f"{progress.done}/{progress.total} {progress.last.job.name[:50]}: {progress.last.status.value}"
        print(f"\r\x1b[2K{text}", end="", file=sys.stderr, flush=True)

    try:
        yield show
    finally:
        print("\r\x1b[2K", end="", file=sys.stderr, flush=True)


def _watch(running: Batch, sources: list[str], out: str, alone: str, retry_failed: bool) -> Ended:
    """Look for logs until stopped; nothing but settled ones are taken."""
    from algid.batches.discover import jobs_of
    from algid.batches.run import LOOK_EVERY, Settling
    from algid.errors import AlgidError

    settling = Settling()
    complaint = ""
    ended = running.run([])
    while not running.stop.is_set():
        try:
            jobs = settling.settled(jobs_of(sources, out, alone))
        except AlgidError as error:  # a store may be away for a while
            jobs = []
            if str(error) != complaint:
                complaint = str(error)
                complain(complaint)
        if jobs:
            ended, retry_failed = running.run(jobs, retry_failed), False
        running.stop.wait(LOOK_EVERY)
    return ended


def _conclude(ended: Ended, stopped: bool, out: str, quiet: bool) -> None:
    """Print what came of the jobs, and leave with the exit code that tells it."""
    from algid.batches.records import FAILURES, End
    from algid.stores import shown
    from algid.text import visible

    failed = [record for record in ended.records if record.status in FAILURES]
    if not quiet:
        for record in failed:
            say(f"{visible(record.job.name)}: {record.status.value}: {visible(record.reason)}")
        counts = {end: sum(record.status is end for record in ended.records) for end in End}
        summary = ", ".join(f"{count} {end.value}" for end, count in counts.items() if count)
        say(
            f"{summary or 'nothing done'}; {ended.ran} run now, {ended.left} left; {shown(out)}/jobs.parquet"
        )
    if ended.stopped is not None:
        complain(ended.stopped)
    elif stopped:
        raise typer.Exit(Exit.STOPPED)
    if failed or ended.left or ended.stopped is not None:
        raise typer.Exit(Exit.LIMIT)
    if any(record.status is End.INCOMPLETE for record in ended.records):
        raise typer.Exit(Exit.FAILED)
