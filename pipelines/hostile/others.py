"""A sound log in the formats whose bytes no checksum guards: Feather, NumPy, MATLAB, ROS 1 bag, SQLite rosbag2."""

from __future__ import annotations

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
    table = np.empty(len(log), [(name, float) for name in columns])
    for name, values in columns.items():
        table[name] = values
    np.save(folder / "clean.npy", table)
    savemat(folder / "clean.mat", columns)
    savemat(folder / "clean.packed.mat", {"run": columns}, do_compression=True)
    names = ("clean.npz", "clean.packed.npz", "clean.npy", "clean.mat", "clean.packed.mat")
    return [
        *paths,
        *(folder / name for name in names),
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
