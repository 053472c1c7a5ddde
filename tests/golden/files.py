"""Sound files of every format and state, each with what reading it must give to the bit."""

from __future__ import annotations

import gzip
import hashlib
import sqlite3
from collections.abc import Callable, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import zstandard
from mcap.writer import CompressionType, Writer
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin

from algid.base.ros2 import JOINT_STATE, JOINT_STATE_DEFINITION
from algid.log import Log, Origin
from algid.profile import Profile
from algid.readers import read_log
from algid.writers import FORMATS, mcap, write_log
from tests.readers.logs import EPOCH_NS, TRUTH
from tests.readers.mcaps import NO_INDEX, TOPIC, messages_of, write_mcap
from tests.readers.ways import (
    Flat,
    Message,
    States,
    arrow_table,
    bag1,
    bag2,
    sent,
    store,
    store_table,
    units,
    written,
)

ROWS = 300
DRAW = np.random.default_rng(5)
# whole multiples of 2**-20: every library writes and reads them alike
VALUES = DRAW.integers(-(1 << 22), 1 << 22, (6, ROWS)) / (1 << 20)
STAMPS = np.arange(ROWS) * 1_000_000 + DRAW.integers(0, 1000, ROWS)
NAMES = ("theta1", "theta2", "tau1", "tau2")
Made = Path | tuple[Path, dict[str, Any]]


def log(start_ns: int = EPOCH_NS, velocity: bool = True) -> Log:
    """The samples that all of these files hold."""
    omega = VALUES[4:] if velocity else None
    return Log(start_ns + STAMPS, VALUES[:2], VALUES[2:4], Origin("", "", {}), omega)


def _flat(way: str, columns: dict[str, Any]) -> Callable[[Path], Made]:
    return lambda folder: written(way, folder, Flat(columns))


@dataclass(frozen=True)
class Sound:
    """A kind of file, and what writes one into a folder; with settings where it needs some."""

    name: str
    make: Callable[[Path], Made]

    def read(self, folder: Path) -> dict[str, Any]:
        """What reading it gives.

        Rows and a hash of the arrays, format, columns, truth, and the codes of the notices.
        """
        made = self.make(folder)
        path, settings = made if isinstance(made, tuple) else (made, {})
        found = read_log(path, Profile.model_validate(settings))
        whole = hashlib.sha256()
        for values in (found.stamp_ns, found.theta, found.tau, found.omega, found.reference):
            whole.update(b"-" if values is None else np.ascontiguousarray(values).tobytes())
        return {
            "rows": len(found),
            "sha256": whole.hexdigest(),
            "format": found.origin.format,
            "mapping": dict(sorted(found.origin.mapping.items())),
            "truth": found.origin.truth is not None,
            "codes": sorted(notice.code for notice in found.notices),
            "lossy": sorted(notice.code for notice in found.notices if notice.lossy),
        }


def table(seconds: bool = True) -> dict[str, Any]:
    """The log as named columns."""
    time = STAMPS * 1e-9 if seconds else STAMPS + EPOCH_NS
    return {"t" if seconds else "stamp_ns": time, **dict(zip(NAMES, VALUES, strict=False))}


# the formats that algid writes


def _written(kind: str, start_ns: int, whole: bool, folder: Path) -> Path:
    path = folder / f"log.{kind}"
    write_log(path, log(start_ns, whole), truth=TRUTH if whole else None)
    return path


# tables of text


def _text(*lines: str, **settings: Any) -> Callable[[Path], Made]:
    """A table of some lines, in bytes of UTF-8 with line feeds."""
    write = partial(_of_bytes, "log.csv", "\n".join([*lines, ""]).encode())
    return lambda folder: (write(folder), settings)


def rows(separator: str = ",", form: str = "{}", first: Iterable[Any] | None = None) -> list[str]:
    """The samples as lines of text; `first` are other cells for the time."""
    time: Iterable[Any] = STAMPS * 1e-9 if first is None else first
    cells = zip(time, *VALUES[:4].tolist(), strict=True)
    return [separator.join(form.format(cell) for cell in row) for row in cells]


