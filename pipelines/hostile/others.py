"""A sound log in the formats whose bytes no checksum guards.

Feather, NumPy, MATLAB, HDF5, JSON lines, ROS 1 bag, SQLite rosbag2.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from scipy.io import savemat

from algid.log import Log

_TYPE = "sensor_msgs/msg/JointState"
_TOPIC = "/joint_states"


def other_files(folder: Path, log: Log) -> list[Path]:
    """The log in each of these formats, packed and not."""
    columns: dict[str, Any] = {
        "t": log.t,
        "theta1": log.theta[0],
        "theta2": log.theta[1],
        "tau1": log.tau[0],
        "tau2": log.tau[1],
    }
    paths = [folder / f"clean.{packing or 'plain'}.feather" for packing in (None, "lz4", "zstd")]
    for path, packing in zip(paths, (None, "lz4", "zstd"), strict=True):
        _feather(path, columns, packing)
    np.savez(folder / "clean.npz", **columns)
    np.savez_compressed(folder / "clean.packed.npz", **columns)
    savemat(folder / "clean.mat", columns)
    savemat(folder / "clean.packed.mat", {"run": columns}, do_compression=True)
    names = ("clean.npz", "clean.packed.npz", "clean.mat", "clean.packed.mat")
    return [
        *paths,
        *(folder / name for name in names),
        *_hdf5_files(folder, columns),
        *_json_files(folder, columns),
        _bag(folder / "clean.bag", log),
        _db3(folder / "clean", log),
    ]


def _feather(path: Path, columns: dict[str, Any], packing: str | None) -> None:
    table = pa.table({**columns, "note": pa.array(["x"] * len(columns["t"])).dictionary_encode()})
    options = pa.ipc.IpcWriteOptions(compression=packing)
    with (
        pa.OSFile(str(path), "wb") as sink,
        pa.ipc.new_file(sink, table.schema, options=options) as file,
    ):
        file.write_table(table, max_chunksize=100)


def _hdf5_files(folder: Path, columns: dict[str, Any]) -> list[Path]:
    """Arrays in one piece, in chunks that are packed and bear sums, and a table.

    None where h5py is missing.
    """
    try:
        import h5py
    except ImportError:
        return []
    kinds: dict[str, dict[str, Any]] = {
        "plain": {},
        "packed": {"chunks": (30,), "compression": "gzip", "fletcher32": True},
    }
    paths = [folder / f"clean.{kind}.h5" for kind in (*kinds, "table")]
    for path, more in zip(paths, kinds.values(), strict=False):
        with h5py.File(path, "w") as file:
            for name, values in columns.items():
                file.create_dataset(name, data=values, **more)
    table = np.empty(len(columns["t"]), [(name, float) for name in columns])
    for name, values in columns.items():
        table[name] = values
    with h5py.File(paths[-1], "w") as file:
        file["run"] = table
    return paths


def _json_files(folder: Path, columns: dict[str, Any]) -> list[Path]:
    """A flat object a line, and a nested one as a robot's driver prints it."""
    flat, nested = folder / "clean.jsonl", folder / "clean.nested.jsonl"
    rows = [
        dict(zip(columns, row, strict=True))
        for row in np.stack(list(columns.values()), axis=1).tolist()
    ]
    flat.write_text("".join(json.dumps(row) + "\n" for row in rows))
    motors = [
        [{"q": row[f"theta{joint}"], "tau_est": row[f"tau{joint}"]} for joint in (1, 2)]
        for row in rows
    ]
    nested.write_text(
        "".join(
            json.dumps({"t": row["t"], "motor_state": motor}) + "\n"
            for row, motor in zip(rows, motors, strict=True)
        )
    )
    return [flat, nested]


def _bag(path: Path, log: Log) -> Path:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(path) as writer:
        channel = writer.add_connection(_TOPIC, _TYPE, typestore=store)
        for row, stamp in enumerate(log.stamp_ns.tolist()):
            writer.write(
                channel, stamp, store.serialize_ros1(_message(store, log, row, seq=row), _TYPE)
            )
    return path


def _db3(folder: Path, log: Log) -> Path:
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(folder, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        channel = writer.add_connection(_TOPIC, _TYPE, typestore=store)
        for row, stamp in enumerate(log.stamp_ns.tolist()):
            writer.write(channel, stamp, store.serialize_cdr(_message(store, log, row), _TYPE))
    (path,) = folder.glob("*.db3")
    return path.rename(folder.with_suffix(".db3"))


def _message(store: Any, log: Log, row: int, **counts: int) -> Any:
    time, header, state = (
        store.types[name] for name in ("builtin_interfaces/msg/Time", "std_msgs/msg/Header", _TYPE)
    )
    sec, nanosec = divmod(int(log.stamp_ns[row]), 10**9)
    return state(
        header=header(**counts, stamp=time(sec=sec, nanosec=nanosec), frame_id=""),
        name=["joint1", "joint2"],
        position=log.theta[:, row].copy(),
        velocity=np.empty(0),
        effort=log.tau[:, row].copy(),
    )
