"""Records of jobs, manifests and folders of logs that no batch should be given."""

from __future__ import annotations

import csv
import io
import json
import os
import random
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from pipelines.hostile.values import TEXTS, anything, as_toml, changed
from pipelines.mutations import damage

RECORD: dict[str, Any] = json.loads("""
{"job": {"name": "r1/a", "logs": ["a.csv"], "loaded": ["b.csv"], "profile": null, "robot": "r1",
  "time": "2026-01-31T12:00:00+01:00", "trouble": null,
  "labels": {"payload": 0.5, "site": "Ulm", "runs": 3, "good": true}},
 "status": "ok", "reason": "", "basis": "b", "settings": {"estimator": "weak", "poles": [1.0, 2.0]},
 "inputs": [{"path": "a.csv", "size": 1, "mtime_ns": 2, "ctime_ns": 3, "sha256": "c"},
  {"path": "b.csv", "size": 1, "mtime_ns": 2, "ctime_ns": 3, "sha256": null}],
 "version": "0.1", "seconds": 1.5, "start_ns": 1700000000000000000, "log_seconds": 10.0,
 "estimator": "weak",
 "estimates": {"k1": [1.0, 0.1, "OK"], "k5+k3+z1": [null, null, "WEAK_EXCITATION"]}}
""")
ROW: dict[str, Any] = json.loads("""
{"name": "r1/a", "logs": "logs/a.csv", "loaded": "b.csv;c.csv", "robot": "r1",
 "time": "2026-01-31T12:00:00Z", "payload": 0.5}
""")
NAMES = (
    *[
        "a",
        "b",
        "a-loaded",
        "a_unloaded",
        "x.json",
        "x.json~",
        "jobs",
        "d.algid",
        ".h",
        "result",
        "é",
        "a\\b",
        "%",
        "~",
        "-",
        "loaded",
    ],
    *(
        "a b",
        "ä" * 90,
        "-loaded",
        "bad\nname",
        "\x1b[31m",
        "caf\udce9",
        "\u202eltr",
        "x" * 200,
        "y" * 240,
    ),
)
"""Names of files and folders; those of `TEXTS` that the system takes come along."""
ENDS = (
    "",
    ".csv",
    *[".csv", ".mcap", ".parquet", ".csv.gz", ".CSV", ".toml", ".npz", ".algid", ".json"],
)


def record(draw: random.Random) -> bytes:
    """The bytes of a record, most of which is as it should be."""
    text = json.dumps(changed(RECORD, draw) if draw.random() < 0.8 else RECORD)
    content = text.encode(errors="surrogatepass")
    return damage(content, draw) if draw.random() < 0.2 else content


def manifest(draw: random.Random, folder: Path) -> Path:
    """Write a manifest into a folder."""
    rows = [
        changed(ROW, draw) if draw.random() < 0.7 else {**ROW, "name": f"r{n}"}
        for n in range(draw.choice((1, 2, 9)))
    ]
    rows = [row if isinstance(row, dict) else {"name": row} for row in rows]
    is_toml = draw.random() < 0.5
    text = as_toml({"job": rows}) if is_toml else _csv(rows, draw)
    content = text.encode(errors="surrogatepass")
    path = folder / f"m{'.toml' if is_toml else '.csv'}"
    path.write_bytes(damage(content, draw) if draw.random() < 0.2 else content)
    return path


def _csv(rows: list[dict[Any, Any]], draw: random.Random) -> str:
    stream = io.StringIO()
    header = [str(key) for key in dict.fromkeys(key for row in rows for key in row)]
    if draw.random() < 0.1:
        header.append(draw.choice(header or ["a"]))
    table = csv.writer(stream)
    table.writerow(header)
    for row in rows:
        with suppress(ValueError):  # digits beyond what Python writes
            table.writerow([str(row.get(key, "")) for key in header])
    return stream.getvalue()


def grow(draw: random.Random, folder: Path) -> None:
    """Make a tree of files, folders, links, pipes and bags with odd names below a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    places = [folder]
    for _ in range(draw.choice((1, 5, 20))):
        where = draw.choice(places)
        name = draw.choice((draw.choice(NAMES), draw.choice(TEXTS))) + draw.choice(ENDS)
        path = Path(f"{where}/{name}")
        lead = draw.choice((*places, "/dev/zero", "/", "/etc", ".", "..", name, "absent"))
        makers: list[Callable[[Path], object]] = [Path.mkdir, Path.mkdir, os.mkfifo, _bag]
        makers += [lambda p, lead=lead: p.symlink_to(lead)] * 2  # type: ignore[misc]
        makers += [lambda p: p.write_text("t,theta1\n0,1\n")] * 6
        with suppress(OSError, ValueError):  # the system does not take every name
            if os.path.lexists(path):  # a pipe would be waited for
                continue
            draw.choice(makers)(path)
            if path.is_dir() and not path.is_symlink() and path.is_relative_to(folder):
                places.append(path)


def _bag(path: Path) -> None:
    path.mkdir()
    (path / "metadata.yaml").touch()


def furnish_output(draw: random.Random, out: Path) -> None:
    """Put into an output what no batch has left there."""
    if draw.random() < 0.5:
        return
    (out / ".jobs").mkdir(parents=True)
    for _ in range(draw.choice((1, 3))):
        grow(draw, draw.choice((out, out / ".jobs")))
    for name in ("a", "b", "r1/a", "x"):
        if draw.random() < 0.5:
            path = out / f".jobs/{name}.json"
            with suppress(OSError):
                path.parent.mkdir(exist_ok=True)
                if not os.path.lexists(path):
                    path.write_bytes(
                        record(draw) if draw.random() < 0.7 else json.dumps(anything(draw)).encode()
                    )
