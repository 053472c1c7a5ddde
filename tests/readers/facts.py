"""What a log can state, each fact as columns, as joint states or as a file of its own.

`Fact.says_other` marks those of which reading on without a word is wrong, whatever the values.
"""

from __future__ import annotations

import bz2
import datetime
import gzip
import io
import json
import lzma
import shutil
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.feather as feather
import pyarrow.parquet as parquet
import scipy.io
import zstandard
from numpy.typing import NDArray

import algid
from algid.arm import FloatArray
from algid.base.ros2 import JOINT_STATE_DEFINITION
from algid.base.units import TORQUE
from tests.readers.ways import (
    EPOCH,
    FLAT,
    LISTS,
    MESSAGES,
    CannotSayError,
    Flat,
    Message,
    States,
    Zoned,
    arrow_table,
    csv_text,
    json_mcap,
    written,
)

ONE, OTHER = (
    algid.synthesise(
        case,
        duration=3.0,
        rate=200,
        torque="wide",
        position_noise=2e-4,
        torque_noise=1e-2,
        seed=seed,
    )[0]
    for case, seed in (("case1", 3), ("case2", 4))
)
N = len(ONE)
ROWS = range(N)
HALF = N // 2
FIRST_HALF = np.arange(N) < HALF
NS = np.arange(N) * 5_000_000
T, TH, TA = NS * 1e-9, ONE.theta, ONE.tau
OM = np.gradient(TH, T, axis=1)
DEG = np.degrees(TH)
LBF_IN = TORQUE["lbf in"]
I10 = np.rint(TA * 100).astype(np.int16)
MRAD, MNM = np.rint(TH * 1e3), np.rint(TA * 1e3)
BAD = np.zeros(N, bool)
BAD[[50, 51, 52, 300, 301, 450]] = True
FOURTH = np.arange(N) % 4 == 0


@dataclass(frozen=True, eq=False)
class Fact:
    """One fact, what writes it, and what a reader should make of it.

    `file` writes it in one way by itself; `ways` are those in which the columns are tried. What is
    expected: the samples of `truth`, or only those of `keep`.
    """

    label: str
    flat: Callable[[], Flat | dict[str, Any]] | None = None
    states: Callable[[], States | list[Message]] | None = None
    file: Callable[[str, Path], Any] | None = None
    ways: tuple[str, ...] = (*FLAT, "json")
    options: Mapping[str, Any] = field(default_factory=dict)
    truth: tuple[FloatArray, FloatArray, FloatArray] = (T, TH, TA)
    keep: NDArray[np.bool_] | None = None
    omega: FloatArray | None = None
    within: float = 1e-9
    says_other: bool = False
    fits: Callable[[algid.Log], bool] = lambda _: True

    def given(self, way: str, folder: Path) -> Any:
        """The log in one way; raises `CannotSayError` where it has no place for the fact."""
        if self.file is not None:
            return self.file(way, folder)
        log = self._states if way in LISTS + MESSAGES and self._states else self._columns
        if log is None or (isinstance(log, Flat) and way not in self.ways):
            raise CannotSayError
        return written(way, folder, log)

    @cached_property
    def _columns(self) -> Flat | None:
        flat = self.flat and self.flat()
        return Flat(flat) if isinstance(flat, dict) else flat or None

    @cached_property
    def _states(self) -> States | None:
        states = self.states and self.states()
        return States(states) if isinstance(states, list) else states or None


def base(**columns: Any) -> dict[str, Any]:
    """The log's columns, some of them others, and some more."""
    return {"time": T, "q1": TH[0], "q2": TH[1], "tau1": TA[0], "tau2": TA[1]} | columns


def renamed(columns: dict[str, Any], **names: str) -> dict[str, Any]:
    return {names.get(name, name): values for name, values in columns.items()}


def message(row: int, **changes: Any) -> Message:
    """A row as a joint state; a stamp is that of the recorder too, where nothing else is said."""
    stamp = changes.pop("stamp", EPOCH + int(NS[row]))
    values = {"position": TH[:, row], "effort": TA[:, row], "log_stamp": stamp} | changes
    for name in ("position", "effort", "velocity"):
        if name in values:
            values[name] = tuple(float(value) for value in values[name])
    return Message(stamp=stamp, **values)


def messages(changed: Callable[[int], Mapping[str, Any]] = lambda _: {}) -> list[Message]:
    """Every row as a message, with what `changed` says of it."""
    return [message(row, **changed(row)) for row in ROWS]


def units(columns: dict[str, Any], *names: str) -> Flat:
    """Columns whose units stand beside them: attributes, or a row of units."""
    return Flat(columns, {key: {"units": unit} for key, unit in zip(columns, names, strict=True)})


def defined(position: str, effort: str, sent: list[Message]) -> States:
    """Messages whose definition has comments behind two fields."""
    text = JOINT_STATE_DEFINITION.replace("float64[] position", f"float64[] position{position}")
    return States(sent, text.replace("float64[] effort", f"float64[] effort{effort}"))


def spoiled(values: Any, rows: Any, value: Any, dtype: Any = float) -> Any:
    changed = values.astype(dtype)
    changed[rows] = value
    return changed


def missing(value: Any, dtype: Any = float) -> dict[str, Any]:
    return base(tau1=spoiled(TA[0], BAD, value, dtype), q2=spoiled(TH[1], BAD, value, dtype))


def missing_in_messages(value: float) -> list[Message]:
    return messages(
        lambda row: (
            {"effort": (value, TA[1, row]), "position": (TH[0, row], value)} if BAD[row] else {}
        )
    )


def in_mnm() -> dict[str, Any]:
    return base(tau1=TA[0] * 1e3, tau2=TA[1] * 1e3)


def in_degrees() -> dict[str, Any]:
    return base(q1=DEG[0], q2=DEG[1])


