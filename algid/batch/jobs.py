"""What a batch is made of: a job is the logs of one arm on one occasion.

Manifests: a CSV or TOML file with a row, or a table ``[[job]]``, for each job.

``name`` and ``logs`` are needed where there is no ``loaded``; ``profile``, ``robot`` and ``time`` are optional,
and whatever else stands there is a label. Several logs are a TOML list, or separated by semicolons in CSV. Paths
are relative to the manifest.

From sources to jobs: files, folders, globs and manifests; X-unloaded.* and X-loaded.* make one job X.
"""

from __future__ import annotations

import csv
import glob
import io
import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path

from algid.errors import SettingError
from algid.files import parsed_toml, read_start, read_text
from algid.limits import LIMITS
from algid.stores import is_url, list_urls

Label = str | float | int | bool


@dataclass(frozen=True)
class Job:
    """One identification of a batch.

    Parameters
    ----------
    name : str
        Unique in the batch; the result folder is ``OUT/NAME.algid``, so that it may hold slashes.
    logs, loaded : paths or URLs of the logs without and with payload
    profile : path of a profile, or None for the batch's
    robot : str or None
    time : ISO 8601 or None, when the logs were taken, where their stamps do not tell
    labels : anything else that is known, such as ``payload`` in kg
    """

    name: str
    logs: tuple[str, ...] = ()
    loaded: tuple[str, ...] = ()
    profile: str | None = None
    robot: str | None = None
    time: str | None = None
    labels: Mapping[str, Label] = field(default_factory=dict)


def checked_name(name: str, place: str) -> str:
    """`name`, once it is certain that a file of that name lies within OUT.

    Raises
    ------
    SettingError
        If a part of it is empty, starts with a dot, or holds what no file name should.
    """
    for part in name.split("/"):
        if not part or part.startswith(".") or not part.isprintable() or "\\" in part or len(part.encode()) > 200:
            raise SettingError(
                f"{place}: a job's name becomes a folder's: expected parts of printable characters, none starting "
                f"with a dot, found {name!r:.60}"
            )
    return name


def label_of(value: object) -> Label:
    """A manifest's value: a number where it reads like a finite one, text otherwise."""
    if isinstance(value, bool | int | float):
        return value
    text = str(value)
    try:
        number = float(text)
    except ValueError:
        return text
    return number if math.isfinite(number) else text


_OWN = ("name", "logs", "loaded", "profile", "robot", "time")


def is_manifest(path: Path) -> bool:
    """Whether a source is a manifest: TOML, or CSV with columns name and logs or loaded."""
    if path.suffix.lower() == ".toml":
        return True
    if path.suffix.lower() != ".csv" or not path.is_file():
        return False
    head = read_start(path, LIMITS.line_bytes).decode("utf-8-sig", errors="replace")  # logs too come by here
    columns = next(csv.reader(head.splitlines()[:1]), [])
    return "name" in columns and ("logs" in columns or "loaded" in columns)


def read_manifest(path: Path) -> list[Job]:
    """The jobs of a manifest, in its order.

    Raises
    ------
    SettingError
        If it cannot be read or a row is wrong.
    """
    try:
        if path.suffix.lower() == ".toml":
            kind, content = "job", parsed_toml(read_text(path))
            rows = content.get("job")
            if set(content) != {"job"} or not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
                raise SettingError(f"{path}: expected tables [[job]] alone, found {', '.join(content) or 'nothing'}")
        else:
            kind, cells = "row", list(csv.DictReader(io.StringIO(read_text(path, "utf-8-sig"))))
            if any(None in row for row in cells):
                raise SettingError(f"{path}: a row has more cells than the header; quote commas within a cell")
            rows = [{name: cell for name, cell in row.items() if cell} for row in cells]
    except (OSError, ValueError, csv.Error, RecursionError) as error:
        raise SettingError(f"{path}: the manifest cannot be read ({error}); mend it") from error
    return [_job(row, f"{path}: {kind} {number}", path.parent) for number, row in enumerate(rows, 1)]


