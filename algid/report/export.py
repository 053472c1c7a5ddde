"""A result as a ROS 2 log, which Foxglove and PlotJuggler open beside the original.

================  ==============================================================================
topic             fields
================  ==============================================================================
/algid/torque     theta1 … tau2 as used, tau1_predicted and tau2_predicted, what is left: residual1
                  and residual2; rad, rad/s and N m
/algid/estimates  the paper's series and condition
/algid/loaded     the same of the loaded log
================  ==============================================================================

Several logs keep a topic each: the second one's is `/algid/log2/torque` and so on.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from algid import __version__
from algid.base.files import whole_file
from algid.base.names import stacked
from algid.base.progress import Progress
from algid.base.ros2 import HEADER, headed
from algid.report.series import facts_of, stretches

if TYPE_CHECKING:
    from mcap.writer import Writer

START_KEY = b"start_ns"
SERIES = "algid_msgs/msg/Series"
ROWS = 1 << 14


def export_mcap(folder: Path, progress: Progress | None = None) -> Path:
    """Write `estimates.mcap` into the result folder `folder`, telling how far it has come.

    The messages bear the log's own stamps where each Parquet file tells its logs' first ones, in
    ns, as a JSON list in its metadata ``start_ns``; otherwise time counts from zero.

    Raises
    ------
    ResultError
        If the folder's files are missing or unreadable.
    OutputError
        If the log cannot be written.
    """
    files = {name: folder / f"{name}.parquet" for name in ("torque", "estimates", "loaded")}
    return write_mcap(folder / "estimates.mcap", files, progress)


def write_mcap(path: Path, files: Mapping[str, Path], progress: Progress | None = None) -> Path:
    """Write Parquet series as topics `/algid/NAME` by their names, a message a row.

    A field is a column. A file that is not there is left out. Raises `ResultError`, `OutputError`.
    """
    from mcap.writer import CompressionType, Writer

    with whole_file(path) as temporary, temporary.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library=f"algid {__version__}")
        for name, file in files.items():
            if file.is_file():
                _write_series(writer, file, name, progress)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def _write_series(writer: Writer, path: Path, name: str, progress: Progress | None) -> None:
    _, metadata = facts_of(path)
    starts, channels = json.loads(metadata.get(START_KEY, b"[]")), dict[int, int]()
    for log, block in stretches(path, "export", progress, ROWS):
        names = [one for one in block if one not in ("log", "t")]
        if log not in channels:
            # as fields of ROS: k5+k3+z1+z2 is k5_k3_z1_z2
            fields = [re.sub(r"[^\w]", "_", one).lower().strip("_") for one in names]
            definition = "".join(f"float64 {field}\n" for field in fields)
            definition = f"std_msgs/Header header\n{definition}{HEADER}"
            schema = writer.register_schema(SERIES, "ros2msg", definition.encode())
            topic = f"/algid/log{log + 1}/{name}" if log else f"/algid/{name}"
            channels[log] = writer.register_channel(topic, "cdr", schema)
        # whole nanoseconds, which float64 seconds resolve for a hundred days
        stamps = np.rint(block["t"] * 1e9).astype(np.int64)
        stamps += starts[log] if log < len(starts) else 0
        rows = headed(path, stamps, [("numbers", "<f8", len(names))])
        rows["numbers"] = stacked(block, names, axis=1)
        for stamp, row in zip(stamps.tolist(), rows, strict=True):
            writer.add_message(channels[log], stamp, row.tobytes(), stamp)
