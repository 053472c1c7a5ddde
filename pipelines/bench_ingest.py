"""Time the readers against decompression, polars and other readers, in one run on the same files.

Usage: python -m pipelines.bench_ingest [FOLDER]

Prints a Markdown table. Times are medians of rounds in which what is compared takes turns, page
cache warm, imports excluded: a processor that drifts by a quarter within a run favours neither.
Processor time (user and system, of all threads) says what reading costs, the wall what it takes
where other cores are free.
"""

from __future__ import annotations

import gc
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl
import zstandard
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader

from algid.base.runtime import cores
from algid.log import Log, Origin
from algid.readers import open_log, read_log
from pipelines import bench_files

COLUMNS = ["stamp_ns", "theta1", "theta2", "tau1", "tau2", "omega1", "omega2"]


class Times(NamedTuple):
    """What a piece of work takes, in s."""

    wall: float
    processor: float


def medians(rounds: int, *works: Callable[[], object]) -> list[Times]:
    """Of each work its median times, over rounds in which they take turns."""
    times = np.empty((rounds, len(works), 2))
    for own in times:
        for place, work in enumerate(works):
            gc.collect()
            start = np.array([time.perf_counter(), time.process_time()])
            work()
            own[place] = [time.perf_counter(), time.process_time()] - start
    return [Times(float(wall), float(spent)) for wall, spent in np.median(times, axis=0)]


def decompress(path: Path) -> int:
    """Unpack every chunk of a file and do nothing else."""
    size = 0
    with path.open("rb") as stream:
        for record in StreamReader(stream, emit_chunks=True).records:
            if isinstance(record, Chunk):
                size += len(zstandard.decompress(record.data, record.uncompressed_size))
    return size


def peer(path: Path, factory: Any, topic: str) -> Log | None:
    """The log through the `mcap` package and a decoder factory, message by message."""
    from mcap.reader import make_reader

    stamps, positions, velocities, efforts = [], [], [], []
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[factory])
        for _, _, message, decoded in reader.iter_decoded_messages(topics=[topic]):
            stamps.append(message.log_time)
            positions.append(list(decoded.position))
            velocities.append(list(decoded.velocity))
            efforts.append(list(decoded.effort))
    theta, omega, tau = (np.array(rows).T for rows in (positions, velocities, efforts))
    return Log(np.array(stamps), theta, tau, Origin("", "", {}), omega)


def same(one: Log, other: Log) -> bool:
    """Whether two logs agree in every bit."""
    names = ("stamp_ns", "theta", "tau", "omega")
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)


def peak_above_arrays(path: Path) -> float:
    """MB of memory that reading a file takes beyond its arrays and what the imports take."""
    code = (
        "import re, sys; from pathlib import Path; from algid.readers import read_log\n"
        "import algid.readers.messages.joint_topic, zstandard, mcap.records, mcap.data_stream\n"
        "words = lambda: Path('/proc/self/status').read_text()\n"
        "status = lambda key: int(re.search(key + r':\\s*(\\d+)', words())[1]) * 1024\n"
        "Path('/proc/self/clear_refs').write_text('5')\n"  # forget the peak of the imports
        "before = status('VmRSS'); log = read_log(sys.argv[1])\n"
        "arrays = sum(a.nbytes for a in (log.stamp_ns, log.theta, log.tau, log.omega))\n"
        "print((status('VmHWM') - before - arrays) / 1e6)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True
    )
    return float(done.stdout)


def row(name: str, aim: str, figure: str, detail: str) -> None:
    """Print one row of the table."""
    print(f"| {name} | {aim} | {figure} | {detail} |", flush=True)