def effort(scale: float) -> list[Message]:
    return messages(lambda row: {"effort": scale * TA[:, row]})


def swapped(row: int) -> dict[str, Any]:
    return {"position": TH[::-1, row], "effort": TA[::-1, row], "name": ("j2", "j1")}


def other_arm(row: int) -> dict[str, Any]:
    return {"position": OTHER.theta[:, row], "effort": OTHER.tau[:, row]}


def two_arms() -> dict[str, Any]:
    """Another arm behind the first one, whose time starts again."""
    rest = N - HALF
    return {
        "time": np.r_[T[:HALF], T[:rest]],
        "q1": np.r_[TH[0][:HALF], OTHER.theta[0][:rest]],
        "q2": np.r_[TH[1][:HALF], OTHER.theta[1][:rest]],
        "tau1": np.r_[TA[0][:HALF], OTHER.tau[0][:rest]],
        "tau2": np.r_[TA[1][:HALF], OTHER.tau[1][:rest]],
    }


def interleaved() -> dict[str, Any]:
    even = np.arange(N) % 2 == 0
    others = {"q1": OTHER.theta[0], "q2": OTHER.theta[1], "tau1": OTHER.tau[0]}
    others["tau2"] = OTHER.tau[1]
    mixed = {name: np.where(even, base()[name], other) for name, other in others.items()}
    return {"time": T, "robot": np.where(even, "A", "B"), **mixed}


def typed(change: Callable[[Any], Any]) -> Callable[[], dict[str, Any]]:
    """The columns but for the time in another type."""
    return lambda: {name: v if name == "time" else change(v) for name, v in base().items()}


def all_typed(change: Callable[[Any], Any]) -> Callable[[], dict[str, Any]]:
    return lambda: {name: change(v) for name, v in base().items()}


def without_time() -> dict[str, Any]:
    return {name: v for name, v in base().items() if name != "time"}


THREE = ("waist", "shoulder", "elbow")
TH3, TA3 = np.vstack([0.3 * np.sin(T), TH]), np.vstack([np.sin(3 * T), TA])


def three() -> list[Message]:
    return messages(lambda row: {"position": TH3[:, row], "effort": TA3[:, row], "name": THREE})


def three_flat() -> dict[str, Any]:
    angles = {f"{name}_pos": TH3[place] for place, name in enumerate(THREE)}
    return {"time": T, **angles, **{f"{name}_effort": TA3[k] for k, name in enumerate(THREE)}}


def _text_ways(way: str) -> str:
    """The separator of a way that is text."""
    if way not in ("csv", "tsv"):
        raise CannotSayError
    return "," if way == "csv" else "\t"


def _saved(way: str, folder: Path, text: str) -> Path:
    path = folder / f"log.{way}"
    path.write_text(text)
    return path


def header_again(way: str, folder: Path) -> Path:
    separator = _text_ways(way)
    other = {"time": T, "q2": TH[1], "q1": TH[0], "tau2": TA[1], "tau1": TA[0]}
    begin = csv_text(Flat(base()), separator).splitlines()[: HALF + 1]
    rest = csv_text(Flat({name: v[HALF:] for name, v in other.items()}), separator)
    return _saved(way, folder, "\n".join(begin) + "\n" + rest)


def comment_midway(way: str, folder: Path) -> Path:
    mixed = base(
        **{n: np.where(FIRST_HALF, v, 1e3 * v) for n, v in zip(("tau1", "tau2"), TA, strict=True)}
    )
    lines = csv_text(Flat(mixed), _text_ways(way)).splitlines()
    lines.insert(HALF + 1, "# tau1, tau2 in mNm")
    return _saved(way, folder, "\n".join(lines) + "\n")


def comment_behind_header(way: str, folder: Path) -> Path:
    lines = csv_text(Flat(in_mnm()), _text_ways(way)).splitlines()
    lines.insert(1, "# tau1, tau2 in mNm")
    return _saved(way, folder, "\n".join(lines) + "\n")


def decimal_comma(way: str, folder: Path) -> Path:
    separator = ";" if _text_ways(way) == "," else "\t"
    return _saved(way, folder, csv_text(Flat(base()), separator).replace(".", ","))


def named_matrix(way: str, folder: Path) -> Any:
    """Matrices of elbow and shoulder, beside whose names."""
    q, tau, names = TH[::-1].T.copy(), TA[::-1].T.copy(), ["elbow", "shoulder"]
    content: dict[str, Any] = {"time": T, "q": q, "tau": tau}
    path = folder / f"log.{way}"
    rows = {"time": T, "joint_names": [names] * N, "q": q.tolist(), "tau": tau.tolist()}
    match way:
        case "h5":
            with h5py.File(path, "w") as file:
                for name, values in content.items():
                    file[name] = values
                file["q"].attrs["names"] = names
                file.attrs["joint_names"] = names
                file["joint_names"] = np.array(names, "S")
        case "parquet" | "feather":
            stated = {"joint_names": json.dumps(names)}
            table = pa.table({"time": T, "q": list(q), "tau": list(tau)})
            fields = [one.with_metadata({"names": json.dumps(names)}) for one in table.schema]
            _write_table(way, table.cast(pa.schema(fields, metadata=stated)), path)
        case "npz" | "mat" | "dict":
            said = np.array(names, object if way == "mat" else None)
            return _arrays(way, folder, {**content, "joint_names": said})
        case "pandas":
            return pd.DataFrame(rows)
        case "polars":
            return pl.DataFrame(rows)
        case "jsonl":
            lines = [json.dumps(dict(zip(rows, row, strict=True))) for row in _by_row(rows)]
            path.write_text("\n".join(lines) + "\n")
        case "json":
            objects = [dict(zip(list(rows)[1:], row[1:], strict=True)) for row in _by_row(rows)]
            return _objects(folder, objects)
        case _:
            raise CannotSayError
    return path


