"""Logs that readers and checks refuse, each in its own way, and what is said of them."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import zstandard

import algid
from algid.base.ros2 import JOINT_STATE
from algid.log import Log
from algid.synth.sensors import Sensors
from algid.writers import write_log
from tests.readers.mcaps import joint_state, write_mcap

HEADER = "t,theta1,theta2,tau1,tau2\n"
Table = Callable[[pl.DataFrame], pl.DataFrame]


def write_refusals(folder: Path) -> dict[str, str]:
    """Write logs; by the name of each one's job, a pattern that its reason holds."""
    log, loaded = algid.synthesise(
        "case1", duration=2.0, torque="wide", sensors=Sensors(1e-4, 1e-3)
    )
    log, loaded = replace(log, omega=None), replace(loaded, omega=None)
    said: dict[str, str] = {}
    for write in (_texts, _tables, _mcaps, _cut_short, _folders):
        said |= write(folder, log)
    write_log(folder / "is-loaded.parquet", loaded, truth=loaded.origin.truth)
    return said | {"is": "a loaded log alone.*--parameters"}


def _texts(folder: Path, _log: Log) -> dict[str, str]:
    texts: dict[str, tuple[str | bytes, str]] = {
        "empty.csv": ("", "empty|holds no|expected"),
        "blank.csv": ("\n" * 100, "."),
        "no-columns.csv": ("not,a,log\n1,2,3\n", "no column for t"),
        "no-header.csv": ("0,1,2,3,4\n1,1,2,3,4\n", "."),
        "header-alone.csv": (HEADER, "."),
        "one-row.csv": (HEADER + "0,0,0,0,0\n", "."),
        "words.csv": (HEADER + "0,a,b,c,d\n" * 9, "."),
        "ragged.csv": (HEADER + "0,0,0\n1,1,1,1,1,1,1\n", "."),
        "unclosed-quote.csv": (HEADER + '0,"0,0,0,0\n1,0,0,0,0\n', "."),
        "too-large.csv": (HEADER + "0,0,0,0,0\n1,1e300,0,0,0\n", "finite number"),
        "nul.csv": (b"\0" * 4096, "."),
        "latin.csv": (HEADER.encode() + "0,0,0,0,µ\n".encode("latin-1"), "."),
        "json.csv": (json.dumps({"t": [0, 1]}), "."),
        "random.csv": (np.random.default_rng(0).bytes(4096), "."),
        "random.mcap": (np.random.default_rng(1).bytes(4096), "."),
        "random.parquet": (np.random.default_rng(2).bytes(4096), "."),
        "empty.mcap": (b"", "."),
        "empty.parquet": (b"", "."),
        "magic-alone.mcap": (b"\x89MCAP0\r\n", "."),
        "magic-twice.parquet": (b"PAR1\0\0\0\0PAR1", "."),
        "no-gzip.csv.gz": (b"\x1f\x8b\x08" + bytes(50), "."),
        "no-zstd.csv.zst": (b"\x28\xb5\x2f\xfd" + bytes(50), "."),
        "long-line.csv.gz": (gzip.compress(HEADER.encode() + b"5" * (1 << 24), 1), "."),
        "twice.csv.zst": (zstandard.compress(zstandard.compress(HEADER.encode())), "."),
    }
    for name, (text, _) in texts.items():
        (folder / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    # names of jobs are files' without suffix: each stem is its own job
    return _renamed(folder, {name: words for name, (_, words) in texts.items()})


def _tables(folder: Path, log: Log) -> dict[str, str]:
    write_log(folder / "whole.parquet", log)
    whole = pl.read_parquet(folder / "whole.parquet").select(
        "t", "theta1", "theta2", "tau1", "tau2"
    )
    (folder / "whole.parquet").unlink()
    row = pl.int_range(pl.len())
    changes: dict[str, tuple[Table, str]] = {
        "missing-column": (lambda t: t.drop("tau2"), "no column for .*tau2"),
        "nulls": (lambda t: t.with_columns(theta1=pl.when(row % 2 == 0).then("theta1")), "."),
        "infinite": (
            lambda t: t.with_columns(tau1=pl.when(row == 7).then(float("inf")).otherwise("tau1")),
            "finite",
        ),
        "text": (lambda t: t.with_columns(theta2=pl.lit("abc")), "."),
        "lists": (lambda t: t.with_columns(theta2=pl.concat_list("theta2", "theta1")), "."),
        "still": (lambda t: t.with_columns(t=pl.lit(0.5)), "increasing stamps|stand|starts again"),
        "backwards": (
            lambda t: t.with_columns(t=-pl.col("t").cast(pl.Float64)),
            "increasing stamps|back",
        ),
        "short": (lambda t: t.head(40), "."),
        "no-rows": (lambda t: t.head(0), "."),
        "no-torque": (lambda t: t.with_columns(tau1=pl.lit(0.0), tau2=pl.lit(0.0)), "."),
        "no-motion": (lambda t: t.with_columns(theta1=pl.lit(0.1), theta2=pl.lit(0.2)), "."),
        "degrees": (lambda t: t.with_columns(pl.col("theta1", "theta2") * 180 / np.pi), "DEGREES"),
        "slow": (lambda t: t[::200], "."),
    }
    for name, (change, _) in changes.items():
        change(whole).write_parquet(folder / f"{name}.parquet")
    return {name: words for name, (_, words) in changes.items()}


def _mcaps(folder: Path, log: Log) -> dict[str, str]:
    stamps = log.stamp_ns[:500].tolist()

    def states(**fields: Any) -> list[tuple[str, int, bytes]]:
        return [("/joint_states", stamp, joint_state(stamp, **fields).done()) for stamp in stamps]

    def of(
        text: str, encoding: str = "ros2msg", data: bytes = b"\0\1\0\0" + bytes(64)
    ) -> dict[str, Any]:
        return {
            "messages": [("/joint_states", stamp, data) for stamp in stamps],
            "schemas": {"/joint_states": (JOINT_STATE, encoding, text.encode())},
        }

    gripper = joint_state(0, ["grip"], [1.0], (), [1.0]).done()
    four, two = ("a", "b", "c", "d"), (0.1, 0.2)
    files: dict[str, tuple[dict[str, Any], str]] = {
        "no-joints": (
            {"messages": [("/grip", stamp, gripper) for stamp in stamps]},
            "no topic holds",
        ),
        "no-messages": ({"messages": []}, "."),
        "no-effort": ({"messages": states(position=two)}, "."),
        "four-joints": (
            {"messages": states(names=four, position=two * 2, effort=two * 2)},
            "joints",
        ),
        "short-lists": ({"messages": states(position=two, effort=(1.0,))}, "."),
        "nan": ({"messages": states(position=(np.nan, 0.1), effort=two)}, "."),
        "two-topics": (
            {
                "messages": [
                    (topic, stamp, data)
                    for _, stamp, data in states(position=two, effort=two)
                    for topic in ("/left", "/right")
                ]
            },
            "choose with topic|Topic|topic",
        ),
        "no-definition": (of(""), "."),
        "bad-definition": (of("float64[ nonsense\n"), "."),
        "deep-definition": (of("sensor_msgs/JointState inner\n"), "."),
        "bad-idl": (of("module {", "ros2idl"), "."),
        "unknown-schema": (of("x", "omgidl"), "."),
        "bad-cdr": (
            {
                "messages": [
                    ("/joint_states", stamp, b"\0\1\0\0\xff\xff\xff\xff") for stamp in stamps
                ]
            },
            ".",
        ),
        "short-cdr": ({"messages": [("/joint_states", stamp, b"\0") for stamp in stamps]}, "."),
        "bad-json": (of("{}", "jsonschema", b"{nothing") | {"encoding": "json"}, "."),
        "bad-protobuf": (
            of("no descriptors", "protobuf", b"\xff" * 9) | {"encoding": "protobuf"},
            ".",
        ),
        "unknown-encoding": (of("x", "x") | {"encoding": "flatbuffer"}, "."),
    }
    for name, (options, _) in files.items():
        write_mcap(folder / f"{name}.mcap", **options)
    return {name: words for name, (_, words) in files.items()}


def _cut_short(folder: Path, log: Log) -> dict[str, str]:
    """Logs of which the start alone is left, or whose middle is zeros."""
    said: dict[str, str] = {}
    for kind in ("mcap", "parquet", "csv"):
        write_log(folder / f"whole.{kind}", log)
        content = (folder / f"whole.{kind}").read_bytes()
        for path in folder.glob("whole.*"):
            path.unlink()
        (folder / f"start-of-{kind}.{kind}").write_bytes(content[:200])
        (folder / f"hole-in-{kind}.{kind}").write_bytes(
            content[:100] + bytes(len(content) - 200) + content[-100:]
        )
        said |= {f"start-of-{kind}": ".", f"hole-in-{kind}": "."}
    return said


def _folders(folder: Path, _log: Log) -> dict[str, str]:
    bags = {
        "bag-not-yaml": "{",
        "bag-without-files": "rosbag2_bagfile_information:\n  relative_file_paths:\n    - "
        "absent.mcap\n",
        "bag-of-nothing": "",
    }
    for name, text in bags.items():
        (folder / name).mkdir()
        (folder / name / "metadata.yaml").write_text(text)
    return dict.fromkeys(bags, ".")


def _renamed(folder: Path, said: dict[str, str]) -> dict[str, str]:
    """Give each file a stem of its own."""
    jobs = {}
    for name, words in said.items():
        stem, _, suffix = name.partition(".")
        unique = f"{stem}-{suffix.replace('.', '-')}"
        (folder / name).rename(folder / f"{unique}.{suffix}")
        jobs[unique] = words
    return jobs