HEAD = "t,theta1,theta2,tau1,tau2"
DATES = [f"2024-05-06T07:08:{1 + row // 1000:02d}.{row % 1000:03d}" for row in range(ROWS)]


def _of_bytes(name: str, content: bytes, folder: Path) -> Path:
    (folder / name).write_bytes(content)
    return folder / name


def texts() -> dict[str, Callable[[Path], Made]]:
    """Tables of text in their dialects."""
    plain = "\n".join([HEAD, *rows()]).encode() + b"\n"
    comma = [line.replace(".", ",") for line in rows(";")]
    quoted = [f'"{line.replace(",", chr(34) + "," + chr(34))}"' for line in rows()]
    gaps = rows()
    gaps[7] = gaps[7].rpartition(",")[0] + ","
    gaps[9] = ",,,,"
    milliseconds = rows(first=(STAMPS * 1e-6).tolist())
    return {
        "plain": partial(_of_bytes, "log.csv", plain),
        "gzip": partial(_of_bytes, "log.csv.gz", gzip.compress(plain)),
        "gzip, two members": partial(
            _of_bytes, "log.csv.gz", gzip.compress(plain[:5000]) + gzip.compress(plain[5000:])
        ),
        "zstd": partial(_of_bytes, "log.csv.zst", zstandard.compress(plain)),
        "zstd, two frames": partial(
            _of_bytes,
            "log.csv.zst",
            zstandard.compress(plain[:5000]) + zstandard.compress(plain[5000:]),
        ),
        "byte order mark, CRLF": partial(
            _of_bytes, "log.csv", b"\xef\xbb\xbf" + plain.replace(b"\n", b"\r\n")
        ),
        "semicolons": _text(HEAD.replace(",", ";"), *rows(";")),
        "decimal commas": _text(HEAD.replace(",", ";"), *comma),
        "decimal commas, padded": _text(
            HEAD.replace(",", " ; "), *(line.replace(";", " ; ") for line in comma)
        ),
        "tabs": _text(HEAD.replace(",", "\t"), *rows("\t")),
        "bars": _text(HEAD.replace(",", "|"), *rows("|")),
        "runs of blanks": _text(HEAD.replace(",", "  "), *rows(" \t ")),
        "padded cells": _text(HEAD, *rows(" , ")),
        "quoted": _text(HEAD, *quoted),
        "quoted texts beside": _text(
            HEAD + ",note", *(f'{line},"held, then ""let go"""' for line in rows())
        ),
        "comments": _text("# arm 7", "# two joints", HEAD, "# begin", *rows()),
        "header in a comment": _text("# arm 7", "# " + HEAD, *rows()),
        "title above": _text("Recording of arm 7", "", HEAD, *rows()),
        "row of units": _text(HEAD, "s,deg,deg,N m,N m", *rows()),
        "units in brackets": _text(
            "time [ms],q1 [deg],q2 [deg],tau1 [mNm],tau2 [mNm]", *milliseconds
        ),
        "named by a user": _text(*rows(), columns=HEAD.split(",")),
        "blank lines inside and behind": _text(
            HEAD, *rows()[:9], "", *rows()[9:200], "", "", *rows()[200:], "", ""
        ),
        "empty cells": _text(HEAD, *gaps),
        "more columns": _text("i," + HEAD + ",mode", *(f"3,{line},run" for line in rows())),
        "dates": _text(HEAD, *rows(first=DATES)),
        "dates with a zone": _text(HEAD, *rows(first=[f"{date}+02:00" for date in DATES])),
        "milliseconds": _text(HEAD, *milliseconds),
        "nanoseconds since 1970": _text(
            HEAD.replace("t,", "time,", 1), *rows(first=(EPOCH_NS + STAMPS).tolist())
        ),
        "rows counted": _text(
            "theta1,theta2,tau1,tau2", *(line.partition(",")[2] for line in rows()), rate=500
        ),
        "exponents": _text(HEAD, *rows(form="{:.17e}")),
        "without its last line end": partial(_of_bytes, "log.csv", plain[:-1]),
        "joints 3 and 5 of six": _text(
            "t," + ",".join(f"q{n},tau{n}" for n in range(1, 7)),
            *(
                ",".join([str(1e-3 * row), *map(str, np.repeat(VALUES[:, row], 2).tolist())])
                for row in range(ROWS)
            ),
            joints=["3", "5"],
        ),
    }