def _by_row(columns: Mapping[str, Any]) -> Any:
    return zip(*(list(values) for values in columns.values()), strict=True)


def _objects(folder: Path, objects: list[dict[str, Any]], schema: Any = None) -> Path:
    rows = [(int(NS[row]), json.dumps(one).encode()) for row, one in enumerate(objects)]
    return json_mcap(folder, rows, json.dumps(schema or {"type": "object"}).encode())


def _write_table(way: str, table: pa.Table, path: Path) -> None:
    (parquet.write_table if way == "parquet" else feather.write_feather)(table, path)


def json_schema_unit(way: str, folder: Path) -> Path:
    if way != "json":
        raise CannotSayError
    torque = {"type": "number", "unit": "mNm", "description": "torque [mNm]"}
    kinds = {name: torque if name[:3] == "tau" else {"type": "number"} for name in base()}
    columns = {name: v.tolist() for name, v in in_mnm().items() if name != "time"}
    objects = [dict(zip(columns, row, strict=True)) for row in _by_row(columns)]
    return _objects(folder, objects, {"type": "object", "properties": kinds})


def indexed(index: Callable[[], Any]) -> Callable[[str, Path], Any]:
    """A frame of pandas whose index is the time, or what such a frame is saved as."""

    def frame_in(way: str, folder: Path) -> Any:
        frame = pd.DataFrame(without_time(), index=index())
        path = folder / f"log.{way}"
        if way == "pandas":
            return frame
        if way == "csv":
            frame.to_csv(path)
        elif way in ("parquet", "feather"):
            _write_table(way, pa.Table.from_pandas(frame), path)
        else:
            raise CannotSayError
        return path

    return frame_in


def _arrays(way: str, folder: Path, content: dict[str, Any]) -> Any:
    """Arrays of any length, those named with a dot in groups."""
    path = folder / f"log.{way}"
    match way:
        case "h5":
            with h5py.File(path, "w") as file:
                for name, values in content.items():
                    file[name.replace(".", "/")] = values
        case "mat":
            structs: dict[str, Any] = {}
            for name, values in content.items():
                group, dot, own = name.partition(".")
                if dot:
                    structs.setdefault(group, {})[own] = values
                else:
                    structs[name] = values
            scipy.io.savemat(path, structs)
        case "npz":
            np.savez(path, **content)
        case "dict":
            return content
        case _:
            raise CannotSayError
    return path


def groups(way: str, folder: Path) -> Any:
    runs: dict[str, Any] = {}
    for k, log in enumerate((ONE, OTHER), start=1):
        own = {"time": T, "q": log.theta.T.copy(), "tau": log.tau.T.copy()}
        runs |= {f"run{k}.{name}": values for name, values in own.items()}
    return _arrays(way, folder, runs)


def own_stamps(way: str, folder: Path) -> Any:
    """Torques at a quarter of the rate, with a time of their own."""
    content = {"t": T, "q1": TH[0], "q2": TH[1], "t_tau": T[FOURTH]}
    content |= {"tau1": TA[0][FOURTH], "tau2": TA[1][FOURTH]}
    return _arrays(way, folder, content)


def effort_elsewhere() -> list[Message]:
    sent = []
    for row in ROWS:
        sent.append(message(row, effort=(), topic="/q"))
        if row < 0.7 * N:
            sent.append(message(row, position=(), topic="/tau"))
    return sent


def column_twice(way: str, folder: Path) -> Any:
    path = folder / f"log.{way}"
    match way:
        case "csv" | "tsv":
            separator = _text_ways(way)
            header, *rows = csv_text(Flat(base()), separator).splitlines()
            lines = [f"{header}{separator}tau1", *(f"{row}{separator}5" for row in rows)]
            return _saved(way, folder, "\n".join(lines) + "\n")
        case "jsonl" | "json":
            objects = [dict(zip(base(), map(float, row), strict=True)) for row in _by_row(base())]
            texts = [json.dumps(one)[:-1] + ', "tau1": 5.0}' for one in objects]
            if way == "json":
                return json_mcap(
                    folder, [(int(NS[k]), text.encode()) for k, text in enumerate(texts)]
                )
            path.write_text("\n".join(texts) + "\n")
        case "parquet" | "feather":
            table = arrow_table(Flat(base())).append_column("tau1", pa.array(np.full(N, 5.0)))
            if way == "parquet":
                parquet.write_table(table, path)
            else:
                with pa.OSFile(str(path), "wb") as out, pa.ipc.new_file(out, table.schema) as file:
                    file.write_table(table)
        case "pandas":
            frame = pd.DataFrame(base())
            frame.insert(5, "tau1", 5.0, allow_duplicates=True)
            return frame
        case _:
            raise CannotSayError
    return path


def encoded(
    encoding: str, ways: tuple[str, ...], columns: Callable[[], dict[str, Any]] = base
) -> Callable[[str, Path], Path]:
    def recoded(way: str, folder: Path) -> Path:
        if way not in ways:
            raise CannotSayError
        path: Path = written(way, folder, Flat(columns()))
        path.write_bytes(path.read_text().encode(encoding))
        return path

    return recoded


def packed(suffix: str, pack: Callable[[bytes], bytes]) -> Callable[[str, Path], Path]:
    def packed_file(way: str, folder: Path) -> Path:
        if way not in ("csv", "tsv", "jsonl", "parquet", "npz", "h5", "cdr", "bag1"):
            raise CannotSayError
        path: Path = written(way, folder, Flat(base()) if way in FLAT else States(messages()))
        other = path.with_name(path.name + suffix)
        other.write_bytes(pack(path.read_bytes()))
        return other

    return packed_file


def zipped(content: bytes) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        archive.writestr("log", content)
    return out.getvalue()


