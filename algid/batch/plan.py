"""Which jobs are still to be done."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from algid.batch.job import Task, basis_of, ended_record
from algid.batch.jobs import Job
from algid.batch.records import FAILURES, End, Input, Record, stat_of
from algid.errors import SettingError
from algid.identification.source import sha256_of
from algid.profile import Profile
from algid.results import Result
from algid.settings import Settings
from algid.stores import Store, is_url


@dataclass(frozen=True)
class Recipe:
    """What all jobs of a batch share; `profile` gives the profile of a job's file, or of none."""

    out: str
    settings: Settings
    profile: Callable[[str | None], Profile | None]
    parameters: Result | None = None
    report: bool = True

    def task(self, job: Job) -> Task:
        """The job with all that decides its outcome. Raises `SettingError` where its profile is wrong."""
        return self._task(job, self.profile(job.profile))

    def _task(self, job: Job, profile: Profile | None) -> Task:
        basis = basis_of(self.settings.as_json(), profile, self.parameters, self.report)
        return Task(job, basis, self.settings, profile, self.parameters, self.out, self.report)

    def refused(self, job: Job, error: SettingError) -> Record:
        """The record of a job whose profile cannot be used."""
        return ended_record(self._task(job, None), _inputs(job), status=End.FAILED, reason=str(error))


@dataclass(frozen=True)
class Plan:
    """Tasks to run, records of jobs that cannot even start, and records that stand as they are."""

    tasks: list[Task]
    refused: list[Record]
    standing: list[Record]


def plan(
    jobs: Iterable[Job], records: Mapping[str, Record], recipe: Recipe, store: Store, retry_failed: bool = False
) -> Plan:
    """Sort jobs by what is known of them; a job whose logs and settings are as they were is not run again.

    Labels, robot and time decide nothing about a job's outcome: a standing record takes over new ones.
    """
    made = Plan([], [], [])
    for job in jobs:
        try:
            task = recipe.task(job)
        except SettingError as error:
            made.refused.append(recipe.refused(job, error))
            continue
        record = records.get(job.name)
        if record is None or (retry_failed and record.status in FAILURES) or not _stands(record, task, store):
            made.tasks.append(task)
        else:
            made.standing.append(record)
    return made


def _stands(record: Record, task: Task, store: Store) -> bool:
    if record.basis != task.basis or (record.job.logs, record.job.loaded) != (task.job.logs, task.job.loaded):
        return False
    if record.status not in FAILURES and not store.exists(f"{task.job.name}.algid/result.json"):
        return False
    return all(_unchanged(one) for one in record.inputs)


def _inputs(job: Job) -> tuple[Input, ...]:
    return tuple(stat_of(path) for path in (*job.logs, *job.loaded))


def _unchanged(before: Input) -> bool:
    """Whether a log holds what it held: told by size and time of change, and by its hash where that time moved."""
    now = stat_of(before.path)
    if (now.size, now.mtime_ns) == (before.size, before.mtime_ns):
        return True
    if now.size != before.size or before.sha256 is None or is_url(before.path):
        return False
    try:
        return sha256_of(Path(before.path)) == before.sha256
    except OSError:
        return False
