"""Many logs, one result folder each, and a table of them all."""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Unpack

from algid.api.answer import Answer
from algid.api.given import opened
from algid.api.options import OUT, AnyResult, Options, ProfileLike, meant, settings_of
from algid.api.signature import verb
from algid.base.errors import AlgidError, SettingError
from algid.base.exits import Exit
from algid.base.text import visible
from algid.options import Option, flag

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from algid.base.progress import Progress
    from algid.batches.jobs import Job
    from algid.batches.records import JobRecord
    from algid.batches.run import Batch, BatchOutcome
    from algid.profile import Profile
    from algid.settings import Settings

UNIT = "jobs"
"""What progress counts."""
Complaint = Callable[[str], None]
"""Hears, in one line, what goes wrong while a batch goes on."""


@dataclass(frozen=True)
class Batched:
    """How a batch ended.

    Parameters
    ----------
    records : of its jobs, each with name, status and the reason of a failure
    ran, left : how many were run now, and how many are left where it was stopped
    out : where results and ``jobs.parquet`` are, less what opens it
    interrupted : whether it was stopped by a signal
    stopped : why it could not go on, where it could not
    unreadable : why records that are there cannot be read, by their places
    links : to folders, that were passed over
    anew : how many jobs that had ended were run again, by why
    """

    records: list[JobRecord]
    ran: int
    left: int
    out: str
    interrupted: bool = False
    stopped: str | None = None
    unreadable: dict[str, str] = field(default_factory=dict)
    links: list[str] = field(default_factory=list)
    anew: dict[str, int] = field(default_factory=dict)

    @property
    def failed(self) -> list[JobRecord]:
        """Jobs without a result, or with one that must not be used."""
        from algid.batches.records import FAILURES

        return [record for record in self.records if record.status in FAILURES]

    @property
    def incomplete(self) -> bool:
        """Whether a job's result leaves a parameter open."""
        from algid.batches.records import JobStatus

        return any(record.status is JobStatus.INCOMPLETE for record in self.records)

    @property
    def counts(self) -> dict[str, int]:
        """Jobs by status, those there are."""
        from algid.batches.records import JobStatus

        counts = Counter(record.status for record in self.records)
        return {end.value: counts[end] for end in JobStatus if end in counts}


