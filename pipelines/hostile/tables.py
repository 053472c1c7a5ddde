"""Flat logs of every type, encoding, checksum and dialect."""

from __future__ import annotations

import gzip
import random
from dataclasses import replace
from functools import cache
from io import BytesIO
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import zstandard

from algid.log import Log
from pipelines.hostile import Hostile
from pipelines.mutations import clean_log, damage

_COLUMNS = ("theta1", "theta2", "tau1", "tau2")
_EXACT = (
    pa.float64(),
    pa.float32(),
    pa.int8(),
    pa.int16(),
    pa.int32(),
    pa.int64(),
    pa.uint8(),
    pa.uint16(),
    pa.float16(),
)
_OTHER = (
    pa.string(),
    pa.bool_(),
    pa.date32(),
    pa.timestamp("ns"),
    pa.decimal128(20, 4),
    pa.binary(),
    pa.time64("us"),
)
_ENCODINGS = (None, "PLAIN", "BYTE_STREAM_SPLIT", "DELTA_BINARY_PACKED")


@cache
def log_of_tables() -> Log:
    """What the files hold, where their types hold it: whole numbers from 0 to 100, at 1 kHz from
    0.
    """
    log = clean_log(300)
    theta, tau = (np.rint(50 + 40 * np.sin(values)) for values in (log.theta, log.tau))
    return replace(log, stamp_ns=np.arange(300) * 1_000_000, theta=theta, tau=tau, omega=None)


def _channels(log: Log) -> dict[str, Any]:
    return dict(zip(_COLUMNS, (*log.theta, *log.tau), strict=True))


def parquet(draw: random.Random) -> Hostile:
    """A Parquet file."""
    log = log_of_tables()
    columns: dict[str, Any] = {"t": pa.array(log.t)}
    strict = True
    for name, values in _channels(log).items():
        kind = draw.choice(_EXACT if draw.random() < 0.9 else _OTHER)
        strict &= kind in _EXACT
        array = pa.array(values).cast(kind) if kind in _EXACT else pa.array([None] * len(log), kind)
        columns[name] = draw.choice(
            (array, array, array, array.dictionary_encode() if kind not in _EXACT else array)
        )
    if draw.random() < 0.2:
        holes = draw.sample(range(len(log)), 3)
        columns["tau2"] = pa.array(
            [None if row in holes else float(row) for row in range(len(log))]
        )
        strict = False
    columns |= {"note": pa.array(["x"] * len(log))} if draw.random() < 0.3 else {}
    if draw.random() < 0.2:
        columns["extra"] = pa.array(
            [[1.0, 2.0]] * len(log),
            draw.choice((pa.list_(pa.float64()), pa.list_(pa.float64(), 2))),
        )
    encoding, summed = draw.choice(_ENCODINGS), draw.random() < 0.6
    stream = BytesIO()
    options: dict[str, Any] = {
        "write_page_checksum": summed,
        "data_page_version": draw.choice(("1.0", "2.0")),
    }
    options |= {
        "compression": draw.choice(("none", "snappy", "gzip", "zstd", "lz4", "brotli")),
        "version": draw.choice(("1.0", "2.6")),
    }
    options |= {
        "row_group_size": draw.choice((1, 7, 100, 1000)),
        "data_page_size": draw.choice((64, 1 << 20)),
    }
    table = pa.table(columns)
    try:
        pq.write_table(
            table,
            stream,
            use_dictionary=encoding is None,
            column_encoding=encoding and {"theta1": encoding},
            **options,
        )
    except (pa.ArrowException, OSError, ValueError):  # an encoding that the type does not have
        stream = BytesIO()
        pq.write_table(table, stream, **options)
    content = stream.getvalue()
    if draw.random() < 0.5:
        footer = len(content) - 8 - int.from_bytes(content[-8:-4], "little")
        inside = draw.random() < 0.5
        strict &= summed and inside  # the footer has no checksum: another schema is another file
        content = (
            damage(content[:footer], draw) + content[footer:]
            if inside
            else content[:footer] + damage(content[footer:], draw)
        )
    return Hostile(".parquet", content, "parquet", log if strict else None)


def csv(draw: random.Random) -> Hostile:
    """A text table."""
    log = log_of_tables()
    separator = draw.choice((",", ";", "\t", "|", " ", ", "))
    comma = separator.strip() != "," and draw.random() < 0.3
    names = draw.choice(
        (
            ("t", *_COLUMNS),
            ("time", "q1", "q2", "tau1", "tau2"),
            ("time [s]", "pos1", "pos2", "effort1", "effort2"),
        )
    )
    quote = draw.choice(("", "", '"'))
    rows = [separator.join(f"{quote}{name}{quote}" for name in names)]
    for row in range(len(log)):
        cells = [f"{row / 1000:.3f}", *(f"{values[row]:.1f}" for values in _channels(log).values())]
        rows.append(separator.join(cell.replace(".", ",") if comma else cell for cell in cells))
    whole = True
    for _ in range(draw.choice((0, 1, 1, 2))):
        whole &= _spoilt(rows, separator, draw)
    end = draw.choice(("\n", "\n", "\r\n", "\r"))
    text = (
        draw.choice(("", "", "# a log" + end, end))
        + end.join(rows)
        + draw.choice((end, "", end * 50))
    )
    content = text.encode(
        draw.choice(("utf-8", "utf-8", "utf-8-sig", "utf-16", "utf-16-be", "latin-1", "utf-32")),
        "replace",
    )
    suffix = draw.choice((".csv", ".csv", ".csv.gz", ".csv.zst"))
    if suffix != ".csv":
        content = gzip.compress(content) if suffix == ".csv.gz" else zstandard.compress(content)
        content = content[: draw.randrange(1, len(content))] if draw.random() < 0.3 else content
    return Hostile(suffix, content, "csv", log if whole else None)


def _spoilt(rows: list[str], separator: str, draw: random.Random) -> bool:
    """Spoil a row; whether the log is the same, or its loss can be seen."""
    place = draw.randrange(1, len(rows))
    cells = rows[place].split(separator)
    if len(cells) < 5:  # cut before
        return False
    cell = draw.randrange(1, 5)
    kind = draw.randrange(8)
    if kind == 0:
        cells[cell] = draw.choice(
            ("nan", "NaN", "", "x", "1e999", "--", '"', "0x1F", "1_000", "9" * 400)
        )
    elif kind == 1:
        del cells[cell:]
    elif kind == 2:
        cells += ["7"] * draw.choice((1, 1000))
    elif kind == 3:
        cells = [draw.choice(("", " ", "\t", "#", "//", "\0", "\x1a", '"', "t,theta1"))]
    elif kind == 4:
        rows.insert(place, draw.choice((rows[0], "s;rad;rad;Nm;Nm".replace(";", separator))))
        return False
    elif kind == 5:
        rows[0] = draw.choice(
            (
                rows[0] + separator + "note",
                separator.join(["t"] * 5),
                "",
                '"' + rows[0],
                rows[0] + "\ru",
            )
        )
        return False
    elif kind == 6:
        cells = [f" {one} " for one in cells]
    else:
        cells[0] = draw.choice(("0", "-1", "nan", "1e30", "9" * 25, "2024-01-01"))
    rows[place] = separator.join(cells)
    return kind in (0, 1, 2, 6)  # an empty line, or another stamp, is another log
