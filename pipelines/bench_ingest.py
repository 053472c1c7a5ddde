"""Time the readers against decompression, polars and other readers, in one run on the same files.

    python -m pipelines.bench_ingest [FOLDER]

Times are medians of rounds in which what is compared takes turns, page cache warm, imports
excluded: a processor that drifts by a quarter within a run favours neither. Processor time (user
and system, of all threads) says what reading costs, the wall what it takes where other cores are
free.
"""

from __future__ import annotations

import gc
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import zstandard
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader

from algid.log import Log, Origin
from algid.readers import read_log
from algid.writers import write_log
from pipelines import bench_logs

COLUMNS = ["stamp_ns", "theta1", "theta2", "tau1", "tau2", "omega1", "omega2"]
ROWS, PROTOBUF_ROWS = 1_000_000, 100_000


def medians(rounds: int, *works: Callable[[], object]) -> Any:
    """Of each work its median wall and processor time in s, over rounds in which they take turns:
    (works, 2).
    """
    times = np.empty((rounds, len(works), 2))
    for own in times:
        for place, work in enumerate(works):
            gc.collect()
            start = np.array([time.perf_counter(), time.process_time()])
            work()
            own[place] = [time.perf_counter(), time.process_time()] - start
    return np.median(times, axis=0)


def decompress(path: Path) -> None:
    """Unpack every chunk of a file and do nothing else."""
    with path.open("rb") as stream:
        for record in StreamReader(stream, emit_chunks=True).records:
            if isinstance(record, Chunk):
                zstandard.decompress(record.data, record.uncompressed_size)


def peer(path: Path, factory: Any, topic: str) -> Log:
    """The log through the `mcap` package and a decoder factory, message by message."""
    stamps, rows = [], []
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[factory])
        for _, _, message, decoded in reader.iter_decoded_messages(topics=[topic]):
            stamps.append(message.log_time)
            rows.append([[*decoded.position], [*decoded.effort], [*decoded.velocity]])
    theta, tau, omega = np.moveaxis(np.array(rows), 0, -1)
    return Log(np.array(stamps), theta, tau, Origin("", "", {}), omega)


def against_peer(path: Path, factory: Any, topic: str, ours: float) -> str:
    """How many times as long another reader takes, and whether it reads the same bits."""
    start = time.perf_counter()
    theirs, found = peer(path, factory, topic), read_log(path)
    seconds = time.perf_counter() - start - ours
    names = ("stamp_ns", "theta", "tau", "omega")
    same = all(np.array_equal(getattr(found, one), getattr(theirs, one)) for one in names)
    return f"{seconds / ours:.0f} ({'bit-exact' if same else 'DIFFERENT'})"


def main(folder: Path) -> None:
    """Print the table."""
    from mcap_protobuf.decoder import DecoderFactory as ProtobufFactory
    from mcap_ros2.decoder import DecoderFactory

    folder.mkdir(parents=True, exist_ok=True)
    joints, protobuf = folder / "joints.mcap", folder / "protobuf.mcap"
    for path, write, count in (
        (joints, bench_logs.joint_and_imu, ROWS),
        (protobuf, bench_logs.protobuf_states, PROTOBUF_ROWS),
    ):
        if not path.exists():
            write(path, count)
    print("| what | asked | measured |\n|---|---|---|")
    limit, ours = medians(11, partial(decompress, joints), partial(read_log, joints))
    wall, processor = ours / limit
    print(
        f"| 1,000,000 JointState + 200,000 Imu, zstd, to decompression | ≤ 1.9 | {processor:.2f} |"
    )
    print(f"| the same, wall | ≤ 1.2 | {wall:.2f} |")
    slower = against_peer(joints, DecoderFactory(), "/joint_states", ours[0])
    print(f"| the same, mcap-ros2-support to algid | ≥ 40 | {slower} |")
    ((own, _),) = medians(7, partial(read_log, protobuf))
    slower = against_peer(protobuf, ProtobufFactory(), "/arm", own)
    print(f"| 100,000 protobuf, mcap-protobuf-support to algid | ≥ 15 | {slower} |", flush=True)
    for kind, reader in (("parquet", pl.read_parquet), ("csv", pl.read_csv)):
        path = folder / f"arm.{kind}"
        if not path.exists():
            write_log(path, bench_logs.arm_log(ROWS))
        works = partial(reader, path, columns=COLUMNS), partial(read_log, path)
        theirs, ours = medians(25, *works)
        print(
            f"| 1,000,000 rows of {kind}, to polars | ≤ 1.3 | {ours[0] / theirs[0]:.2f} |",
            flush=True,
        )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "build/bench-ingest"))