@verb
def batch(
    sources: Annotated[str | Path | Sequence[str | Path], Option(kind=list[str])],
    out: Annotated[str | Path, Option(kind=str, flag=OUT)],
    settings: Settings | None = None,
    *,
    parameters: AnyResult | None = None,
    profile: ProfileLike | None = None,
    workers: Annotated[int, Option(range=(1, 4096))] | None = None,
    scheduler: str | None = None,
    memory_limit: str | None = None,
    timeout: Annotated[float, Option(range=(1e-3, 1e7))] = 3600.0,
    retry_failed: bool = False,
    watch: bool = False,
    part: str | None = None,
    report: bool = True,
    progress: Progress | None = None,
    complain: Complaint | None = None,
    **options: Unpack[Options],
) -> Batched:
    """Identify many logs: a result folder a job and OUT/jobs.parquet.

    What is done already is not done again.

    X-unloaded.* and X-loaded.* are one job X. Ctrl-C ends it at once, and what was running is done
    by the next run.

    Parameters
    ----------
    sources : str or Path, one or several
        Folders, logs, globs, URLs, or a manifest (CSV, TOML).
    out : str or Path
        Folder, or s3://, gs://, az:// URL, for all results.
    settings : Settings
    parameters : Result or path of one
        Result of the arm identified before. Then logs are of the loaded arm.
    profile : Profile, path of one, or dict of what would stand in its file
        algid.toml: what the logs' names and units mean.
    workers : int
        Worker processes; one a core by default.
    scheduler : str
        tcp://HOST:PORT of a Dask scheduler to run on.
    memory_limit : str
        Memory of each worker, like 2GB. A job that needs more fails alone.
    timeout : float, s
        Seconds that a job may take; 3600. One that takes longer fails alone.
    retry_failed : bool
        Run jobs again that have failed.
    watch : bool
        Go on until a signal, and take logs as they arrive.
    part : str
        Share of the jobs, like 2/40, for arrays of processes.
    report : bool
        Write no pages and time series.
    progress : callable
        Called with the job that ended, and how many of how many have.
    complain : callable
        Called with a line about what goes wrong while a watch goes on.
    **options : of `Settings` and of `Profile`, by their names

    Returns
    -------
    Batched
        The jobs' records; failed jobs are no exception.

    Raises
    ------
    SettingError
        If a setting is wrong, there is no `out`, or the sources hold no log.
    OutputError
        If another batch is at work there.

    Examples
    --------
    $ algid batch logs/ -o results --workers 2

    >>> import tempfile
    >>> import algid
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = algid.synthesise("case1", duration=3.0, torque="wide", out=folder)
    ...     done = algid.batch(folder, f"{folder}/results", workers=1, report=False)
    >>> done.counts
    {'ok': 1}
    """
    from algid.base.stores import absolute, open_store, shown
    from algid.batches.discover import jobs_of
    from algid.batches.lock import locked
    from algid.batches.run import Batch, BatchConfig, stopped_by_signals, sweep
    from algid.identification.prior import statement_of

    if isinstance(sources, str | Path):
        sources = [sources]
    names, place = [str(one) for one in sources], str(out)
    if not place.strip():
        raise SettingError("-o: expected a folder or a URL, found none; name where results go")
    store = open_store(place)
    bytes_each = None
    if memory_limit is not None:
        bytes_each = bytes_of(memory_limit)
    if scheduler is not None and (workers is not None or memory_limit is not None):
        raise SettingError(
            f"{flag('scheduler')}: workers and their memory are the cluster's; set them where it "
            "is started"
        )
    asked, of_profile = settings_of(settings, profile, options)
    said = meant(profile, of_profile)
    known, alone = None, "logs"
    if parameters is not None:
        known, alone = opened(parameters), "loaded"
    statement_of(asked)  # what cannot be read is told once
    if scheduler is not None and asked.prior is not None:
        asked = asked.but(prior=absolute(asked.prior))
    if scheduler is not None:  # a worker's own folder is another
        names, place = [absolute(source) for source in names], absolute(place)

    def profile_of(file: str | None) -> Profile | None:
        """That of a manifest's entry with the options over it."""
        if file is None:
            return said
        return meant(file, settings_of(None, file, options)[1])

    def ended_job(last: JobRecord, done: int, total: int) -> None:
        if progress is not None:
            progress(f"{last.job.name[:50]}: {last.status.value}", done, total)

    recipe = BatchConfig(place, asked, cache(profile_of), known, report)  # each file once
    recipe.profile(None)
    jobs, links = [], list[str]()
    if not watch:
        jobs = jobs_of(names, place, alone, links)
    if not (jobs or watch):
        raise SettingError(f"{' '.join(names)}: expected logs in MCAP, Parquet or CSV, found none")
    if part is not None:
        jobs = share_of(jobs, part, watch)
    with locked(place, shared=part is not None):
        sweep(store)
        try:
            with _workers(place, scheduler, workers, bytes_each, timeout) as (executor, slots):
                running = Batch(
                    *(store, recipe, executor, slots, ended_job), shared=part is not None
                )
                with stopped_by_signals(running.stop):
                    if watch:
                        ended = watched(running, names, place, alone, retry_failed, complain)
                    else:
                        ended = running.run(jobs, retry_failed)
        finally:
            sweep(store)
    return Batched(
        ended.records,
        ended.ran,
        ended.left,
        shown(place),
        running.stop.is_set() and not watch,
        ended.stopped,
        running.unreadable,
        links,
        dict(running.anew),
    )


