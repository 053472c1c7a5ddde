"""rosbag2 folders: which files belong to the bag, in which order, and whether they can be read."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from algid.errors import LogError
from algid.log import Notice
from algid.words import counted

_LARGEST_METADATA = 1 << 24


@dataclass(frozen=True)
class Bag:
    """The files of a bag in their order, their kind ("mcap" or "db3"), and what is missing."""

    paths: tuple[Path, ...]
    kind: str
    notices: tuple[Notice, ...]


def bag_files(folder: Path) -> Bag:
    """The files of a rosbag2 folder.

    Raises
    ------
    LogError
        If there is none, a path leads out of the folder, or the bag is compressed by rosbag2 itself.
    """
    names = _names(folder)
    paths = [folder / name for name in names]
    there = [path for path in paths if path.is_file()]
    if not there:
        raise LogError(f"{folder}: none of the bag's files is there; expected {names[:3]}")
    kinds = {path.suffix for path in there}
    if len(kinds) > 1:
        raise LogError(f"{folder}: the bag mixes files of {', '.join(sorted(kinds))}; read one file of it")
    missing = [path.name for path in paths if path not in there]
    text = f"{len(missing)} of {counted(len(paths), 'file')} of the bag missing: {', '.join(missing[:3])}"
    notices = (Notice("MISSING_SPLIT", text, lossy=True),) if missing else ()
    return Bag(tuple(there), kinds.pop().lstrip("."), notices)


def _names(folder: Path) -> list[str]:
    """Names in metadata.yaml, else the files themselves by the numbers that end their names."""
    metadata = folder / "metadata.yaml"
    if not metadata.is_file():
        found = [*folder.glob("*.mcap"), *folder.glob("*.db3")]
        return [path.name for path in sorted(found, key=lambda path: (_number(path.stem), path.name))]
    with metadata.open("rb") as stream:
        text = stream.read(_LARGEST_METADATA).decode("utf-8", errors="replace")
    _refuse_compressed(folder, text)
    # the one list that matters, without a YAML package: a block, one name a line, or [one, two]
    block = re.search(r"^\s*relative_file_paths:\s*\n((?:\s*-\s*\S.*\n?)+)", text, re.MULTILINE)
    flow = re.search(r"^\s*relative_file_paths:\s*\[([^\]]*)\]", text, re.MULTILINE)
    if block is None and flow is None:
        raise LogError(f"{metadata}: no relative_file_paths; expected the metadata of a rosbag2 folder")
    lines = block[1].splitlines() if block else [one for one in flow[1].split(",") if one.strip()] if flow else []
    names = [line.strip().removeprefix("-").strip().strip("\"'") for line in lines]
    for name in names:
        if Path(name).name != name or name in ("", ".", ".."):
            raise LogError(f"{metadata}: {name[:80]!r} leads outside the bag's folder; expected a file in it")
    return names


def _number(stem: str) -> int:
    found = re.search(r"_(\d+)$", stem)
    return int(found[1]) if found else 0


def _refuse_compressed(folder: Path, text: str) -> None:
    mode = re.search(r"^\s*compression_mode:[ \t]*[\"']?(\w+)", text, re.MULTILINE)
    if mode and mode[1].upper() not in ("NONE",):
        raise LogError(
            f"{folder}: the bag was compressed by rosbag2 (compression_mode {mode[1]}), unreadable; "
            "write it anew with ros2 bag convert and storage compression (mcap, zstd chunks)"
        )
