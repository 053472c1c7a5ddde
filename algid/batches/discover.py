"""From sources to jobs: files, folders, globs and manifests.

X-unloaded.* and X-loaded.* make one job X.

A log that cannot be a job, by its name or because another has it too, is one that fails alone: see
`Job.trouble`.
"""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from urllib.parse import unquote

from algid.base.errors import SettingError
from algid.base.stores import is_url, list_urls, shown
from algid.batches.jobs import TABLE, Job, name_fault, redacted_path, safe_name
from algid.batches.manifest import is_manifest, read_manifest
from algid.readers.formats import SUFFIXES

BAG = "metadata.yaml"
"""What makes a folder a bag."""
MOST_NAMED = 8
"""Logs of one name that are listed."""
_ROLE = re.compile(r"(?P<base>.+)[-_](?P<role>unloaded|loaded)")


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
                all_jobs = read_manifest(Path(source))
            else:
                all_jobs = _paired(_logs(source, out, links), alone)
        # a NUL in a path; folders within folders beyond what Python walks
        except (OSError, ValueError, RecursionError) as error:
            raise SettingError(
                f"{source}: cannot look there ({error}); check its name and rights"
            ) from error
        for job in all_jobs:
            before = jobs.get(job.name, job)
            if before != job:
                job = _of_one_name(before, job)
            jobs[job.name] = job
    return [jobs[name] for name in sorted(jobs)]


Found = tuple[str, str, str | None]
"""A log's path or URL, its name below its source without suffix, and why it is unreadable."""


def _logs(source: str, out: str, links: list[str]) -> list[Found]:
    """The logs of a source."""
    if is_url(source):
        place, below = f"{shown(out)}/", f"{shown(source)}/"
        inside = place.removeprefix(below) if is_url(out) and place.startswith(below) else None
        named: list[Found] = []
        for url, name in list_urls(source):
            parts = name.split("/")
            hidden = any(part.startswith(".") for part in parts)
            own = any(part.endswith(".algid") for part in parts[:-1])
            if inside is not None:  # what this batch has written there
                own |= name.startswith(unquote(inside)) if inside else name == TABLE
            if name.lower().endswith(SUFFIXES) and not (hidden or own):
                named.append((url, _stem(name), None))
        return named
    path, start = Path(source), None
    if path.is_dir() and not _is_bag(path):
        start = len(str(path)) + 1
        found = [one for one in _walk(path, out, links) if one[1] or _is_log(one[0])]
    elif path.exists():
        found = [(source, None)]
    else:
        found = list(_matches(source, out, links))
        if not found:
            raise SettingError(f"{source}: there is no such file, folder or match; check the name")
        found = [one for one in found if _is_bag(Path(one[0])) or not Path(one[0]).is_dir()]
    named = []
    for one, trouble in found:
        name = one.rpartition("/")[2] if start is None else one[start:]
        named.append((one, name if trouble else _stem(name), trouble))
    return named


def _walk(folder: Path, out: str, links: list[str]) -> Iterator[tuple[str, str | None]]:
    """Files and bags below a folder, and folders in which nobody may look with the reason why.

    Hidden ones, results and what lies in `out` are passed over. Links to folders are not entered,
    but added to `links`.

    Raises
    ------
    OSError
        If nobody may look into `folder` itself.
    """
    unreadable: list[OSError] = []
    for place, folders, names in os.walk(folder, onerror=unreadable.append):
        if BAG in names and place != str(folder):
            folders.clear()
            yield place, None
            continue
        inner = list[str]()
        for name in folders:
            path = f"{place}/{name}"
            if name.startswith(".") or name.endswith(".algid") or _is_same(path, out):
                continue
            if os.path.islink(path):  # noqa: PTH114
                links.append(path)
            else:
                inner.append(name)
        folders[:] = inner
        for name in sorted(names):
            if not name.startswith(".") and (name != TABLE or not _is_same(place, out)):
                yield f"{place}/{name}", None
    for error in unreadable:
        place = str(error.filename)
        if place == str(folder):
            raise error
        trouble = f"{redacted_path(place)}: cannot look there ({error.strerror}); check its rights"
        yield place, trouble


def _is_same(folder: str, other: str) -> bool:
    with suppress(OSError):  # there may be no other
        return Path(folder).samefile(other)
    return False


def _matches(pattern: str, out: str, links: list[str]) -> Iterator[tuple[str, str | None]]:
    """Files and bags that a pattern names; ``**`` goes through folders as `_walk` does."""
    parts = Path(pattern).parts
    first = parts.index("**") if "**" in parts else len(parts)
    # a pattern may be absolute
    for match in sorted(glob.glob(str(Path(*parts[:first])))):  # noqa: PTH207
        if first == len(parts):
            yield match, None
        elif Path(match).is_dir():
            for path, trouble in _walk(Path(match), out, links):
                if not trouble and _fits(Path(path).relative_to(match).parts, parts[first:]):
                    yield path, None


def _fits(parts: Sequence[str], pattern: Sequence[str]) -> bool:
    """Whether a path's parts fit a pattern's, of which ``**`` stands for any number of folders."""
    if not pattern:
        return not parts
    if pattern[0] == "**":
        return any(_fits(parts[n:], pattern[1:]) for n in range(len(parts) + 1))
    return bool(parts) and fnmatchcase(parts[0], pattern[0]) and _fits(parts[1:], pattern[1:])


def _is_bag(path: Path) -> bool:
    return path.is_dir() and (path / BAG).is_file()


def _is_log(path: str) -> bool:
    return path.lower().endswith(SUFFIXES) or _is_bag(Path(path))


def _stem(name: str) -> str:
    suffix = max((end for end in SUFFIXES if name.lower().endswith(end)), key=len, default="")
    return name[: len(name) - len(suffix)]


def _paired(found: Iterable[Found], alone: str) -> list[Job]:
    """A job for each name of logs that differ in their role alone.

    One whose name is unfit stands under another.
    """
    jobs: dict[str, Job] = {}
    for path, stem, trouble in found:
        match = _ROLE.fullmatch(stem)
        name, role = (match["base"], match["role"]) if match else (stem, alone)
        fault = None if trouble else name_fault(name)
        if fault is not None:
            trouble = f"{redacted_path(path)}: a log's name becomes a folder's: {fault}; rename it"
        if trouble:
            job = Job(safe_name(name), logs=(path,), trouble=trouble)
        else:
            logs, loaded = ((), (path,)) if role == "loaded" else ((path,), ())
            job = Job(name, logs, loaded, robot=name.rpartition("/")[0] or None)
        first = jobs.get(job.name)
        if first and (first.trouble or (first.logs and job.logs) or (first.loaded and job.loaded)):
            job = _of_one_name(first, job)
        elif first:
            job = replace(first, logs=first.logs + job.logs, loaded=first.loaded + job.loaded)
        jobs[job.name] = job
    return list(jobs.values())


def _of_one_name(first: Job, second: Job) -> Job:
    """What stands for two jobs of one name: it cannot be run."""
    logs = tuple(dict.fromkeys(first.logs + second.logs))
    loaded = tuple(dict.fromkeys(first.loaded + second.loaded))
    paths = ", ".join(map(redacted_path, (logs + loaded)[:MOST_NAMED]))
    trouble = (
        f"{first.name}: two jobs of one name ({paths}); rename a log, or name the jobs in a "
        "manifest"
    )
    return replace(first, logs=logs, loaded=loaded, trouble=trouble)