def joints(folder: Path) -> None:
    """A million joint states among Imu messages."""
    from mcap_ros2.decoder import DecoderFactory

    path = folder / "joints.mcap"
    if not path.exists():
        bench_files.joint_and_imu(path)
    limit, ours = medians(11, lambda: decompress(path), lambda: read_log(path))
    row(
        "1,000,000 JointState + 200,000 Imu, zstd, to decompression, processor time",
        "≤ 1.9",
        f"{ours.processor / limit.processor:.2f}",
        f"{ours.processor:.3f} s, decompression {limit.processor:.3f} s",
    )
    row(
        f"the same, wall on {cores()} cores to decompression on one",
        "≤ 1.2",
        f"{ours.wall / limit.wall:.2f}",
        f"{ours.wall:.3f} s, decompression {limit.wall:.3f} s",
    )
    start = time.perf_counter()
    theirs = peer(path, DecoderFactory(), "/joint_states")
    slow = time.perf_counter() - start
    equal = "bit-exact" if theirs is not None and same(read_log(path), theirs) else "DIFFERENT"
    row(
        "the same, mcap-ros2-support to algid",
        "≥ 40",
        f"{slow / ours.wall:.0f}",
        f"{slow:.1f} s, {equal}",
    )
    row(
        "the same, memory beyond the arrays, MB",
        "≤ 64",
        f"{peak_above_arrays(path):.0f}",
        "peak resident",
    )


def protobuf(folder: Path) -> None:
    """A hundred thousand protobuf messages."""
    from mcap_protobuf.decoder import DecoderFactory

    path = folder / "protobuf.mcap"
    if not path.exists():
        bench_files.protobuf_states(path)
    (ours,) = medians(7, lambda: read_log(path))
    start = time.perf_counter()
    theirs = peer(path, DecoderFactory(), "/arm")
    slow = time.perf_counter() - start
    equal = "bit-exact" if theirs is not None and same(read_log(path), theirs) else "DIFFERENT"
    detail = f"{ours.wall:.3f} s against {slow:.2f} s, {equal}"
    figure = f"{slow / ours.wall:.0f}"
    row("100,000 protobuf, mcap-protobuf-support to algid", "≥ 15", figure, detail)


def cameras(folder: Path) -> None:
    """Bytes read of a large log with cameras."""
    path = folder / "cameras.mcap"
    if not path.exists():
        bench_files.with_cameras(path)
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    indexes = summary.chunk_indexes
    needed = sum(one.chunk_length for one in indexes if 1 in one.message_index_offsets)
    before = _bytes_read()
    for _ in open_log(path).blocks():
        pass
    read = _bytes_read() - before
    row(
        "2 GB with cameras, bytes read to the channel's chunks",
        "≤ 2",
        f"{read / needed:.2f}",
        f"{read / 1e6:.0f} MB of {path.stat().st_size / 1e6:.0f} MB",
    )


def _bytes_read() -> int:
    """Bytes that this process has read so far, from the page cache too."""
    return int(Path("/proc/self/io").read_text().split()[1])


def flat(folder: Path) -> None:
    """Parquet and CSV against polars reading the same columns."""
    bench_files.flat_files(folder)
    for kind, reader in (("parquet", pl.read_parquet), ("csv", pl.read_csv)):
        path = folder / f"arm.{kind}"
        theirs, ours, blocks = medians(
            25,
            lambda path=path, reader=reader: reader(path, columns=COLUMNS),  # type: ignore[misc]
            lambda path=path: read_log(path),  # type: ignore[misc]
            lambda path=path: list(map(len, open_log(path).blocks())),  # type: ignore[misc]
        )
        detail = f"{ours.wall:.3f} s against {theirs.wall:.3f} s; in blocks {blocks.wall:.3f} s"
        figure = f"{ours.wall / theirs.wall:.2f}"
        row(f"1,000,000 rows of {kind}, to polars", "≤ 1.3", figure, detail)


def main() -> None:
    """All of them."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build/bench-ingest")
    folder.mkdir(parents=True, exist_ok=True)
    print("| what | aim | measured | told |\n|---|---|---|---|")
    for part in (joints, protobuf, cameras, flat):
        part(folder)


if __name__ == "__main__":
    main()