def answer(ended: Batched, _given: Mapping[str, Any]) -> Answer:
    """What failed, and how many ended how; the exit code tells the worst."""
    complaints = [
        f"{ended.out}/{name}: no record of a job ({why}); it counts as none: remove it"
        for name, why in ended.unreadable.items()
    ]
    if ended.links:
        named = ", ".join(ended.links[:8])
        complaints.append(
            f"links to folders are not entered ({named}); name what they lead to as sources"
        )
    lines = [
        f"{visible(one.job.name)}: {one.status.value}: {visible(one.reason)}"
        for one in ended.failed
    ]
    if ended.anew:
        why = ", ".join(f"{count} {visible(reason)}" for reason, count in ended.anew.items())
        lines.append(f"run anew: {why}")
    summary = ", ".join(f"{count} {name}" for name, count in ended.counts.items())
    lines.append(
        f"{summary or 'nothing done'}; {ended.ran} run now, {ended.left} left; "
        f"{ended.out}/jobs.parquet"
    )
    ended_as = Exit.OK
    if ended.incomplete:
        ended_as = Exit.FAILED
    if ended.failed or ended.left or ended.stopped is not None:
        ended_as = Exit.LIMIT
    if ended.stopped is not None:
        complaints.append(ended.stopped)
    elif ended.interrupted:
        ended_as = Exit.STOPPED
    return Answer(lambda: lines, complaints=complaints, exit=ended_as)


@contextmanager
def _workers(
    out: str, scheduler: str | None, workers: int | None, memory_limit: int | None, timeout: float
) -> Iterator[tuple[Executor, int]]:
    """The workers, and how many jobs to hand out at once; they end with the block."""
    from algid.base.runtime import cores
    from algid.batches.workers import Workers

    if scheduler is not None:
        from algid.base.stores import is_url
        from algid.batches.cluster import cluster
        from algid.batches.records import FOLDER

        folder = None if is_url(out) else Path(out, FOLDER)
        with cluster(scheduler, folder, timeout) as pool_and_size:
            yield pool_and_size
        return
    count = workers or cores()
    executor = Workers(count, memory_limit, timeout)
    try:
        yield executor, 2 * count
    finally:
        executor.shutdown()


def share_of(jobs: list[Job], part: str, watch: bool = False) -> list[Job]:
    """The jobs of a part like ``2/40``, every 40th from the second; raises `SettingError`."""
    number, count = part.split("/") if re.fullmatch("[0-9]{1,9}/[0-9]{1,9}", part) else ("0", "0")
    if watch or not 1 <= int(number) <= int(count):
        expected = f"expected 1/N to N/N, and no {flag('watch')}"
        raise SettingError(f"{flag('part')}: {expected}, found {part!r:.60}")
    return jobs[int(number) - 1 :: int(count)]


def bytes_of(text: str) -> int:
    """A size like ``2GB``; raises `SettingError` where it is none, or too small to work in."""
    from pydantic import ByteSize, TypeAdapter, ValidationError

    if sys.platform == "darwin":
        raise SettingError(
            f"{flag('memory_limit')}: macOS does not bound the memory of a process; leave it out"
        )
    try:
        size = TypeAdapter(ByteSize).validate_python(text.lower().removesuffix("b") + "b")
    except ValidationError:
        size = ByteSize(0)
    if size < 1 << 29:
        raise SettingError(
            f"{flag('memory_limit')}: expected at least 512MiB, like 2GB, found {text!r}"
        )
    return size


def watched(
    running: Batch,
    sources: Sequence[str],
    out: str,
    alone: str,
    retry_failed: bool,
    complain: Complaint | None = None,
) -> BatchOutcome:
    """Look for logs until stopped.

    Nothing but settled ones are taken, and a trouble is reported once.
    """
    from algid.batches.discover import jobs_of
    from algid.batches.run import LOOK_EVERY, StableFiles

    settling = StableFiles()
    complaint = ""
    ended = running.run([])
    while not running.stop.is_set():
        try:
            jobs = settling.settled(jobs_of(sources, out, alone))
        except AlgidError as error:  # a store may be away for a while
            jobs = []
            if str(error) != complaint:
                complaint = str(error)
                if complain is not None:
                    complain(complaint)
        if jobs:
            ended, retry_failed = running.run(jobs, retry_failed), False
        running.stop.wait(LOOK_EVERY)
    return ended