PACKED: dict[str, Callable[[bytes], bytes]] = {
    ".gz": gzip.compress,
    ".zst": zstandard.compress,
    ".xz": lzma.compress,
    ".bz2": bz2.compress,
    ".zip": zipped,
}


def two_logs(way: str, folder: Path) -> Path:
    """A folder of independent logs of two arms."""
    if way not in ("csv", "parquet", "feather", "h5", "npz", *MESSAGES):
        raise CannotSayError
    both = folder / "both"
    both.mkdir()
    for place, (log, name) in enumerate(((ONE, "mon"), (OTHER, "tue"))):
        own = folder / name
        own.mkdir()
        columns = base(q1=log.theta[0], q2=log.theta[1], tau1=log.tau[0], tau2=log.tau[1])
        sent = []
        for row in ROWS:
            stamp = EPOCH + int(NS[row]) + place * 10**11
            sent.append(
                message(row, position=log.theta[:, row], effort=log.tau[:, row], stamp=stamp)
            )
        path: Path = written(way, own, Flat(columns) if way in FLAT else States(sent))
        if path.is_dir():
            path = next(path.glob("*.db3"))
        shutil.copy(path, both / f"{name}{path.suffix}")
    return both


def with_truth(change: bool) -> Callable[[str, Path], Path]:
    """A log that algid wrote with its truth; a value may be changed behind it."""

    def of_algid(way: str, folder: Path) -> Path:
        if way not in ("csv", "parquet") and (change or way != "cdr"):
            raise CannotSayError
        path = folder / f"log.{'mcap' if way == 'cdr' else way}"
        algid.write_log(path, ONE, truth=ONE.origin.truth)
        if change and way == "csv":
            lines = path.read_text().splitlines()
            cells = lines[9].split(",")
            lines[9] = ",".join([*cells[:3], "0.5", *cells[4:]])
            path.write_text("\n".join(lines) + "\n")
        elif change:
            table, kept = parquet.read_table(path), parquet.read_metadata(path).metadata
            values = table["tau1"].to_numpy().copy()
            values[9] = 0.5
            place = table.schema.get_field_index("tau1")
            table = table.set_column(place, table.schema.field("tau1"), pa.array(values))
            said = {key: value for key, value in kept.items() if key != b"ARROW:schema"}
            parquet.write_table(table.replace_schema_metadata(said), path)
        return path

    return of_algid


def cut_short() -> dict[str, Any]:
    """30 rows are missing in the middle, and the time goes on."""
    cut = {name: np.r_[v[:HALF], v[HALF + 30 :]] for name, v in base().items()}
    return cut | {"time": T[: N - 30], "episode_index": (np.arange(N - 30) >= HALF).astype(int)}


def lerobot() -> dict[str, Any]:
    return {
        "observation.state": TH.T.tolist(),
        "observation.effort": TA.T.tolist(),
        "timestamp": np.r_[T[:HALF], T[: N - HALF]].astype(np.float32),
        "episode_index": (~FIRST_HALF).astype(int),
        "frame_index": np.r_[np.arange(HALF), np.arange(N - HALF)],
    }