# clocks


def _clock(stamps: Sequence[int], **settings: Any) -> Callable[[Path], Made]:
    """A table with the given stamps, in ns, for its rows."""
    return _text(HEAD.replace("t,", "stamp_ns,", 1), *rows(first=stamps), **settings)


def clocks() -> dict[str, Callable[[Path], Made]]:
    """Stamps out of order, repeated, set back, with holes."""
    late = STAMPS.copy()
    late[100:104] = late[[103, 100, 102, 101]]
    restarted = np.concatenate([STAMPS[:150], STAMPS[:150]])
    again = STAMPS.copy()
    again[50] = again[49]
    hole = STAMPS + np.where(np.arange(ROWS) > 200, 10**10, 0)
    swapped = STAMPS.reshape(-1, 10)[:, [1, 0, 2, 3, 4, 6, 5, 7, 8, 9]].ravel()
    return {
        "late samples": _clock(late.tolist()),
        "neighbours swapped all along": _clock(swapped.tolist()),
        "a stamp twice": _clock(again.tolist()),
        "starts again": _clock(restarted.tolist()),
        "second run alone": _clock(restarted.tolist(), segment=2),
        "hole": _clock(hole.tolist()),
        "cut": _clock(STAMPS.tolist(), start=0.05, end=0.2),
    }


# tables of libraries


def _arrow(columns: Any, suffix: str, folder: Path, **options: Any) -> Path:
    arrow = columns if isinstance(columns, pa.Table) else pa.table(columns)
    return store_table(folder / f"log.{suffix}", arrow, **options)


def arrow_tables() -> dict[str, Any]:
    """Columns as Parquet and Feather hold them."""
    plain = table()
    lists = {"t": plain["t"], "position": VALUES[:2].T.tolist(), "effort": VALUES[2:4].T.tolist()}
    fixed = pa.list_(pa.float32(), 2)
    gaps = {
        name: [*values[:7].tolist(), None, *values[8:].tolist()] for name, values in plain.items()
    }
    stamps = pa.array(EPOCH_NS + STAMPS, pa.timestamp("ns"))
    return {
        "plain": plain,
        "nanoseconds": table(seconds=False),
        "float32": plain | {name: plain[name].astype(np.float32) for name in NAMES},
        "integers": plain | {name: (plain[name] * 1000).astype(np.int16) for name in NAMES},
        "unsigned": plain
        | {"theta1": np.arange(ROWS, dtype=np.uint64), "theta2": np.arange(ROWS, dtype=np.uint8)},
        "lists": lists,
        "lists of fixed size": {"t": plain["t"].astype(np.float32)}
        | {
            name: pa.array(np.float32(lists[name]).tolist(), fixed)
            for name in ("position", "effort")
        },
        "timestamps": {"timestamp": stamps, **{name: plain[name] for name in NAMES}},
        "timestamps in us": {
            "timestamp": stamps.cast(pa.timestamp("us"), safe=False),
            **{name: plain[name] for name in NAMES},
        },
        "durations": {
            "t": pa.array(STAMPS, pa.duration("ns")),
            **{name: plain[name] for name in NAMES},
        },
        "texts beside": plain | {"note": ["held"] * ROWS, "ok": np.ones(ROWS, bool)},
        "decimals": plain
        | {"tau1": pa.array(plain["tau1"]).cast(pa.decimal128(38, 20)), "tau2": plain["tau2"]},
        "a dictionary": plain | {"tau2": pa.array(plain["tau2"]).dictionary_encode()},
        "missing values": gaps,
        "units": arrow_table(units(plain, "s,deg,deg,mN m,mN m", "unit")),
    }