def _job(row: Mapping[str, object], place: str, folder: Path) -> Job:
    logs, loaded = _paths(row, "logs", place, folder), _paths(row, "loaded", place, folder)
    if "name" not in row or not (logs or loaded):
        raise SettingError(f"{place}: expected a name and logs, found {', '.join(row) or 'nothing'}")
    profile, time = _paths(row, "profile", place, folder), row.get("time")
    try:
        time = None if time is None else datetime.fromisoformat(str(time)).isoformat()
    except ValueError as error:
        raise SettingError(f"{place}: time: expected ISO 8601 like 2026-01-31T12:00:00Z, found {time!r}") from error
    return Job(
        name=checked_name(str(row["name"]), place),
        logs=logs,
        loaded=loaded,
        profile=profile[0] if profile else None,
        robot=None if row.get("robot") is None else str(row["robot"]),
        time=time,
        labels={name: label_of(value) for name, value in row.items() if name not in _OWN},
    )


def _paths(row: Mapping[str, object], name: str, place: str, folder: Path) -> tuple[str, ...]:
    found = row.get(name)
    if found is None:
        return ()
    parts = found.split(";") if isinstance(found, str) else found
    if not isinstance(parts, list) or not all(
        isinstance(part, str) and part.strip() and "\0" not in part for part in parts
    ):
        raise SettingError(f"{place}: {name}: expected paths, found {found!r:.60}")
    return tuple(part.strip() if "://" in part else str(folder / part.strip()) for part in parts)


SUFFIXES = (".mcap", ".parquet", ".csv", ".csv.gz", ".csv.zst")
_ROLE = re.compile(r"(?P<base>.+)[-_](?P<role>unloaded|loaded)")


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
        try:
            manifest = not is_url(source) and is_manifest(Path(source))
            found = read_manifest(Path(source)) if manifest else _paired(_logs(source, out), alone)
        except OSError as error:
            raise SettingError(f"{source}: cannot look there ({error}); check its name and rights") from error
        for job in found:
            if job.name in jobs and jobs[job.name] != job:
                raise SettingError(_same_name(job.name, jobs[job.name], job))
            jobs[job.name] = job
    return [jobs[name] for name in sorted(jobs)]


def _logs(source: str, out: str) -> list[tuple[str, str]]:
    """Paths or URLs of a source's logs, each with its name below the source without suffix."""
    if is_url(source):
        return [(url, _stem(name)) for url, name in list_urls(source) if _is_log(name)]
    path = Path(source)
    if path.is_dir() and not _is_bag(path):
        return [(str(log), _stem(log.relative_to(path).as_posix())) for log in _walk(path, Path(out).resolve())]
    paths = [source] if path.exists() else sorted(glob.glob(source, recursive=True))  # noqa: PTH207  # a pattern may be absolute
    if not paths:
        raise SettingError(f"{source}: there is no such file, folder or match; check the name")
    return [(match, _stem(Path(match).name)) for match in paths if Path(match).is_file() or _is_bag(Path(match))]


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


def _paired(logs: Iterable[tuple[str, str]], alone: str) -> list[Job]:
    """A job for each name of logs that differ in their role alone."""
    jobs: dict[str, Job] = {}
    for path, stem in logs:
        match = _ROLE.fullmatch(stem)
        name = checked_name(match["base"] if match else stem, path)
        loaded = (match["role"] if match else alone) == "loaded"
        before = jobs.get(name, Job(name, robot=os.path.dirname(name) or None))  # noqa: PTH120  # a name, not a path
        now = replace(before, loaded=(path,)) if loaded else replace(before, logs=(path,))
        if before.loaded if loaded else before.logs:
            raise SettingError(_same_name(name, before, now))
        jobs[name] = now
    return list(jobs.values())


def _same_name(name: str, first: Job, second: Job) -> str:
    paths = ", ".join([*first.logs, *first.loaded, *second.logs, *second.loaded])
    return f"{name}: two jobs of one name ({paths}); rename a log, or name the jobs in a manifest"
