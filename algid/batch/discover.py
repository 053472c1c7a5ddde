"""From sources to jobs: files, folders, globs and manifests; X-unloaded.* and X-loaded.* make one job X."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from algid.batch.jobs import Job, checked_name
from algid.batch.manifest import is_manifest, read_manifest
from algid.errors import SettingError
from algid.stores import is_url, list_urls

SUFFIXES = (".mcap", ".parquet", ".csv", ".csv.gz", ".csv.zst")
_ROLE = re.compile(r"(?P<base>.+)[-_](?P<role>unloaded|loaded)")


@dataclass(frozen=True)
class _Found:
    """A log: its path or URL, and its name below the source without suffix."""

    path: str
    name: str


def jobs_of(sources: Sequence[str], out: str, alone: str = "logs") -> list[Job]:
    """The jobs that sources hold, sorted by name.

    Parameters
    ----------
    sources : paths of logs, folders, globs, manifests, or URLs of an object store
    out : where results go; logs are not looked for within it
    alone : 'logs' or 'loaded'
        What a log is whose name does not tell.

    Raises
    ------
    SettingError
        If a source holds no log, or two jobs would have one name.
    """
    jobs: dict[str, Job] = {}
    for source in sources:
        for job in _of_source(source, out, alone):
            if job.name in jobs and jobs[job.name] != job:
                raise _twice(job.name, jobs[job.name], job)
            jobs[job.name] = job
    return [jobs[name] for name in sorted(jobs)]


def _of_source(source: str, out: str, alone: str) -> list[Job]:
    if not is_url(source) and is_manifest(Path(source)):
        return read_manifest(Path(source))
    return _paired(_logs(source, out), alone)


def _logs(source: str, out: str) -> list[_Found]:
    if is_url(source):
        return [_Found(url, _stem(name)) for url, name in list_urls(source) if _is_log(name)]
    path = Path(source)
    if path.is_dir() and not _is_bag(path):
        return [_Found(str(log), _stem(log.relative_to(path).as_posix())) for log in _walk(path, Path(out).resolve())]
    paths = [source] if path.exists() else sorted(glob.glob(source, recursive=True))  # noqa: PTH207  # a pattern may be absolute
    if not paths:
        raise SettingError(f"{source}: there is no such file, folder or match; check the name")
    return [_Found(match, _stem(Path(match).name)) for match in paths if Path(match).is_file() or _is_bag(Path(match))]


def _walk(folder: Path, out: Path) -> Iterator[Path]:
    """Logs below a folder in the order of their names; results and hidden entries are passed over."""
    for entry in sorted(folder.iterdir()):
        if entry.name.startswith("."):
            continue
        if _is_bag(entry):
            yield entry
        elif entry.is_dir():
            if entry.suffix != ".algid" and entry.resolve() != out:
                yield from _walk(entry, out)
        elif _is_log(entry.name) and not (entry.name == "jobs.parquet" and folder.resolve() == out):
            yield entry


def _is_bag(path: Path) -> bool:
    return path.is_dir() and (path / "metadata.yaml").is_file()


def _is_log(name: str) -> bool:
    return name.lower().endswith(SUFFIXES)


def _stem(name: str) -> str:
    suffix = max((end for end in SUFFIXES if name.lower().endswith(end)), key=len, default="")
    return name[: len(name) - len(suffix)]


def _paired(found: Sequence[_Found], alone: str) -> list[Job]:
    jobs: dict[str, Job] = {}
    for log in found:
        match = _ROLE.fullmatch(log.name)
        name = checked_name(match["base"] if match else log.name, log.path)
        loaded = (match["role"] if match else alone) == "loaded"
        before = jobs.get(name, Job(name, robot=os.path.dirname(name) or None))  # noqa: PTH120  # a name, not a path
        now = replace(before, loaded=(log.path,)) if loaded else replace(before, logs=(log.path,))
        if before.loaded if loaded else before.logs:
            raise _twice(name, before, now)
        jobs[name] = now
    return list(jobs.values())


def _twice(name: str, first: Job, second: Job) -> SettingError:
    paths = ", ".join([*first.logs, *first.loaded, *second.logs, *second.loaded])
    return SettingError(f"{name}: two jobs of one name ({paths}); rename a log, or name the jobs in a manifest")