GROUPS = {"mat packed": "run.log.", "hdf5": "run.", "hdf5 packed": "run."}


def _archive(form: str, columns: dict[str, Any]) -> Callable[[Path], Made]:
    kind, _, packed = form.partition(" ")
    arrays = {GROUPS.get(form, "") + name: values for name, values in columns.items()}
    return lambda folder: store(folder / f"log.{kind}", arrays, bool(packed))


def arrays() -> dict[str, Callable[[Path], Made]]:
    """Arrays as NumPy, MATLAB and HDF5 files hold them."""
    upright = {"t": STAMPS * 1e-9, "q": VALUES[:2].T, "tau": VALUES[2:4].T, "qd": VALUES[4:].T}
    flat = {name: values.T for name, values in upright.items()}
    other = {name: values.astype(">f8") for name, values in upright.items()}
    small = {name: values.astype(np.float32) for name, values in upright.items()}
    found = {}
    for form in ("npz", "npz packed", "mat", "mat packed", "hdf5", "hdf5 packed"):
        found[f"{form}, columns"] = _archive(form, table())
        found[f"{form}, upright"] = _archive(form, upright)
        found[f"{form}, flat"] = _archive(form, flat)
        found[f"{form}, big endian"] = _archive(form, other)
        found[f"{form}, float32"] = _archive(form, small)
    return found


def json_lines() -> dict[str, Callable[[Path], Made]]:
    """A JSON object a line."""
    time = STAMPS * 1e-9
    motors = [
        [dict(zip(("q", "tau_est", "dq"), own[one::2], strict=True)) for one in (0, 1)]
        for own in VALUES.T.tolist()
    ]
    lists = {"t": time, "q": VALUES[:2].T.tolist(), "tau": VALUES[2:4].T.tolist()}
    whole = dict(
        zip(
            ("t", *NAMES),
            (range(ROWS), *([one] * ROWS for one in (1, -2, 3)), range(ROWS)),
            strict=True,
        )
    )

    def without_torques(folder: Path) -> Path:
        path: Path = written("jsonl", folder, Flat(lists))
        lines = path.read_text().splitlines(keepends=True)
        lines[7] = lines[7].partition(', "tau"')[0] + "}\n"
        path.write_text("".join(lines))
        return path

    return {
        "nested": _flat("jsonl", {"t": time, "mode": ["run"] * ROWS, "motor_state": motors}),
        "lists": _flat("jsonl", lists),
        "a line without torques": without_torques,
        "whole numbers": _flat("jsonl", whole),
        "flat": _flat("jsonl", table()),
    }


# messages


def _mcap(
    messages: Callable[[], list[tuple[str, int, bytes]]],
    settings: dict[str, Any] | None = None,
    **options: Any,
) -> Callable[[Path], Made]:
    return lambda folder: (write_mcap(folder / "log.mcap", messages(), **options), settings or {})


def with_imu() -> list[tuple[str, int, bytes]]:
    """The joints' messages, in stretches five of another topic between each two of them."""
    messages = []
    for row, one in enumerate(messages_of(log())):
        messages.append(one)
        if row // 20 % 2:
            messages += [("/imu", one[1] + place, bytes(64)) for place in range(5)]
    return messages


IMU = {"/imu": ("sensor_msgs/msg/Imu", "ros2msg", b"float64[7] values")}


def _sent(way: str, messages: list[Message], **settings: Any) -> Callable[[Path], Made]:
    return lambda folder: (written(way, folder, States(messages)), settings)


STILL = log(velocity=False)


