"""rosbag2 folders: which files belong to a bag, and in which order."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from algid.errors import LogError
from algid.files import read_start
from algid.limits import LIMITS
from algid.notices import Notice


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
        If there is none, a path leads out of the folder, or the bag is compressed by rosbag2
        itself.
    """
    metadata = folder / "metadata.yaml"
    if metadata.is_file():
        names = _listed(metadata)
    else:  # the files themselves, by the numbers that end their names
        files = [*folder.glob("*.mcap"), *folder.glob("*.db3")]
        numbers = [(re.search(r"_(\d+)$", path.stem), path.name) for path in files]
        names = [
            name
            for _, name in sorted(
                (int(number[1]) if number else 0, name) for number, name in numbers
            )
        ]
    paths = [folder / name for name in names]
    there = [path for path in paths if path.is_file()]
    if not there:
        raise LogError(f"{folder}: none of the bag's files is there; expected {names[:3]}")
    kinds = {path.suffix for path in there}
    if len(kinds) > 1:
        raise LogError(
            f"{folder}: the bag mixes files of {', '.join(sorted(kinds))}; read one file of it"
        )
    missing = [path.name for path in paths if path not in there]
    counts = {"missing": len(missing), "files": len(paths), "names": ", ".join(missing[:3])}
    notices = (Notice("MISSING_SPLIT", numbers=counts, lossy=True),) if missing else ()
    return Bag(tuple(there), kinds.pop().lstrip("."), notices)


def _listed(metadata: Path) -> list[str]:
    """The names of files that a bag's metadata.yaml lists."""
    text = read_start(metadata, LIMITS.bag_metadata_bytes).decode("utf-8", errors="replace")
    mode = re.search(r"^\s*compression_mode:[ \t]*[\"']?(\w+)", text, re.MULTILINE)
    if mode and mode[1].upper() != "NONE":
        raise LogError(
            f"{metadata.parent}: the bag was compressed by rosbag2 (compression_mode {mode[1]}), "
            "unreadable; write it anew with ros2 bag convert and storage compression (mcap, zstd "
            "chunks)"
        )
    # the one list that matters, without a YAML package: a block, one name a line, or [one, two]
    block = re.search(r"^\s*relative_file_paths:\s*\n((?:\s*-\s*\S.*\n?)+)", text, re.MULTILINE)
    flow = re.search(r"^\s*relative_file_paths:\s*\[([^\]]*)\]", text, re.MULTILINE)
    if block is None and flow is None:
        raise LogError(
            f"{metadata}: no relative_file_paths; expected the metadata of a rosbag2 folder"
        )
    lines = (
        block[1].splitlines()
        if block
        else [one for one in flow[1].split(",") if one.strip()]
        if flow
        else []
    )
    names = [line.strip().removeprefix("-").strip().strip("\"'") for line in lines]
    for name in names:
        if Path(name).name != name or name in ("", ".", ".."):
            raise LogError(
                f"{metadata}: {name[:80]!r} leads outside the bag's folder; expected a file in it"
            )
    return names
