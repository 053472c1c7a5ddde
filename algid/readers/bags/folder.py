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
    else:
        parts = [*folder.glob("*.mcap"), *folder.glob("*.db3")]
        names = sorted((path.name for path in parts), key=_numbered)
        if len({re.sub(r"_\d+$", "", Path(name).stem) for name in names}) > 1:
            raise LogError(
                f"{folder}: {', '.join(names[:3])}: not the numbered parts of one bag, and no "
                "metadata.yaml lists them; read each for itself"
            )
    there, missing = [], []
    for name in names:
        path = folder / name
        if path.is_file():
            there.append(path)
        else:
            missing.append(name)
    if not there:
        raise LogError(f"{folder}: none of the bag's files is there; expected {names[:3]}")
    kinds = {path.suffix for path in there}
    if len(kinds) > 1:
        raise LogError(
            f"{folder}: the bag mixes files of {', '.join(sorted(kinds))}; read one file of it"
        )
    notices = []
    if missing:
        counts = {"missing": len(missing), "files": len(names), "names": ", ".join(missing[:3])}
        notices.append(Notice("MISSING_SPLIT", numbers=counts, lossy=True))
    return Bag(tuple(there), kinds.pop().lstrip("."), tuple(notices))


def _numbered(name: str) -> tuple[int, str]:
    """The number that ends a file's name, 0 where none does, and the name."""
    match = re.search(r"_(\d+)$", Path(name).stem)
    if match is None:
        return 0, name
    return int(match[1]), name


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
    if block is not None:
        lines = block[1].splitlines()
    elif flow is not None:
        lines = list(filter(str.strip, flow[1].split(",")))
    else:
        raise LogError(
            f"{metadata}: no relative_file_paths; expected the metadata of a rosbag2 folder"
        )
    names = [line.strip().removeprefix("-").strip().strip("\"'") for line in lines]
    for name in names:
        if Path(name).name != name or name in ("", ".", ".."):
            raise LogError(
                f"{metadata}: {name[:80]!r} leads outside the bag's folder; expected a file in it"
            )
    return names