def six_joints() -> list[Message]:
    """States of six joints, of which the names change places."""
    found = []
    for row, stamp in enumerate(log().stamp_ns.tolist()):
        order = [0, 1, 2, 3, 4, 5] if row % 7 else [5, 3, 1, 0, 2, 4]
        names = [f"arm_joint_{place + 1}" for place in order]
        values = VALUES[order, row].tolist()
        found.append(Message(values, values, stamp, stamp, names, values))
    return found


def two_topics() -> list[Message]:
    """Angles on one topic, and torques on another at other times."""
    found = []
    for one in sent(STILL):
        later = one.stamp + 300_000
        found.append(replace(one, effort=(), topic="/q"))
        found.append(replace(one, position=(), topic="/tau", stamp=later, log_stamp=later))
    return found


TWO = {
    f"{name}{joint}": {"topic": topic, "source": f"{field}[{joint - 1}]"}
    for name, topic, field in (("theta", "/q", "position"), ("tau", "/tau", "effort"))
    for joint in (1, 2)
}


WHOLE = States(sent(log()))


def _loose(folder: Path) -> Path:
    (path,) = bag2(folder, WHOLE).glob("*.db3")
    return path


def _unlisted(folder: Path) -> Path:
    bag = bag2(folder, WHOLE)
    (bag / "metadata.yaml").unlink()
    return bag


def _without_definitions(folder: Path) -> Path:
    """A file of an older rosbag2, which has no table of definitions."""
    path = _loose(folder)
    with closing(sqlite3.connect(path)) as base:
        base.execute("DROP TABLE message_definitions")
        base.commit()
    return path


def _write_ahead(folder: Path) -> Path:
    """A file of which the last rows stand in its write-ahead log, as a recorder leaves it."""
    path = _loose(folder)
    with closing(sqlite3.connect(path)) as base:
        last = base.execute("SELECT topic_id, timestamp, data FROM messages WHERE id > 200")
        rest = last.fetchall()
        base.execute("DELETE FROM messages WHERE id > 200")
        base.commit()
        base.execute("PRAGMA journal_mode = WAL")
        base.execute("PRAGMA wal_autocheckpoint = 0")
        base.executemany("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", rest)
        base.commit()
        kept = path.with_name("kept.db3")
        for suffix in ("", "-wal"):
            content = path.with_name(path.name + suffix).read_bytes()
            kept.with_name(kept.name + suffix).write_bytes(content)
    return kept


def _splits(folder: Path) -> Path:
    """A folder of two MCAP files that its metadata list."""
    bag = folder / "bag"
    bag.mkdir()
    for place in (0, 1):
        write_mcap(bag / f"bag_{place}.mcap", messages_of(log())[150 * place : 150 * (place + 1)])
    names = "".join(f"    - bag_{place}.mcap\n" for place in (0, 1))
    (bag / "metadata.yaml").write_text(
        f"rosbag2_bagfile_information:\n  version: 5\n  relative_file_paths:\n{names}"
    )
    return bag


def _redefined_alike(folder: Path) -> Path:
    """Two channels of one topic, as two publishers make them."""
    with (folder / "log.mcap").open("wb") as stream:
        writer = Writer(stream, chunk_size=2048)
        writer.start()
        schema = writer.register_schema(JOINT_STATE, "ros2msg", JOINT_STATE_DEFINITION.encode())
        own = [writer.register_channel(TOPIC, "cdr", schema, {"by": str(n)}) for n in (0, 1)]
        for row, (_, stamp, data) in enumerate(messages_of(log())):
            writer.add_message(own[row % 2], stamp, data, stamp)
        writer.finish()  # type: ignore[no-untyped-call]
    return folder / "log.mcap"


def _referenced(folder: Path) -> Path:
    path = folder / "log.mcap"
    mcap.write(path, [replace(log(), reference=VALUES[4:])], truth=TRUTH)
    return path


