"""Many logs, one result folder each, and a table of them all."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Unpack

from pydantic import ByteSize, Field

from algid.api import Answer
from algid.api.options import AnyResult, Options, ProfileLike, meant, opened, settings_of, verb
from algid.base.errors import Exit, SettingError
from algid.base.limits import within
from algid.base.text import visible
from algid.options import Option, flag

if TYPE_CHECKING:
    from algid.base.progress import Progress
    from algid.batches.jobs import Job
    from algid.batches.run import Batched
    from algid.settings import Settings
Size = Annotated[str | int, Option(check=Annotated[ByteSize, Field(ge=1 << 29)])]
Part = Annotated[str, Field(pattern="^[0-9]{1,9}/[0-9]{1,9}$")]
Complaint = Callable[[str], None]
"""Hears, in one line, what goes wrong while a batch goes on."""


@verb
def batch(
    sources: Annotated[str | Path | Sequence[str | Path], Option(kind=list[str])],
    out: Annotated[str | Path, Option(kind=str)],
    settings: Settings | None = None,
    *,
    parameters: AnyResult | None = None,
    profile: ProfileLike | None = None,
    workers: Annotated[int, within((1, 4096))] | None = None,
    scheduler: str | None = None,
    memory_limit: Size | None = None,
    timeout: Annotated[float, within((1e-3, 1e7))] = 3600.0,
    retry_failed: bool = False,
    watch: bool = False,
    part: Part | None = None,
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
    from algid.base.runtime import cores
    from algid.base.stores import absolute, is_url, open_store, shown
    from algid.batches.discover import jobs_of
    from algid.batches.job import Task
    from algid.batches.jobs import FOLDER
    from algid.batches.run import Batch, locked, stopped_by_signals, sweep
    from algid.batches.workers import Workers
    from algid.identification.prior import statement_of

    if isinstance(sources, str | Path):
        sources = [sources]
    names, place = [str(one) for one in sources], str(out)
    links = None if watch else list[str]()
    if not place.strip():
        raise SettingError("-o: expected a folder or a URL, found none; name where results go")
    store = open_store(place)
    if memory_limit is not None and sys.platform == "darwin":
        raise SettingError(
            f"{flag('memory_limit')}: macOS does not bound the memory of a process; leave it out"
        )
    asked, of_profile = settings_of(settings, options)
    said = meant(profile, of_profile)
    known = None if parameters is None else opened(parameters)
    statement_of(asked)  # what cannot be read is told once
    if scheduler is not None:  # a worker's own folder is another
        if workers is not None or memory_limit is not None:
            raise SettingError(
                f"{flag('scheduler')}: workers and their memory are the cluster's; set them where "
                "it is started"
            )
        if asked.prior is not None:
            asked = asked.but(prior=absolute(asked.prior))
        names, place = [absolute(source) for source in names], absolute(place)

    profile_of = cache(lambda file: meant(file, of_profile))  # each file of a manifest once

    def task_of(job: Job) -> Task:
        of_job = said
        try:
            if job.profile is not None and job.trouble is None:
                of_job = profile_of(job.profile)
        except SettingError as error:
            job = replace(job, trouble=str(error))
        return Task(job, asked, place, of_job, known, report)

    look = partial(jobs_of, names, place, "logs" if known is None else "loaded", links)
    jobs = [] if watch else look()
    if not (jobs or watch):
        raise SettingError(
            f"{' '.join(names) or 'batch'}: expected logs in MCAP, Parquet or CSV, found none"
        )
    if part is not None:
        number, count = map(int, part.split("/"))
        if watch or not 1 <= number <= count:
            expected = f"expected 1/N to N/N, and no {flag('watch')}"
            raise SettingError(f"{flag('part')}: {expected}, found {part!r:.60}")
        jobs = jobs[number - 1 :: count]
    with ExitStack() as stack:
        stack.enter_context(locked(place, shared=part is not None))
        sweep(store)
        stack.callback(sweep, store)
        if scheduler is None:
            size: Any = memory_limit  # a number by now
            count = workers or cores()
            submit = stack.enter_context(Workers(count, size, timeout)).submit
            slots = 2 * count
        else:
            from algid.batches.cluster import cluster

            folder = None if is_url(place) else Path(place, FOLDER)
            submit, slots = stack.enter_context(cluster(scheduler, folder, timeout))
        running = Batch(store, task_of, submit, slots, progress, shared=part is not None)
        stack.enter_context(stopped_by_signals(running.stop))
        if watch:
            ended = running.watch(look, retry_failed, complain)
        else:
            ended = running.run(jobs, retry_failed)
    stopped = running.stop.is_set() and not watch
    return replace(ended, out=shown(place), interrupted=stopped, links=links or ())


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
    ended_as = Exit.FAILED if "incomplete" in ended.counts else Exit.OK
    if ended.failed or ended.left or ended.stopped:
        ended_as = Exit.LIMIT
    if ended.stopped:
        complaints.append(ended.stopped)
    elif ended.interrupted:
        ended_as = Exit.STOPPED
    return Answer(lines, complaints=complaints, exit=ended_as)
