"""From sources to jobs: files, folders, globs and manifests.

X-unloaded.* and X-loaded.* make one job X.

A log that cannot be a job, by its name or because another has it too, is one that fails alone: see
`Job.trouble`.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from glob import glob
from pathlib import Path
from urllib.parse import unquote

from algid.base.errors import SettingError
from algid.base.stores import is_url, list_urls, shown
from algid.batches.jobs import TABLE, Job, fit_name, redacted_path, safe_name
from algid.batches.manifest import is_manifest, read_manifest
from algid.readers.formats import SUFFIXES

BAG = "metadata.yaml"
"""What makes a folder a bag."""
MOST_NAMED = 8
"""Logs of one name that are listed."""
_ENDINGS = "|".join(map(re.escape, SUFFIXES))
_NAME = re.compile(rf"(.+?)(?:[-_](unloaded|loaded))?(?i:{_ENDINGS})?", re.DOTALL)


def jobs_of(
    sources: Sequence[str], out: str, alone: str = "logs", links: list[str] | None = None
) -> list[Job]:
    """The jobs that sources hold, sorted by name.

    Parameters
    ----------
    sources : paths of logs, folders, globs, manifests, or URLs of an object store
    out : where results go; logs are not looked for within it
    alone : 'logs' or 'loaded'
        What a log is whose name does not tell.
    links : takes links to folders, which are not entered

    Raises
    ------
    SettingError
        If a source is not there or cannot be looked at, or a manifest is wrong.
    """
    jobs: dict[str, Job] = {}
    links = [] if links is None else links
    for source in sources:
        try:
            if not is_url(source) and is_manifest(Path(source)):
                found = read_manifest(Path(source))
            else:
                found = [_job_of(*one, alone) for one in _logs(source, out, links)]
        # a NUL in a path; folders within folders beyond what Python walks
        except (OSError, ValueError, RecursionError) as error:
            raise SettingError(
                f"{source}: cannot look there ({error}); check its name and rights"
            ) from error
        for job in found:
            jobs[job.name] = _together(jobs.get(job.name, job), job)
    return [jobs[name] for name in sorted(jobs)]


Found = tuple[str, str, str | None]
"""A log's path or URL, its name below its source, and why it is unreadable."""


def _logs(source: str, out: str, links: list[str]) -> list[Found]:
    """The logs of a source."""
    path = Path(source)
    if is_url(source) or (path.is_dir() and not _is_bag(source)):
        return list(_below(source, out, links))
    if path.exists():
        return [(source, path.name, None)]
    if "**" in path.parts:
        raise SettingError(f"{source}: expected no **; name the folder, all logs in it are found")
    found = list[Found]()
    for match in sorted(glob(source)):  # noqa: PTH207 (it may be absolute)
        if _is_bag(match) or not Path(match).is_dir():
            found.append((match, Path(match).name, None))
    if not found:
        raise SettingError(f"{source}: there is no such file, folder or match; check the name")
    return found


def _below(source: str, out: str, links: list[str]) -> Iterator[Found]:
    """Logs below a URL, or logs and bags below a folder; and folders where nobody may look.

    Hidden ones, results and what lies in `out` are passed over. Links to folders are not entered,
    but added to `links`.

    Raises
    ------
    OSError
        If nobody may look into the source itself.
    """
    ends = [unquote(shown(one)) if is_url(one) else os.path.realpath(one) for one in (out, source)]
    inside = os.path.relpath(*ends)  # OUT as seen from the source

    def is_passed_over(name: str) -> bool:
        own = name == TABLE if inside == "." else f"{name}/".startswith(f"{inside}/")
        return own or any(
            part.startswith(".") or part.endswith(".algid") for part in name.split("/")
        )

    def is_log(name: str) -> bool:
        return name.lower().endswith(SUFFIXES) and not is_passed_over(name)

    if is_url(source):
        yield from ((url, name, None) for url, name in list_urls(source) if is_log(name))
        return
    folder, unreadable = str(Path(source)), list[OSError]()
    for place, folders, names in os.walk(folder, onerror=unreadable.append):
        below = place[len(folder) :].strip("/")
        if BAG in names and below:
            folders.clear()
            yield place, below, None
            continue
        below += "/" if below else ""
        folders[:] = [name for name in folders if not is_passed_over(below + name)]
        links += [f"{place}/{name}" for name in folders if Path(place, name).is_symlink()]
        for name in sorted(names):
            if is_log(below + name):
                yield f"{place}/{name}", below + name, None
    for error in unreadable:
        place = str(error.filename)
        if place == folder:
            raise error
        reason = f"{redacted_path(place)}: cannot look there ({error.strerror}); check its rights"
        yield place, place[len(folder) + 1 :], reason


def _is_bag(path: str) -> bool:
    return Path(path, BAG).is_file()


def _job_of(path: str, name: str, trouble: str | None, alone: str) -> Job:
    """The job of one log; one whose name is unfit stands under another."""
    match = _NAME.fullmatch(name)
    name, role = match.groups(alone) if match else (name, alone)
    try:
        fit_name(name)
    except ValueError as error:
        trouble = trouble or f"{redacted_path(path)}: {error}; rename it"
    if trouble:
        return Job(safe_name(name), logs=(path,), trouble=trouble)
    logs, loaded = ((), (path,)) if role == "loaded" else ((path,), ())
    return Job(name, logs, loaded, robot=name.rpartition("/")[0] or None)


def _together(first: Job, second: Job) -> Job:
    """One job of two of one name: logs of both roles, or one that cannot be run."""
    logs = tuple(dict.fromkeys(first.logs + second.logs))
    loaded = tuple(dict.fromkeys(first.loaded + second.loaded))
    both = replace(first, logs=logs, loaded=loaded)
    fits = logs in (first.logs, second.logs) and loaded in (first.loaded, second.loaded)
    if fits and replace(second, logs=logs, loaded=loaded) == both:
        return both
    paths = ", ".join(map(redacted_path, (logs + loaded)[:MOST_NAMED]))
    remedy = "rename a log, or name the jobs in a manifest"
    return replace(both, trouble=f"{first.name}: two jobs of one name ({paths}); {remedy}")
