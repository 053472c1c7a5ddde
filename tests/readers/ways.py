"""One log in each of the ways in which algid takes one: files, frames, arrays and messages."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from functools import partial
from pathlib import Path
from typing import Any, Literal

import h5py
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.feather as feather
import pyarrow.parquet as parquet
import scipy.io
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer

from algid.base.ros2 import JOINT_STATE, JOINT_STATE_DEFINITION
from algid.log import Log
from tests.readers.mcaps import (
    ANY,
    STORES,
    Schema,
    joint_state,
    protobuf_schema,
    state_of,
    write_mcap,
)

EPOCH = 1_700_000_000_000_000_000
FLAT = [
    "csv", "tsv", "jsonl", "parquet", "feather", "npz", "mat", "h5",
    "dict", "pandas", "polars", "arrays",
]  # fmt: skip
LISTS = ["parquet[]", "jsonl[]"]
MESSAGES = ["cdr", "json", "pb", "bag1", "db3"]
WAYS = FLAT + LISTS + MESSAGES
_WITH_ATTRIBUTES = {"csv", "tsv", "parquet", "feather", "npz", "mat", "h5", "pandas"}
_MASKED = {"parquet", "feather", "dict", "pandas", "polars", "arrays"}
_ZONED = {"csv", "tsv", "jsonl", "parquet", "feather", "pandas", "polars"}
CANONICAL = ["time", "q1", "q2", "tau1", "tau2"]


class CannotSayError(Exception):
    """A way has no place for a fact."""


class Zoned:
    """Stamps in ns since 1970 that have a zone."""

    def __init__(self, stamp_ns: Any) -> None:
        self.stamps = np.asarray(stamp_ns).astype("datetime64[ns]")


@dataclass(frozen=True)
class Flat:
    """Columns by name, attributes by column, and metadata of the file."""

    columns: Mapping[str, Any]
    attributes: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    metadata: Mapping[str, str] = field(default_factory=dict)


def units(columns: Mapping[str, Any], names: str, key: str = "units") -> Flat:
    """Columns whose units stand beside them: attributes, or a row of units."""
    pairs = zip(columns, names.split(","), strict=True)
    return Flat(columns, {name: {key: unit} for name, unit in pairs})


@dataclass(frozen=True)
class Message:
    """One joint state; stamps in ns."""

    position: Sequence[float]
    effort: Sequence[float]
    stamp: int
    log_stamp: int
    name: Sequence[str] = ("j1", "j2")
    velocity: Sequence[float] = ()
    topic: str = "/joint_states"
    frame: str = ""


@dataclass(frozen=True)
class States:
    """Joint states, the text of their definition, and metadata of the file."""

    messages: Sequence[Message]
    definition: str = JOINT_STATE_DEFINITION
    metadata: Mapping[str, str] = field(default_factory=dict)


def sent(log: Log, **changes: Any) -> list[Message]:
    """The samples of a log as joint states, all with the same `changes`."""
    omega = np.empty((0, len(log))) if log.omega is None else log.omega
    signals = (values.T.tolist() for values in (log.theta, log.tau, omega))
    return [
        Message(theta, tau, stamp, stamp, velocity=speed, **changes)
        for theta, tau, speed, stamp in zip(*signals, log.stamp_ns.tolist(), strict=True)
    ]


def written(way: str, folder: Path, log: Flat | States) -> Any:
    """A path, a frame, a dict, or a function that gives a `Log`; raises `CannotSayError`."""
    if isinstance(log, Flat):
        values = log.columns.values()
        if (
            (log.attributes and way not in _WITH_ATTRIBUTES)
            or (any(isinstance(one, np.ma.MaskedArray) for one in values) and way not in _MASKED)
            or (any(isinstance(one, Zoned) for one in values) and way not in _ZONED)
        ):
            raise CannotSayError
        return _FLAT_WAYS[way](folder, log)
    if way in LISTS:
        return _lists(way, folder, log)
    return _MESSAGE_WAYS[way](folder, log)


def _without_metadata(log: Flat) -> None:
    if log.metadata:
        raise CannotSayError


def cell_text(value: Any) -> str:
    """A cell as text files write it."""
    if value is None:
        return ""
    if isinstance(value, str | Decimal):
        return str(value)
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    if isinstance(value, np.timedelta64):
        return str(value / np.timedelta64(1, "s"))
    if isinstance(value, np.datetime64):
        return str(value.astype("datetime64[us]"))
    if isinstance(value, int | np.integer):
        return str(int(value))
    return repr(float(value))


def _json_value(value: Any) -> Any:
    if isinstance(value, np.generic) and value.dtype.kind in "fiub":
        return value.item()
    if isinstance(value, np.generic | Decimal) and not isinstance(value, str):
        return cell_text(value)
    return value


def _rows(log: Flat) -> Iterable[tuple[Any, ...]]:
    columns = []
    for values in log.columns.values():
        if isinstance(values, Zoned):
            stamps = values.stamps.astype("datetime64[us]")
            columns.append([f"{stamp}+00:00" for stamp in stamps])
        else:
            columns.append(list(values))
    return zip(*columns, strict=True)


def csv_text(log: Flat, separator: str = ",") -> str:
    """Comments of the metadata, header, units row where a column has a unit, rows."""
    lines = [f"# {key}: {value}" if value else f"# {key}" for key, value in log.metadata.items()]
    lines.append(separator.join(log.columns))
    if log.attributes:
        if any(set(said) != {"units"} for said in log.attributes.values()):
            raise CannotSayError
        units = [log.attributes.get(name, {}).get("units", "") for name in log.columns]
        lines.append(separator.join(units))
    lines += [separator.join(map(cell_text, row)) for row in _rows(log)]
    return "\n".join(lines) + "\n"


def _text(way: str, folder: Path, log: Flat) -> Path:
    path = folder / f"log.{way}"
    path.write_text(csv_text(log, "," if way == "csv" else "\t"))
    return path


def _jsonl(folder: Path, log: Flat) -> Path:
    lines = [json.dumps(dict(log.metadata))] if log.metadata else []
    for row in _rows(log):
        lines.append(json.dumps(dict(zip(log.columns, map(_json_value, row), strict=True))))
    path = folder / "log.jsonl"
    path.write_text("\n".join(lines) + "\n")
    return path


def arrow_table(log: Flat) -> pa.Table:
    """A table whose schema and fields have the metadata."""
    arrays = []
    for values in log.columns.values():
        if isinstance(values, Zoned):
            arrays.append(pa.array(values.stamps).cast(pa.timestamp("ns", tz="Europe/Berlin")))
        elif isinstance(values, np.ma.MaskedArray):
            arrays.append(pa.array(values.data, mask=values.mask))
        elif isinstance(values, list):
            arrays.append(pa.array(values))
        elif values.dtype.byteorder == ">" or values.dtype.kind == "c":
            raise CannotSayError
        else:
            arrays.append(pa.array(list(values)) if values.dtype == object else pa.array(values))
    fields = []
    for name, array in zip(log.columns, arrays, strict=True):
        fields.append(pa.field(name, array.type, metadata=log.attributes.get(name)))
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields, metadata=log.metadata or None))


def store_table(path: Path, table: pa.Table, **options: Any) -> Path:
    """A table as Parquet or Feather."""
    if path.suffix == ".parquet":
        parquet.write_table(table, path, **options)
    else:
        feather.write_feather(table, str(path), **options)
    return path


def store(path: Path, arrays: Mapping[str, Any], packed: bool = False) -> Path:
    """Arrays for NumPy, MATLAB or HDF5; those named with dots lie in structures or groups."""
    if path.suffix == ".npz":
        (np.savez_compressed if packed else np.savez)(path, **arrays)
    elif path.suffix == ".mat":
        structs: dict[str, Any] = {}
        for name, values in arrays.items():
            *groups, own = name.split(".")
            level = structs
            for group in groups:
                level = level.setdefault(group, {})
            level[own] = values
        scipy.io.savemat(path, structs, do_compression=packed)
    else:
        with h5py.File(path, "w") as file:
            packing = {"compression": "gzip", "chunks": True} if packed else {}
            for name, values in arrays.items():
                file.create_dataset(name.replace(".", "/"), data=values, **packing)
    return path


def _table(way: str, folder: Path, log: Flat) -> Path:
    return store_table(folder / f"log.{way}", arrow_table(log))


def _stored(way: str, folder: Path, log: Flat) -> Path:
    """Arrays and their attributes, by place in NumPy's archives, by name in MATLAB's structs."""
    content: dict[str, Any] = {name: np.asarray(values) for name, values in log.columns.items()}
    kinds = {one.dtype.kind for one in content.values()}
    nameless = way == "mat" and not all(map(str.isidentifier, content))
    if nameless or kinds & set("O" if way == "npz" else "OmM"):
        raise CannotSayError
    path = folder / f"log.{way}"
    if way == "h5":
        texts = {name: one.astype("S") for name, one in content.items() if one.dtype.kind == "U"}
        with h5py.File(store(path, content | texts), "a") as file:
            for name, said in log.attributes.items():
                for key, text in said.items():
                    file[name].attrs[key] = text if key == "units" else float(text)
            file.attrs.update(log.metadata)
        return path
    content |= log.metadata
    for key in {key for said in log.attributes.values() for key in said}:
        named = {name: said[key] for name, said in log.attributes.items() if key in said}
        content[key] = named if way == "mat" else [named.get(name, "") for name in log.columns]
    return store(path, content)


def _dict(_: Path, log: Flat) -> dict[str, Any]:
    _without_metadata(log)
    return dict(log.columns)


def _pandas(_: Path, log: Flat) -> pd.DataFrame:
    columns: dict[str, Any] = {}
    for name, values in log.columns.items():
        columns[name] = values
        if isinstance(values, Zoned):
            index = pd.DatetimeIndex(values.stamps).tz_localize("UTC")
            columns[name] = index.tz_convert("Europe/Berlin")
        elif isinstance(values, np.ma.MaskedArray):
            columns[name] = pd.arrays.FloatingArray(values.data.copy(), values.mask.copy())
    frame = pd.DataFrame(columns)
    if log.attributes:
        units = {name: said.get("units") for name, said in log.attributes.items()}
        frame.attrs["units"] = {name: unit for name, unit in units.items() if unit}
        frame.attrs |= {name: dict(said) for name, said in log.attributes.items()}
    frame.attrs |= log.metadata
    return frame


def _polars(_: Path, log: Flat) -> pl.DataFrame:
    _without_metadata(log)
    return pl.DataFrame(pl.from_arrow(arrow_table(log)))


def _arrays(_: Path, log: Flat) -> Callable[[], Log]:
    _without_metadata(log)
    if list(log.columns) != CANONICAL:
        raise CannotSayError
    time, q1, q2, tau1, tau2 = log.columns.values()
    masked = any(isinstance(one, np.ma.MaskedArray) for one in log.columns.values())
    stack: Any = np.ma.stack if masked else np.stack
    return lambda: Log.from_arrays(time, stack([q1, q2]), stack([tau1, tau2]))


def _json_columns(folder: Path, log: Flat) -> Path:
    _without_metadata(log)
    rows = []
    for place, row in enumerate(_rows(log)):
        text = json.dumps(dict(zip(log.columns, map(_json_value, row), strict=True)))
        rows.append((place * 5_000_000, text))
    return json_mcap(folder, rows)


_FLAT_WAYS: dict[str, Callable[[Path, Flat], Any]] = {
    "csv": partial(_text, "csv"), "tsv": partial(_text, "tsv"), "jsonl": _jsonl,
    "parquet": partial(_table, "parquet"), "feather": partial(_table, "feather"),
    "npz": partial(_stored, "npz"),
    "mat": partial(_stored, "mat"), "h5": partial(_stored, "h5"), "dict": _dict, "pandas": _pandas,
    "polars": _polars, "arrays": _arrays, "json": _json_columns,
}  # fmt: skip


def json_mcap(
    folder: Path, rows: Iterable[tuple[int, str]], schema: Schema = ANY, topic: str = "/arm"
) -> Path:
    """Objects on one topic with their log times in ns."""
    messages = ((topic, stamp, text.encode()) for stamp, text in rows)
    return write_mcap(folder / "log.mcap", messages, schema)


def _cdr(folder: Path, log: States) -> Path:
    rows = []
    for one in log.messages:
        values = (one.name, one.position, one.velocity, one.effort)
        data = joint_state(one.stamp, *values, frame_id=one.frame)
        rows.append((one.topic, one.log_stamp, data))
    schema = (JOINT_STATE, "ros2msg", log.definition.encode())
    return write_mcap(folder / "log.mcap", rows, schema, metadata=log.metadata)


def json_state(one: Message) -> dict[str, Any]:
    """A joint state as the object that JSON has of it."""
    sec, nanosec = divmod(one.stamp, 10**9)
    return {
        "header": {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": one.frame},
        "name": one.name,
        "position": one.position,
        "effort": one.effort,
        "velocity": one.velocity,
    }


def _usual_definition(log: States) -> None:
    if log.definition is not JOINT_STATE_DEFINITION:
        raise CannotSayError


def _json(folder: Path, log: States) -> Path:
    _usual_definition(log)
    rows = [
        (one.topic, one.log_stamp, json.dumps(json_state(one)).encode()) for one in log.messages
    ]
    return write_mcap(folder / "log.mcap", rows, ANY, metadata=log.metadata)


def _pb(folder: Path, log: States) -> Path:
    _usual_definition(log)
    if any(one.frame for one in log.messages):
        raise CannotSayError
    schema, kind = protobuf_schema()
    rows = []
    for one in log.messages:
        message = kind(
            name=one.name, position=one.position, velocity=one.velocity, effort=one.effort
        )
        message.timestamp.seconds, message.timestamp.nanos = divmod(one.stamp, 10**9)
        rows.append((one.topic, one.log_stamp, message.SerializeToString()))
    known = ("arm.State", "protobuf", schema)
    return write_mcap(folder / "log.mcap", rows, known, metadata=log.metadata)


def _lists(way: str, folder: Path, log: States) -> Path:
    """Joint states as rows of a table whose cells are lists."""
    _usual_definition(log)
    if len({one.topic for one in log.messages}) > 1 or (log.metadata and way == "jsonl[]"):
        raise CannotSayError
    columns: dict[str, list[Any]] = {
        "time": [(one.stamp - EPOCH) * 1e-9 for one in log.messages],
        "name": [list(one.name) for one in log.messages],
        "position": [list(one.position) for one in log.messages],
        "effort": [list(one.effort) for one in log.messages],
    }
    if any(one.velocity for one in log.messages):
        columns["velocity"] = [list(one.velocity) for one in log.messages]
    if any(one.frame for one in log.messages):
        columns["frame_id"] = [one.frame for one in log.messages]
    if any(one.log_stamp != one.stamp for one in log.messages):
        columns["log_time"] = [one.log_stamp for one in log.messages]
    if way == "jsonl[]":
        return _jsonl(folder, Flat(columns))
    return _table("parquet", folder, Flat(columns, metadata=log.metadata))


def bag1(folder: Path, log: States, packing: Ros1Writer.CompressionFormat | None = None) -> Path:
    """Joint states as a ROS 1 bag of small chunks."""
    path = folder / "log.bag"
    writer = Ros1Writer(path)
    writer.chunk_threshold = 4096
    if packing is not None:
        writer.set_compression(packing)
    with writer:
        _fill(writer, STORES[0], log, {"seq": 0})
    return path


def bag2(
    folder: Path,
    log: States,
    plugin: StoragePlugin = StoragePlugin.SQLITE3,
    version: Literal[8, 9] = 9,
) -> Path:
    """Joint states as a rosbag2 folder."""
    path = folder / "log"
    with Ros2Writer(path, version=version, storage_plugin=plugin) as writer:
        _fill(writer, STORES[1], log, {})
    return path


def _fill(writer: Any, store: Any, log: States, head: Mapping[str, Any]) -> None:
    """Write joint states into a bag; `head` is what its headers have beside ROS 2's."""
    _usual_definition(log)
    if log.metadata:
        raise CannotSayError
    serialize = store.serialize_ros1 if head else store.serialize_cdr
    connections: dict[str, Any] = {}
    for one in log.messages:
        if one.topic not in connections:
            connections[one.topic] = writer.add_connection(one.topic, JOINT_STATE, typestore=store)
        values = (one.name, one.position, one.velocity, one.effort)
        message = state_of(store, one.stamp, *values, frame_id=one.frame, **head)
        writer.write(connections[one.topic], one.log_stamp, serialize(message, JOINT_STATE))


_MESSAGE_WAYS: dict[str, Callable[[Path, States], Path]] = {
    "cdr": _cdr,
    "json": _json,
    "pb": _pb,
    "bag1": bag1,
    "db3": bag2,
}