def zone_changes() -> dict[str, Any]:
    texts = []
    for row in ROWS:
        start = datetime.datetime(2026, 3, 4, 10 + (row >= HALF))
        stamp = start + datetime.timedelta(microseconds=int(NS[row]) // 1000)
        zone = "+01:00" if row >= HALF else "+00:00"
        texts.append(stamp.isoformat(timespec="milliseconds") + zone)
    return base(time=np.array(texts))


def masked() -> dict[str, Any]:
    columns = missing(-5.0)
    for name in ("tau1", "q2"):
        columns[name] = np.ma.MaskedArray(columns[name], mask=BAD)
    return columns


_LATE = np.random.default_rng(1).integers(0, 3_000_000, N)
_WILD = {"tau1": spoiled(TA[0], BAD, 40.0), "q2": spoiled(TH[1], BAD, 0.0)}
_COMMENTED = ("csv", "tsv", "parquet", "feather", "h5", "mat", "npz", "pandas")
_TEXT = ("csv", "tsv")
_VELOCITY = {"velocity": "measured"}
_SCALED = {"scale_factor": "0.001", "add_offset": "0.5"}
_TEN = {"scale_factor": "0.01", "units": "N m"}
_BY_ATTRIBUTE = "s", "rad", "rad"


def _quarter(value: Any, dtype: Any = float) -> dict[str, Any]:
    held = {n: spoiled(v, ~FOURTH, value, dtype) for n, v in zip(("tau1", "tau2"), TA, strict=True)}
    return base(**held)


def _clocks(name: str, values: Any) -> Callable[[], dict[str, Any]]:
    return lambda: renamed(base(time=values), time=name)


def _of_time(values: Any, unit: str) -> Callable[[], Flat]:
    return lambda: units(base(time=values), unit, "rad", "rad", "Nm", "Nm")


FACTS = (
    # joints
    Fact(
        "order of columns or names reversed throughout",
        lambda: {"time": T, "q2": TH[1], "q1": TH[0], "tau2": TA[1], "tau1": TA[0]},
        lambda: messages(swapped),
    ),
    Fact(
        "order of names changes midway",
        states=lambda: messages(lambda row: {} if row < HALF else swapped(row)),
        within=1e-8,
    ),
    Fact("header row again midway, other order", file=header_again),
    Fact(
        "named shoulder and elbow, elbow first",
        lambda: {
            "time": T,
            "elbow_pos": TH[1],
            "shoulder_pos": TH[0],
            "elbow_effort": TA[1],
            "shoulder_effort": TA[0],
        },
        lambda: messages(lambda row: {**swapped(row), "name": ("elbow", "shoulder")}),
    ),
    Fact("three joints, none chosen", three_flat, three, says_other=True),
    Fact(
        "three joints, joints=shoulder,elbow",
        three_flat,
        three,
        options={"joints": ("shoulder", "elbow")},
    ),
    Fact(
        "two joints, joints=j2,j1",
        states=messages,
        options={"joints": ("j2", "j1")},
        truth=(T, TH[::-1], TA[::-1]),
    ),
    Fact("matrices with their names stated (elbow, shoulder)", file=named_matrix),
    Fact(
        "every tenth message of one joint only",
        states=lambda: messages(
            lambda row: (
                {"position": TH[:1, row], "effort": TA[:1, row], "name": ("j1",)}
                if row % 10 == 5
                else {}
            )
        ),
        keep=np.arange(N) % 10 != 5,
        within=1e-8,
    ),
    Fact(
        "joints renamed midway (a,b then c,d)",
        states=lambda: messages(lambda row: {"name": ("a", "b") if row < HALF else ("c", "d")}),
        keep=FIRST_HALF,
        says_other=True,
    ),
    # units
    Fact("angle: q1 [deg]", lambda: renamed(in_degrees(), q1="q1 [deg]", q2="q2 [deg]")),
    Fact("angle: q1_deg", lambda: renamed(in_degrees(), q1="q1_deg", q2="q2_deg")),
    Fact("torque: tau1 [mNm]", lambda: renamed(in_mnm(), tau1="tau1 [mNm]", tau2="tau2 [mNm]")),
    Fact("torque: tau1_mnm", lambda: renamed(in_mnm(), tau1="tau1_mnm", tau2="tau2_mnm")),
    Fact(
        "angle deg: attribute, units row, comment of a definition",
        lambda: units(in_degrees(), "s", "deg", "deg", "Nm", "Nm"),
        lambda: defined(" # deg", "", messages(lambda row: {"position": DEG[:, row]})),
    ),
    Fact(
        "torque mNm: attribute, units row, comment of a definition",
        lambda: units(in_mnm(), *_BY_ATTRIBUTE, "mNm", "mNm"),
        lambda: defined("", "  # torque in mNm", effort(1e3)),
    ),
    Fact(
        "torque mNm: metadata units={tau1: mNm}",
        lambda: Flat(in_mnm(), metadata={"units": '{"tau1": "mNm", "tau2": "mNm"}'}),
        lambda: States(effort(1e3), metadata={"units": '{"effort": "mNm", "position": "rad"}'}),
    ),
    Fact(
        "torque mNm: comment or metadata 'tau1, tau2 in mNm'",
        lambda: Flat(in_mnm(), metadata={"note": "tau1, tau2 in mNm"}),
        ways=_COMMENTED,
    ),
    Fact("JSON schema says unit mNm", file=json_schema_unit),
    Fact(
        "torque unit foreign (percent) as attribute",
        lambda: units(base(tau1=TA[0] * 3, tau2=TA[1] * 3), *_BY_ATTRIBUTE, "percent", "percent"),
        says_other=True,
    ),
    Fact(
        "scale_factor 0.001, add_offset 0.5 as attribute",
        lambda: Flat(
            base(tau1=(TA[0] - 0.5) * 1e3, tau2=(TA[1] - 0.5) * 1e3),
            {"tau1": _SCALED, "tau2": _SCALED},
        ),
    ),
    Fact(
        "dq1 [deg/s] velocities",
        lambda: base(**{f"dq{k + 1} [deg/s]": np.degrees(OM[k]) for k in (0, 1)}),
        ways=tuple(way for way in (*FLAT, "json") if way != "h5"),
        omega=OM,
        options=_VELOCITY,
    ),
    Fact(
        "velocities deg/s as attribute",
        lambda: units(
            base(dq1=np.degrees(OM[0]), dq2=np.degrees(OM[1])),
            *_BY_ATTRIBUTE,
            "Nm",
            "Nm",
            "deg/s",
            "deg/s",
        ),
        omega=OM,
        options=_VELOCITY,
    ),
    Fact(
        "velocities recorded",
        lambda: base(dq1=OM[0], dq2=OM[1]),
        lambda: messages(lambda row: {"velocity": OM[:, row]}),
        omega=OM,
        within=1e-8,
    ),
    Fact(
        "torque lbf in: attribute, units row, comment of a definition",
        lambda: units(
            base(tau1=TA[0] / LBF_IN, tau2=TA[1] / LBF_IN), *_BY_ATTRIBUTE, "lbf in", "lbf in"
        ),
        lambda: defined("", "  # lbf in", effort(1 / LBF_IN)),
    ),
    Fact(
        "scale_factor 0.01 of int16 as attribute",
        lambda: Flat(base(tau1=I10[0], tau2=I10[1]), {"tau1": _TEN, "tau2": _TEN}),
        truth=(T, TH, I10 * 0.01),
    ),
    Fact(
        "comment '# tau1, tau2 in mNm' above the header",
        lambda: Flat(in_mnm(), metadata={"tau1, tau2 in mNm": ""}),
        ways=_TEXT,
    ),
    Fact(
        "comment '# effort is logged in mNm'",
        lambda: Flat(in_mnm(), metadata={"effort is logged in mNm": ""}),
        ways=_TEXT,
    ),
    Fact(
        "constant column torque_unit='mNm' in each row",
        lambda: {**in_mnm(), "torque_unit": np.full(N, "mNm")},
    ),
    # time
    Fact("time_ms, integers", _clocks("time_ms", NS // 10**6)),
    Fact("time [us], float", _clocks("time [us]", NS / 1e3)),
    Fact("time in ms by attribute or units row", _of_time(NS / 1e6, "ms")),
    Fact(
        "time in ms at 10 kHz by attribute or units row",
        _of_time(NS * 2e-8, "ms"),
        truth=(NS * 2e-11, TH, TA),
    ),
    Fact("time in ms, integers, no word", _clocks("time", NS // 10**6)),
    Fact("time in us uint64, no word", _clocks("time", (NS // 1000).astype(np.uint64))),
    Fact(
        "t canonical names, ms integers, no word",
        lambda: renamed(base(time=NS // 10**6), time="t", q1="theta1", q2="theta2"),
    ),
    Fact("epoch ns integers in 'time'", _clocks("time", EPOCH + NS)),
    Fact("epoch ns uint64 in 'time'", _clocks("time", (EPOCH + NS).astype(np.uint64))),
    Fact(
        "epoch ns integers in 't', canonical names",
        lambda: renamed(base(time=EPOCH + NS), time="t", q1="theta1", q2="theta2"),
    ),
    Fact("epoch s float in 'time'", _clocks("time", (EPOCH + NS) * 1e-9)),
    Fact("datetime64 or ISO text", _clocks("time", (EPOCH + NS).astype("datetime64[ns]"))),
    Fact("datetime with zone", lambda: base(time=Zoned(EPOCH + NS))),
    Fact("duration (timedelta64)", _clocks("time", NS.astype("timedelta64[ns]"))),
    Fact("duration (timedelta64[ms])", _clocks("time", (NS // 10**6).astype("timedelta64[ms]"))),
    Fact("text hh:mm:ss.fff", lambda: base(time=np.array([f"10:00:{one:06.3f}" for one in T]))),
    Fact(
        "ISO text, zone changes midway, same instants",
        zone_changes,
        ways=("csv", "tsv", "jsonl", "parquet", "pandas", "polars"),
    ),
    Fact(
        "CF: units='milliseconds since 2026-01-01'",
        _of_time(NS / 1e6, "milliseconds since 2026-01-01"),
    ),
    Fact(
        "index of dates, unnamed",
        file=indexed(lambda: pd.DatetimeIndex((EPOCH + NS).astype("datetime64[ns]"))),
    ),
    Fact(
        "index of durations, named 'time'",
        file=indexed(lambda: pd.TimedeltaIndex(NS.astype("timedelta64[ns]"), name="time")),
    ),
    Fact("index of float seconds, unnamed", file=indexed(lambda: T)),
    Fact(
        "no time; metadata say fs=200",
        lambda: Flat(without_time(), metadata={"fs": "200", "sampling_rate": "200 Hz"}),
    ),
    Fact(
        "metadata say fs=100 against stamps",
        lambda: Flat(base(), metadata={"fs": "100", "sampling_rate": "100 Hz"}),
        says_other=True,
    ),
    Fact("a stamp NaN", lambda: base(time=spoiled(T, BAD, np.nan)), keep=~BAD),
    Fact("a stamp infinite", lambda: base(time=spoiled(T, BAD, np.inf)), keep=~BAD),
    Fact("a stamp null", lambda: base(time=spoiled(T, BAD, None, object)), keep=~BAD),
    Fact(
        "log stamps late and jittered, header right",
        states=lambda: messages(
            lambda row: {"log_stamp": EPOCH + int(NS[row] + 20_000_000 + _LATE[row])}
        ),
        within=1e-8,
    ),
    Fact(
        "header stamps all zero, log stamps right",
        states=lambda: messages(lambda row: {"stamp": 0, "log_stamp": EPOCH + int(NS[row])}),
        within=1e-8,
    ),
    Fact(
        "header stamp steps 5 s back midway (clock set)",
        states=lambda: messages(
            lambda row: {
                "stamp": EPOCH + int(NS[row]) - (5_000_000_000 if row >= HALF else 0),
                "log_stamp": EPOCH + int(NS[row]),
            }
        ),
        says_other=True,
    ),
    # missing values
    Fact("null cells", lambda: missing(None, object), keep=~BAD),
    Fact("NaN", lambda: missing(np.nan), lambda: missing_in_messages(np.nan), keep=~BAD),
    Fact(
        "NaN, accept=NOT_FINITE",
        lambda: missing(np.nan),
        lambda: missing_in_messages(np.nan),
        keep=~BAD,
        options={"accept": ["NOT_FINITE"]},
    ),
    Fact("masked (np.ma, NA, null under a mask)", masked, keep=~BAD),
    Fact(
        "sentinel -9999", lambda: missing(-9999.0), lambda: missing_in_messages(-9999.0), keep=~BAD
    ),
    Fact("sentinel 1e30", lambda: missing(1e30), lambda: missing_in_messages(1e30), keep=~BAD),
    Fact(
        "sentinel 0 in torque alone",
        lambda: base(tau1=spoiled(TA[0], BAD, 0), tau2=spoiled(TA[1], BAD, 0)),
        lambda: messages(lambda row: {"effort": (0, 0)} if BAD[row] else {}),
        keep=~BAD,
    ),
    Fact(
        "sentinel stated: _FillValue, missing_value of the file",
        lambda: Flat(missing(-9999.0), metadata={"_FillValue": "-9999", "missing_value": "-9999"}),
        ways=("h5", "parquet", "feather", "csv", "npz", "pandas"),
        keep=~BAD,
    ),
    Fact(
        "sentinel stated: _FillValue of the column",
        lambda: Flat(missing(-9999.0), {name: {"_FillValue": "-9999"} for name in ("tau1", "q2")}),
        ways=("h5", "parquet", "feather"),
        keep=~BAD,
    ),
    Fact(
        "cells N/A",
        lambda: missing("N/A", object),
        ways=("csv", "tsv", "jsonl", "pandas"),
        keep=~BAD,
    ),
    Fact(
        "effort empty in some messages",
        states=lambda: messages(lambda row: {"effort": ()} if BAD[row] else {}),
        keep=~BAD,
        within=1e-8,
    ),
    # types of numbers
    Fact("float32", typed(lambda v: v.astype(np.float32)), within=1e-5),
    Fact("float16", typed(lambda v: v.astype(np.float16)), within=3e-2),
    Fact(
        "int16 in mrad and mNm",
        lambda: {
            "time": T,
            "q1_mrad": MRAD[0].astype(np.int16),
            "q2_mrad": MRAD[1].astype(np.int16),
            "tau1_mnm": MNM[0].astype(np.int16),
            "tau2_mnm": MNM[1].astype(np.int16),
        },
        truth=(T, MRAD * 1e-3, MNM * 1e-3),
    ),
    Fact(
        "big-endian float64",
        all_typed(lambda v: v.astype(">f8")),
        ways=("npz", "mat", "h5", "dict", "pandas", "arrays"),
    ),
    Fact(
        "decimal",
        all_typed(lambda v: np.array([Decimal(f"{one:.9f}") for one in v], object)),
        ways=("parquet", "feather", "pandas", "polars", "dict", "arrays"),
        within=1e-8,
    ),
    Fact(
        "object of floats",
        all_typed(lambda v: v.astype(object)),
        ways=("pandas", "polars", "dict", "arrays", "parquet"),
    ),
    Fact("list of floats", all_typed(lambda v: v.tolist()), ways=("dict",)),
    Fact(
        "text numbers",
        all_typed(lambda v: np.array([repr(float(one)) for one in v])),
        ways=("jsonl", "parquet", "feather", "npz", "h5", "dict", "pandas", "polars", "json"),
        within=1e-8,
    ),
    Fact("decimal comma", file=decimal_comma),
    Fact("torque is boolean", lambda: base(tau1=TA[0] > 0, tau2=TA[1] > 0), says_other=True),
    Fact(
        "complex",
        lambda: base(tau1=TA[0] + 1j, tau2=TA[1] + 1j),
        ways=("npz", "mat", "h5", "dict", "pandas", "arrays"),
        says_other=True,
    ),
    # quality, runs, robots
    Fact("valid=false on wild rows (bool)", lambda: base(**_WILD, valid=~BAD), keep=~BAD),
    Fact("valid=0 on wild rows (int)", lambda: base(**_WILD, valid=(~BAD).astype(int)), keep=~BAD),
    Fact(
        "error_code != 0 on wild rows",
        lambda: base(**_WILD, error_code=np.where(BAD, 17, 0)),
        keep=~BAD,
    ),
    Fact(
        "runs of two arms, time restarts",
        two_arms,
        lambda: messages(
            lambda row: (
                {} if row < HALF else {**other_arm(row), "stamp": EPOCH + int(NS[row - HALF])}
            )
        ),
        says_other=True,
    ),
    Fact(
        "the same with a column robot=A,B",
        lambda: {**two_arms(), "robot": np.where(FIRST_HALF, "A", "B")},
        says_other=True,
    ),
    Fact(
        "episode_index 0,1; time goes on, arms differ",
        lambda: {**two_arms(), "time": T, "episode_index": np.where(FIRST_HALF, 0, 1)},
        says_other=True,
    ),
    Fact("episode_index 0,1; time goes on, pose jumps", cut_short, says_other=True),
    Fact(
        "LeRobot columns, two episodes, stamps restart",
        lerobot,
        ways=("parquet", "feather", "pandas", "polars", "jsonl"),
        says_other=True,
    ),
    Fact("robot=A,B row by row, interleaved", interleaved, says_other=True),
    Fact(
        "frame_id A,B message by message, two arms",
        states=lambda: messages(
            lambda row: {"frame": "A"} if row % 2 == 0 else {**other_arm(row), "frame": "B"}
        ),
        says_other=True,
    ),
    Fact(
        "frame_id A then B, two arms, time goes on",
        states=lambda: messages(
            lambda row: {"frame": "A"} if row < HALF else {**other_arm(row), "frame": "B"}
        ),
        says_other=True,
    ),
    Fact(
        "metadata: robot=A of the file, two arms",
        lambda: Flat({**two_arms(), "time": T}, metadata={"robot": "A"}),
        ways=("csv",),
        says_other=True,
    ),
    Fact("groups or structs run1, run2 of two arms", file=groups, says_other=True),
    # meaning of the torque
    Fact(
        "only tau_cmd (commanded)",
        lambda: renamed(base(), tau1="tau_cmd1", tau2="tau_cmd2"),
        ways=tuple(FLAT),
        says_other=True,
    ),
    Fact(
        "only tau_ext (external)",
        lambda: renamed(base(), tau1="tau_ext1", tau2="tau_ext2"),
        ways=tuple(FLAT),
        says_other=True,
    ),
    Fact(
        "current1 [A], no constant",
        lambda: renamed(base(), tau1="current1 [A]", tau2="current2 [A]"),
        ways=tuple(FLAT),
        says_other=True,
    ),
    Fact(
        "unit A as attribute of tau1, comment of effort",
        lambda: units(base(tau1=2 * TA[0], tau2=2 * TA[1]), *_BY_ATTRIBUTE, "A", "A"),
        lambda: defined("", " # motor current [A]", effort(2)),
    ),
    Fact(
        "metadata: effort=gravity-compensated",
        lambda: Flat(base(), metadata={"effort": "gravity-compensated"}),
        lambda: States(messages(), metadata={"effort": "gravity-compensated"}),
        says_other=True,
    ),
    Fact(
        "metadata: zero=hanging, theta2 absolute",
        lambda: Flat(base(), metadata={"zero": "hanging", "second_angle": "absolute"}),
        lambda: States(messages(), metadata={"zero": "hanging", "second_angle": "absolute"}),
        says_other=True,
    ),
    Fact(
        "tau1, tau_cmd1 side by side (measured first)",
        lambda: base(tau_cmd1=TA[0] * 2, tau_cmd2=TA[1] * 2),
    ),
    Fact(
        "q_filt beside q_meas",
        lambda: {
            "time": T,
            "q_filt1": TH[0] * 0.9,
            "q_filt2": TH[1] * 0.9,
            "q_meas1": TH[0],
            "q_meas2": TH[1],
            "tau1": TA[0],
            "tau2": TA[1],
        },
    ),
    # rates within one log
    Fact(
        "torque at a quarter of the rate: null between",
        lambda: _quarter(None, object),
        keep=FOURTH,
    ),
    Fact("torque at a quarter of the rate: NaN between", lambda: _quarter(np.nan), keep=FOURTH),
    Fact(
        "torque at a quarter of the rate: held",
        lambda: base(
            tau1=TA[0][np.arange(N) // 4 * 4],
            tau2=TA[1][np.arange(N) // 4 * 4],
        ),
        lambda: messages(lambda row: {"effort": TA[:, row - row % 4]}),
        says_other=True,
    ),
    Fact("torque at a quarter of the rate: own stamps t_tau", file=own_stamps, within=0.2),
    Fact(
        "stamps of torque in a column t_tau, 50 ms late",
        lambda: base(time_tau=T + 0.05),
        ways=(*[way for way in FLAT if way != "arrays"], "json"),
        says_other=True,
    ),
    Fact(
        "effort on a topic of its own, ends early",
        states=effort_elsewhere,
        options={
            "topic": "/q",
            "tau1": {"topic": "/tau", "source": "effort[j1]"},
            "tau2": {"topic": "/tau", "source": "effort[j2]"},
            "theta1": {"source": "position[j1]"},
            "theta2": {"source": "position[j2]"},
        },
        says_other=True,
    ),
    Fact(
        "two topics of joint states, two arms",
        states=lambda: [
            one
            for row in ROWS
            for one in (
                message(row, topic="/a/joint_states"),
                message(row, **other_arm(row), topic="/b/joint_states"),
            )
        ],
        says_other=True,
    ),
    # text, names, packing
    Fact("a column's name twice (tau1, other values)", file=column_twice, says_other=True),
    Fact(
        "TAU1 beside tau1 (case)",
        lambda: base(TAU1=np.full(N, 5.0), TAU2=np.full(N, 6.0)),
        says_other=True,
    ),
    Fact("comment midway '# tau1, tau2 in mNm'", file=comment_midway, says_other=True),
    Fact("comment behind the header '# tau1, tau2 in mNm'", file=comment_behind_header),
    Fact("UTF-8 with BOM", file=encoded("utf-8-sig", ("csv", "tsv", "jsonl"))),
    Fact("UTF-16", file=encoded("utf-16", ("csv", "tsv", "jsonl"))),
    Fact("Latin-1, 't [µs]'", file=encoded("latin-1", _TEXT, _clocks("t [µs]", NS / 1e3))),
    *(
        Fact(f"packed {suffix}", file=packed(suffix, pack), within=1e-8)
        for suffix, pack in PACKED.items()
    ),
    Fact("folder of two independent logs, two arms", file=two_logs, says_other=True),
    Fact(
        "truth that algid wrote is known again",
        file=with_truth(False),
        fits=lambda log: log.origin.truth is not None,
    ),
    Fact("truth that algid wrote, a value changed", file=with_truth(True), says_other=True),
)


def of_messages(way: str, folder: Path) -> Any:
    if way not in MESSAGES:
        raise CannotSayError
    return written(way, folder, States(messages()))


def _caller(
    label: str,
    options: Mapping[str, Any],
    flat: Callable[[], dict[str, Any]] | None = base,
    states: Callable[[], list[Message]] | None = messages,
    **expected: Any,
) -> Fact:
    """What a caller states of a log of columns, of messages, or of both."""
    columns = tuple(way for way in FLAT if way != "arrays") if flat else ()
    return Fact(f"caller: {label}", flat, states, ways=columns, options=options, **expected)


CALLERS = (
    _caller("topic=/other, of columns", {"topic": "/other"}, states=None, says_other=True),
    _caller("topic=/other, of messages", {"topic": "/other"}, flat=None, says_other=True),
    _caller("clock=log, of columns", {"clock": "log"}, states=None, says_other=True),
    _caller("time=nosuch", {"time": "nosuch"}, says_other=True),
    _caller(
        "time_unit=ms over a bracket [s]",
        {"time_unit": "ms"},
        flat=lambda: renamed(base(), time="time [s]"),
        states=None,
        says_other=True,
    ),
    _caller(
        "time_unit=ms over dates",
        {"time_unit": "ms"},
        flat=_clocks("time", (EPOCH + NS).astype("datetime64[ns]")),
        states=None,
        says_other=True,
    ),
    Fact(  # a table takes the caller at his word
        "caller: time_unit=ms, of messages",
        file=of_messages,
        options={"time_unit": "ms"},
        says_other=True,
    ),
    _caller("rate=100 where there is a time of 200 Hz", {"rate": 100.0}, says_other=True),
    _caller(
        "columns=... where there is a header",
        {"columns": ["t", "theta1", "theta2", "tau1", "tau2"]},
        says_other=True,
    ),
    _caller(
        "torque unit mNm",
        {"tau1": {"unit": "mNm"}, "tau2": {"unit": "mNm"}},
        flat=in_mnm,
        states=lambda: effort(1e3),
        within=1e-8,
    ),
    _caller(
        "joints=2,1 of numbered",
        {"joints": ("2", "1")},
        states=None,
        truth=(T, TH[::-1], TA[::-1]),
    ),
    _caller("segment=2 of one run", {"segment": 2}, says_other=True),
    _caller("velocity=measured, none recorded", _VELOCITY, says_other=True),
    _caller("start=1, end=2", {"start": 1.0, "end": 2.0}, says_other=True),
    _caller("accept=[NO_SUCH_CODE]", {"accept": ["NO_SUCH_CODE"]}, says_other=True),
)
EVERY = (*FACTS, *CALLERS)