def mcaps() -> dict[str, Callable[[Path], Made]]:
    """Messages in MCAP files."""

    def states() -> list[tuple[str, int, bytes]]:
        return messages_of(log())

    found: dict[str, Callable[[Path], Made]] = {}
    for packing in CompressionType:
        found[f"packed by {packing.name}"] = _mcap(states, compression=packing)
        found[f"packed by {packing.name}, no index"] = _mcap(
            states, compression=packing, **NO_INDEX
        )
    more: dict[str, Callable[[Path], Made]] = {
        "without chunks": _mcap(states, use_chunking=False),
        "without checksums": _mcap(states, enable_crcs=False),
        "a message a chunk": _mcap(states, chunk_size=1),
        "one chunk": _mcap(states, chunk_size=1 << 22),
        "another topic between": _mcap(with_imu, schemas=IMU),
        "another topic between, no index": _mcap(with_imu, schemas=IMU, **NO_INDEX),
        "big endian": _mcap(lambda: messages_of(log(), order=">")),
        "log time": _mcap(states, settings={"clock": "log"}),
        "headers that stand still": _sent(
            "cdr", [replace(one, stamp=0, name=("joint1", "joint2")) for one in sent(STILL)]
        ),
        "two of six joints": _sent("cdr", six_joints(), joints=["arm_joint_2", "arm_joint_5"]),
        "two topics": _sent("cdr", two_topics(), **TWO),
        "JSON": _sent("json", sent(STILL)),
        "Protobuf": _sent("pb", sent(STILL)),
        "channels of two publishers": _redefined_alike,
        "references": _referenced,
    }
    return found | more


def bags() -> dict[str, Callable[[Path], Made]]:
    """Messages in bags of both generations."""
    return {
        "ROS 1": lambda folder: bag1(folder, WHOLE),
        "ROS 1, lz4": lambda folder: bag1(folder, WHOLE, Writer1.CompressionFormat.LZ4),
        "ROS 1, bz2": lambda folder: bag1(folder, WHOLE, Writer1.CompressionFormat.BZ2),
        "folder of SQLite": lambda folder: bag2(folder, WHOLE),
        "folder of SQLite, version 8": lambda folder: bag2(folder, WHOLE, version=8),
        "folder of MCAP": lambda folder: bag2(folder, WHOLE, StoragePlugin.MCAP),
        "folder of two MCAP files": _splits,
        "SQLite file": _loose,
        "SQLite file without definitions": _without_definitions,
        "SQLite file with a write-ahead log": _write_ahead,
        "folder without metadata": _unlisted,
    }


def sounds() -> list[Sound]:
    """Every kind of sound file."""
    found: dict[str, Callable[[Path], Made]] = {}
    for kind in FORMATS:
        found[f"{kind} of algid"] = partial(_written, kind, 0, False)
        found[f"{kind} of algid, truth"] = partial(_written, kind, EPOCH_NS, True)
    found |= {f"CSV: {name}": make for name, make in texts().items()}
    found |= {f"clock: {name}": make for name, make in clocks().items()}
    for name, columns in arrow_tables().items():
        found[f"Parquet: {name}"] = partial(_arrow, columns, "parquet")
        found[f"Feather: {name}"] = partial(_arrow, columns, "feather")
    options: dict[str, Any] = {"write_page_checksum": True, "row_group_size": 77}
    found["Parquet: pages with checksums"] = partial(_arrow, table(), "parquet", **options)
    found["Parquet: zstd"] = partial(
        _arrow, table(), "parquet", compression="zstd", use_dictionary=False
    )
    found["Feather: zstd in chunks"] = partial(
        _arrow, table(), "feather", compression="zstd", chunksize=50
    )
    found["Feather: bare"] = partial(_arrow, table(), "feather", compression="uncompressed")
    found |= arrays()
    found |= {f"JSON lines: {name}": make for name, make in json_lines().items()}
    found |= {f"MCAP: {name}": make for name, make in mcaps().items()}
    found |= {f"bag: {name}": make for name, make in bags().items()}
    return [Sound(name, make) for name, make in found.items()]
