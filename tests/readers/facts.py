"""What a log can state, each fact as columns, as joint states or as a file of its own.

`Fact.says_other` marks those of which reading on without a word is wrong, whatever the values.
"""

from __future__ import annotations

import bz2
import gzip
import io
import json
import lzma
import shutil
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as parquet
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
    store,
    store_table,
    units,
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
ROWS = np.arange(N)
HALF = N // 2
FIRST_HALF = ROWS < HALF
NS = ROWS * 5_000_000
T, TH, TA = NS * 1e-9, ONE.theta, ONE.tau
OM = np.gradient(TH, T, axis=1)
DEG = np.degrees(TH)
MNM = TA * 1e3
LBF_IN = TORQUE["lbf in"]
I10 = np.rint(TA * 100).astype(np.int16)
WHOLE_MRAD, WHOLE_MNM = np.rint(TH * 1e3), np.rint(MNM)
BAD = np.zeros(N, bool)
BAD[[50, 51, 52, 300, 301, 450]] = True
FOURTH = ROWS % 4 == 0
HELD = TA[:, ROWS // 4 * 4]
SWAPPED = {"position": TH[::-1], "effort": TA[::-1], "name": ("j2", "j1")}
OTHER_ARM = {"position": OTHER.theta, "effort": OTHER.tau}
Columns = dict[str, Any]
Written = Callable[[str, Path], Any]


@dataclass(frozen=True, eq=False)
class Fact:
    """One fact, what writes it, and what a reader should make of it.

    `file` writes it in one way by itself; `ways` are those in which the columns are tried. What is
    expected: the samples of `truth`, or only those of `keep`.
    """

    label: str
    flat: Flat | Columns | None = None
    states: States | list[Message] | None = None
    file: Written | None = None
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
        if way in LISTS + MESSAGES and self.states:
            sent = self.states
            return written(way, folder, States(sent) if isinstance(sent, list) else sent)
        if self.flat is None or way not in self.ways:
            raise CannotSayError
        flat = self.flat
        return written(way, folder, Flat(flat) if isinstance(flat, dict) else flat)


def pair(form: str, rows: Any) -> Columns:
    """Two columns, named by their joints."""
    return {form.format(joint): row for joint, row in enumerate(rows, start=1)}


def base(
    angle: str = "q{}", torque: str = "tau{}", q: Any = TH, tau: Any = TA, **columns: Any
) -> Columns:
    """The log's columns, some of them others or of another name, and some more."""
    return {"time": T, **pair(angle, q), **pair(torque, tau)} | columns


def clock(name: str, values: Any, angle: str = "q{}") -> Columns:
    """The log's columns behind another time."""
    columns = base(angle)
    del columns["time"]
    return {name: values, **columns}


def messages(where: Any = ROWS >= 0, **changes: Any) -> list[Message]:
    """Every row as a joint state, with `changes` where these are to be: arrays, taken by row, or
    what is the same in all.

    A stamp is that of the recorder too, where nothing else is said.
    """
    found = []
    for row in ROWS:
        own: Columns = {"position": TH, "effort": TA, "stamp": EPOCH + NS}
        own = {
            name: value[..., row] if isinstance(value, np.ndarray) else value
            for name, value in (own | changes if where[row] else own).items()
        }
        own = {"log_stamp": own["stamp"], **own}
        for name in ("stamp", "log_stamp"):
            own[name] = int(own[name])
        for name in {"position", "effort", "velocity"} & own.keys():
            own[name] = tuple(map(float, own[name]))
        found.append(Message(**own))
    return found


def either(first: Any, one: list[Message], other: list[Message]) -> list[Message]:
    return [a if of_one else b for of_one, a, b in zip(first, one, other, strict=True)]


def defined(sent: list[Message], position: str = "", effort: str = "") -> States:
    """Messages whose definition has comments behind two fields."""
    text = JOINT_STATE_DEFINITION.replace("float64[] position", f"float64[] position{position}")
    return States(sent, text.replace("float64[] effort", f"float64[] effort{effort}"))


def spoiled(values: Any, rows: Any, value: Any, dtype: Any = float) -> Any:
    changed = values.astype(dtype)
    changed[rows] = value
    return changed


def missing(value: Any, dtype: Any = float) -> Columns:
    return base(tau1=spoiled(TA[0], BAD, value, dtype), q2=spoiled(TH[1], BAD, value, dtype))


def missing_in_messages(value: float) -> list[Message]:
    _, *angles, one, other = missing(value).values()
    return messages(position=np.stack(angles), effort=np.stack([one, other]))


REST = slice(N - HALF)
TWO_ARMS = base(
    q=np.c_[TH[:, :HALF], OTHER.theta[:, REST]],
    tau=np.c_[TA[:, :HALF], OTHER.tau[:, REST]],
    time=np.r_[T[:HALF], T[REST]],
)
"""Another arm behind the first one, whose time starts again."""
EVEN = ROWS % 2 == 0
REVERSED = {name: base()[name] for name in ("time", "q2", "q1", "tau2", "tau1")}


def typed(change: Callable[[Any], Any], time: bool = True) -> Columns:
    """The columns in another type, their time too or not."""
    return {name: change(v) if time or name != "time" else v for name, v in base().items()}


THREE = ("waist", "shoulder", "elbow")
TH3, TA3 = np.vstack([0.3 * np.sin(T), TH]), np.vstack([np.sin(3 * T), TA])
THREE_FLAT = {
    "time": T,
    **{f"{name}_pos": values for name, values in zip(THREE, TH3, strict=True)},
    **{f"{name}_effort": values for name, values in zip(THREE, TA3, strict=True)},
}


def text_file(text: Callable[[str], str]) -> Written:
    """A table of text, made for a separator."""

    def of_text(way: str, folder: Path) -> Path:
        if way not in _TEXT:
            raise CannotSayError
        path = folder / f"log.{way}"
        path.write_text(text("," if way == "csv" else "\t"))
        return path

    return of_text


def header_again(separator: str) -> str:
    first = csv_text(Flat(base()), separator).splitlines()[: HALF + 1]
    rest = {name: values[HALF:] for name, values in REVERSED.items()}
    return "\n".join([*first, csv_text(Flat(rest), separator)])


def commented(place: int, tau: Any) -> Written:
    """A table with a comment in front of a line."""

    def text(separator: str) -> str:
        lines = csv_text(Flat(base(tau=tau)), separator).splitlines()
        return "\n".join([*lines[:place], "# tau1, tau2 in mNm", *lines[place:], ""])

    return text_file(text)


def decimal_comma(separator: str) -> str:
    return csv_text(Flat(base()), separator.replace(",", ";")).replace(".", ",")


def named_matrix(way: str, folder: Path) -> Any:
    """Matrices of elbow and shoulder, beside whose names."""
    q, tau, names = TH[::-1].T.copy(), TA[::-1].T.copy(), ["elbow", "shoulder"]
    matrices = {"time": T, "q": q, "tau": tau}
    lists = {"time": T, "q": q.tolist(), "tau": tau.tolist()}
    if way == "h5":
        path = store(folder / "log.h5", {**matrices, "joint_names": np.array(names, "S")})
        with h5py.File(path, "a") as file:
            file.attrs["joint_names"] = file["q"].attrs["names"] = names
        return path
    if way in ("parquet", "feather"):
        text = json.dumps(names)
        stated = {name: {"names": text} for name in ("q", "tau")}
        return written(way, folder, Flat(lists, stated, {"joint_names": text}))
    if way in ("npz", "mat", "dict"):
        said = np.array(names, object if way == "mat" else None)
        return _arrays(way, folder, {**matrices, "joint_names": said})
    if way in ("pandas", "polars", "jsonl", "json"):
        return written(way, folder, Flat({**lists, "joint_names": [names] * N}))
    raise CannotSayError


def _by_row(columns: Mapping[str, Any]) -> Any:
    return zip(*(list(values) for values in columns.values()), strict=True)


def json_schema_unit(way: str, folder: Path) -> Path:
    if way != "json":
        raise CannotSayError
    torque = {"type": "number", "unit": "mNm", "description": "torque [mNm]"}
    kinds = {name: torque if name[:3] == "tau" else {"type": "number"} for name in base()}
    columns = {name: v.tolist() for name, v in base(tau=MNM).items() if name != "time"}
    objects = [dict(zip(columns, row, strict=True)) for row in _by_row(columns)]
    schema = json.dumps({"type": "object", "properties": kinds}).encode()
    rows = zip(NS.tolist(), map(json.dumps, objects), strict=True)
    return json_mcap(folder, rows, ("arm", "jsonschema", schema))


def indexed(index: Any) -> Written:
    """A frame of pandas whose index is the time, or what such a frame is saved as."""

    def frame_in(way: str, folder: Path) -> Any:
        frame = pd.DataFrame(base(), index=index).drop(columns="time")
        path = folder / f"log.{way}"
        if way == "pandas":
            return frame
        if way == "csv":
            frame.to_csv(path)
        elif way in ("parquet", "feather"):
            store_table(path, pa.Table.from_pandas(frame))
        else:
            raise CannotSayError
        return path

    return frame_in


def _arrays(way: str, folder: Path, content: dict[str, Any]) -> Any:
    """Arrays of any length, those named with a dot in groups."""
    if way == "dict":
        return content
    if way not in ("h5", "mat", "npz"):
        raise CannotSayError
    return store(folder / f"log.{way}", content)


def groups(way: str, folder: Path) -> Any:
    runs: Columns = {}
    for run, log in (("run1", ONE), ("run2", OTHER)):
        runs |= {f"{run}.time": T, f"{run}.q": log.theta.T.copy(), f"{run}.tau": log.tau.T.copy()}
    return _arrays(way, folder, runs)


def own_stamps(way: str, folder: Path) -> Any:
    """Torques at a quarter of the rate, with a time of their own."""
    angles = {"t": T, **pair("q{}", TH)}
    return _arrays(way, folder, {**angles, "t_tau": T[FOURTH], **pair("tau{}", TA[:, FOURTH])})


def effort_elsewhere() -> list[Message]:
    """Torques on a topic of their own, which ends early."""
    both = zip(messages(effort=(), topic="/q"), messages(position=(), topic="/tau"), strict=True)
    found = list[Message]()
    for row, sent in enumerate(both):
        found += sent if row < 0.7 * N else sent[:1]
    return found


def column_twice(way: str, folder: Path) -> Any:
    """A torque whose name stands twice, the second time with other values."""
    path, columns = folder / f"log.{way}", base(tau_1=np.full(N, 5.0))
    if way == "pandas":
        return pd.DataFrame(columns).rename(columns={"tau_1": "tau1"})
    if way in ("parquet", "feather"):
        table = arrow_table(Flat(columns)).rename_columns([*base(), "tau1"])
        if way == "parquet":
            return store_table(path, table)
        with pa.OSFile(str(path), "wb") as out, pa.ipc.new_file(out, table.schema) as file:
            file.write_table(table)
        return path
    if way not in (*_TEXT, "jsonl", "json"):
        raise CannotSayError
    written("jsonl" if way == "json" else way, folder, Flat(columns))
    text = path.with_suffix(".jsonl" if way == "json" else path.suffix).read_text()
    text = text.replace("tau_1", "tau1")
    if way == "json":
        return json_mcap(folder, zip(NS.tolist(), text.splitlines(), strict=True))
    path.write_text(text)
    return path


def encoded(encoding: str, ways: tuple[str, ...], columns: Columns) -> Written:
    def recoded(way: str, folder: Path) -> Path:
        if way not in ways:
            raise CannotSayError
        path: Path = written(way, folder, Flat(columns))
        path.write_bytes(path.read_text().encode(encoding))
        return path

    return recoded


def packed(suffix: str, pack: Callable[[bytes], bytes]) -> Written:
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
        columns = base(q=log.theta, tau=log.tau)
        stamps = EPOCH + NS + place * 10**11
        sent = messages(position=log.theta, effort=log.tau, stamp=stamps)
        path: Path = written(way, own, Flat(columns) if way in FLAT else States(sent))
        if path.is_dir():
            path = next(path.glob("*.db3"))
        shutil.copy(path, both / f"{name}{path.suffix}")
    return both


def with_truth(change: bool) -> Written:
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


LEFT = N - 30
# 30 rows are missing in the middle, and the time goes on
CUT_SHORT = base(
    q=np.c_[TH[:, :HALF], TH[:, HALF + 30 :]],
    tau=np.c_[TA[:, :HALF], TA[:, HALF + 30 :]],
    time=T[:LEFT],
    episode_index=(ROWS[:LEFT] >= HALF).astype(int),
)
LEROBOT = {
    "observation.state": TH.T.tolist(),
    "observation.effort": TA.T.tolist(),
    "timestamp": TWO_ARMS["time"].astype(np.float32),
    "episode_index": (~FIRST_HALF).astype(int),
    "frame_index": np.r_[ROWS[:HALF], ROWS[REST]],
}


def zone_changes() -> Columns:
    hours = np.where(FIRST_HALF, 10, 11).astype("timedelta64[h]")
    stamps = np.datetime64("2026-03-04", "ms") + hours + (NS // 10**6).astype("timedelta64[ms]")
    zones = np.where(FIRST_HALF, "+00:00", "+01:00")
    return base(time=np.char.add(np.datetime_as_string(stamps), zones))


def masked() -> Columns:
    columns = missing(-5.0)
    hidden = {name: np.ma.MaskedArray(columns[name], mask=BAD) for name in ("tau1", "q2")}
    return columns | hidden


def quarter(value: Any, dtype: Any = float) -> Columns:
    return base(tau=[spoiled(row, ~FOURTH, value, dtype) for row in TA])


_LATE = np.random.default_rng(1).integers(0, 3_000_000, N)
_WILD = {"tau1": spoiled(TA[0], BAD, 40.0), "q2": spoiled(TH[1], BAD, 0.0)}
_TEXT = ("csv", "tsv")
_COMMENTED = (*_TEXT, "parquet", "feather", "h5", "mat", "npz", "pandas")
_VELOCITY = {"velocity": "measured"}
_SCALED = {"scale_factor": "0.001", "add_offset": "0.5"}
_TEN = {"scale_factor": "0.01", "units": "N m"}
_SENTINEL = {"_FillValue": "-9999"}
_PLAIN = "s,rad,rad,"
IN_MNM = base(tau=MNM)
IN_DEGREES = base(q=DEG)
DATES = (EPOCH + NS).astype("datetime64[ns]")
LABELS = np.where(FIRST_HALF, "A", "B")


FACTS = (
    # joints
    Fact("order of columns or names reversed throughout", REVERSED, messages(**SWAPPED)),
    Fact("order of names changes midway", states=messages(~FIRST_HALF, **SWAPPED), within=1e-8),
    Fact("header row again midway, other order", file=text_file(header_again)),
    Fact(
        "named shoulder and elbow, elbow first",
        {
            "time": T,
            "elbow_pos": TH[1],
            "shoulder_pos": TH[0],
            "elbow_effort": TA[1],
            "shoulder_effort": TA[0],
        },
        messages(**SWAPPED | {"name": ("elbow", "shoulder")}),
    ),
    Fact(
        "three joints, none chosen",
        THREE_FLAT,
        messages(position=TH3, effort=TA3, name=THREE),
        says_other=True,
    ),
    Fact(
        "three joints, joints=shoulder,elbow",
        THREE_FLAT,
        messages(position=TH3, effort=TA3, name=THREE),
        options={"joints": ("shoulder", "elbow")},
    ),
    Fact(
        "two joints, joints=j2,j1",
        states=messages(),
        options={"joints": ("j2", "j1")},
        truth=(T, TH[::-1], TA[::-1]),
    ),
    Fact("matrices with their names stated (elbow, shoulder)", file=named_matrix),
    Fact(
        "every tenth message of one joint only",
        states=messages(ROWS % 10 == 5, position=TH[:1], effort=TA[:1], name=("j1",)),
        keep=ROWS % 10 != 5,
        within=1e-8,
    ),
    Fact(
        "a torque more than names, from midway on",
        states=messages(~FIRST_HALF, effort=np.vstack([0.3 * np.ones(N), TA])),
        keep=FIRST_HALF,
        within=1e-8,
    ),
    Fact(
        "joints renamed midway (a,b then c,d)",
        states=either(FIRST_HALF, messages(name=("a", "b")), messages(name=("c", "d"))),
        keep=FIRST_HALF,
        says_other=True,
    ),
    # units
    Fact("angle: q1 [deg]", base("q{} [deg]", q=DEG)),
    Fact("angle: q1_deg", base("q{}_deg", q=DEG)),
    Fact("torque: tau1 [mNm]", base(torque="tau{} [mNm]", tau=MNM)),
    Fact("torque: tau1_mnm", base(torque="tau{}_mnm", tau=MNM)),
    Fact(
        "angle deg: attribute, units row, comment of a definition",
        units(IN_DEGREES, "s,deg,deg,Nm,Nm"),
        defined(messages(position=DEG), position=" # deg"),
    ),
    Fact(
        "torque mNm: attribute, units row, comment of a definition",
        units(IN_MNM, _PLAIN + "mNm,mNm"),
        defined(messages(effort=MNM), effort="  # torque in mNm"),
    ),
    Fact(
        "torque mNm: metadata units={tau1: mNm}",
        Flat(IN_MNM, metadata={"units": '{"tau1": "mNm", "tau2": "mNm"}'}),
        States(messages(effort=MNM), metadata={"units": '{"effort": "mNm", "position": "rad"}'}),
    ),
    Fact(
        "torque mNm: comment or metadata 'tau1, tau2 in mNm'",
        Flat(IN_MNM, metadata={"note": "tau1, tau2 in mNm"}),
        ways=_COMMENTED,
    ),
    Fact("JSON schema says unit mNm", file=json_schema_unit),
    Fact(
        "torque unit foreign (percent) as attribute",
        units(base(tau=TA * 3), _PLAIN + "percent,percent"),
        says_other=True,
    ),
    Fact(
        "scale_factor 0.001, add_offset 0.5 as attribute",
        Flat(base(tau=(TA - 0.5) * 1e3), {"tau1": _SCALED, "tau2": _SCALED}),
    ),
    Fact(
        "dq1 [deg/s] velocities",
        base(**pair("dq{} [deg/s]", np.degrees(OM))),
        ways=tuple(way for way in (*FLAT, "json") if way != "h5"),
        omega=OM,
        options=_VELOCITY,
    ),
    Fact(
        "velocities deg/s as attribute",
        units(base(**pair("dq{}", np.degrees(OM))), _PLAIN + "Nm,Nm,deg/s,deg/s"),
        omega=OM,
        options=_VELOCITY,
    ),
    Fact(
        "velocities recorded",
        base(**pair("dq{}", OM)),
        messages(velocity=OM),
        omega=OM,
        within=1e-8,
    ),
    Fact(
        "torque lbf in: attribute, units row, comment of a definition",
        units(base(tau=TA / LBF_IN), _PLAIN + "lbf in,lbf in"),
        defined(messages(effort=TA / LBF_IN), effort="  # lbf in"),
    ),
    Fact(
        "scale_factor 0.01 of int16 as attribute",
        Flat(base(tau=I10), {"tau1": _TEN, "tau2": _TEN}),
        truth=(T, TH, I10 * 0.01),
    ),
    Fact(
        "comment '# tau1, tau2 in mNm' above the header",
        Flat(IN_MNM, metadata={"tau1, tau2 in mNm": ""}),
        ways=_TEXT,
    ),
    Fact(
        "comment '# effort is logged in mNm'",
        Flat(IN_MNM, metadata={"effort is logged in mNm": ""}),
        ways=_TEXT,
    ),
    Fact(
        "constant column torque_unit='mNm' in each row",
        {**IN_MNM, "torque_unit": np.full(N, "mNm")},
    ),
    # time
    Fact("time_ms, integers", clock("time_ms", NS // 10**6)),
    Fact("time [us], float", clock("time [us]", NS / 1e3)),
    Fact(
        "time in ms by attribute or units row",
        units(base(time=NS / 1e6), "ms,rad,rad,Nm,Nm"),
    ),
    Fact(
        "time in ms at 10 kHz by attribute or units row",
        units(base(time=NS * 2e-8), "ms,rad,rad,Nm,Nm"),
        truth=(NS * 2e-11, TH, TA),
    ),
    Fact("time in ms, integers, no word", base(time=NS // 10**6)),
    Fact("time in us uint64, no word", base(time=(NS // 1000).astype(np.uint64))),
    Fact("t canonical names, ms integers, no word", clock("t", NS // 10**6, "theta{}")),
    Fact("epoch ns integers in 'time'", base(time=EPOCH + NS)),
    Fact("epoch ns uint64 in 'time'", base(time=(EPOCH + NS).astype(np.uint64))),
    Fact("epoch ns integers in 't', canonical names", clock("t", EPOCH + NS, "theta{}")),
    Fact("epoch s float in 'time'", base(time=(EPOCH + NS) * 1e-9)),
    Fact("datetime64 or ISO text", base(time=DATES)),
    Fact("datetime with zone", base(time=Zoned(EPOCH + NS))),
    Fact("duration (timedelta64)", base(time=NS.astype("timedelta64[ns]"))),
    Fact("duration (timedelta64[ms])", base(time=(NS // 10**6).astype("timedelta64[ms]"))),
    Fact("text hh:mm:ss.fff", base(time=np.array([f"10:00:{one:06.3f}" for one in T]))),
    Fact(
        "ISO text, zone changes midway, same instants",
        zone_changes(),
        ways=("csv", "tsv", "jsonl", "parquet", "pandas", "polars"),
    ),
    Fact(
        "CF: units='milliseconds since 2026-01-01'",
        units(base(time=NS / 1e6), "milliseconds since 2026-01-01,rad,rad,Nm,Nm"),
    ),
    Fact("index of dates, unnamed", file=indexed(pd.DatetimeIndex(DATES))),
    Fact(
        "index of durations, named 'time'",
        file=indexed(pd.TimedeltaIndex(NS.astype("timedelta64[ns]"), name="time")),
    ),
    Fact("index of float seconds, unnamed", file=indexed(T)),
    Fact(
        "no time; metadata say fs=200",
        Flat(
            {name: values for name, values in base().items() if name != "time"},
            metadata={"fs": "200", "sampling_rate": "200 Hz"},
        ),
    ),
    Fact(
        "metadata say fs=100 against stamps",
        Flat(base(), metadata={"fs": "100", "sampling_rate": "100 Hz"}),
        says_other=True,
    ),
    Fact("a stamp NaN", base(time=spoiled(T, BAD, np.nan)), keep=~BAD),
    Fact("a stamp infinite", base(time=spoiled(T, BAD, np.inf)), keep=~BAD),
    Fact("a stamp null", base(time=spoiled(T, BAD, None, object)), keep=~BAD),
    Fact(
        "log stamps late and jittered, header right",
        states=messages(log_stamp=EPOCH + NS + 20_000_000 + _LATE),
        within=1e-8,
    ),
    Fact(
        "header stamps all zero, log stamps right",
        states=messages(stamp=0, log_stamp=EPOCH + NS),
        within=1e-8,
    ),
    Fact(
        "header stamp steps 5 s back midway (clock set)",
        states=messages(
            stamp=EPOCH + NS - 5_000_000_000 * ~FIRST_HALF,
            log_stamp=EPOCH + NS,
        ),
        says_other=True,
    ),
    # missing values
    Fact("null cells", missing(None, object), keep=~BAD),
    Fact("NaN", missing(np.nan), missing_in_messages(np.nan), keep=~BAD),
    Fact(
        "NaN, accept=NOT_FINITE",
        missing(np.nan),
        missing_in_messages(np.nan),
        keep=~BAD,
        options={"accept": ["NOT_FINITE"]},
    ),
    Fact("masked (np.ma, NA, null under a mask)", masked(), keep=~BAD),
    Fact("sentinel -9999", missing(-9999.0), missing_in_messages(-9999.0), keep=~BAD),
    Fact("sentinel 1e30", missing(1e30), missing_in_messages(1e30), keep=~BAD),
    Fact(
        "sentinel 0 in torque alone",
        base(tau=spoiled(TA, np.s_[:, BAD], 0)),
        messages(BAD, effort=(0, 0)),
        keep=~BAD,
    ),
    Fact(
        "sentinel stated: _FillValue, missing_value of the file",
        Flat(missing(-9999.0), metadata={**_SENTINEL, "missing_value": "-9999"}),
        ways=("h5", "parquet", "feather", "csv", "npz", "pandas"),
        keep=~BAD,
    ),
    Fact(
        "sentinel stated: _FillValue of the column",
        Flat(missing(-9999.0), {"tau1": _SENTINEL, "q2": _SENTINEL}),
        ways=("h5", "parquet", "feather"),
        keep=~BAD,
    ),
    Fact(
        "cells N/A",
        missing("N/A", object),
        ways=("csv", "tsv", "jsonl", "pandas"),
        keep=~BAD,
    ),
    Fact(
        "effort empty in some messages",
        states=messages(BAD, effort=()),
        keep=~BAD,
        within=1e-8,
    ),
    # types of numbers
    Fact("float32", typed(lambda v: v.astype(np.float32), time=False), within=1e-5),
    Fact("float16", typed(lambda v: v.astype(np.float16), time=False), within=3e-2),
    Fact(
        "int16 in mrad and mNm",
        base("q{}_mrad", "tau{}_mnm", WHOLE_MRAD.astype(np.int16), WHOLE_MNM.astype(np.int16)),
        truth=(T, WHOLE_MRAD * 1e-3, WHOLE_MNM * 1e-3),
    ),
    Fact(
        "big-endian float64",
        typed(lambda v: v.astype(">f8")),
        ways=("npz", "mat", "h5", "dict", "pandas", "arrays"),
    ),
    Fact(
        "decimal",
        typed(lambda v: np.array([Decimal(f"{one:.9f}") for one in v], object)),
        ways=("parquet", "feather", "pandas", "polars", "dict", "arrays"),
        within=1e-8,
    ),
    Fact(
        "object of floats",
        typed(lambda v: v.astype(object)),
        ways=("pandas", "polars", "dict", "arrays", "parquet"),
    ),
    Fact("list of floats", typed(lambda v: v.tolist()), ways=("dict",)),
    Fact(
        "text numbers",
        typed(lambda v: np.array([repr(float(one)) for one in v])),
        ways=("jsonl", "parquet", "feather", "npz", "h5", "dict", "pandas", "polars", "json"),
        within=1e-8,
    ),
    Fact("decimal comma", file=text_file(decimal_comma)),
    Fact("torque is boolean", base(tau=TA > 0), says_other=True),
    Fact(
        "complex",
        base(tau=TA + 1j),
        ways=("npz", "mat", "h5", "dict", "pandas", "arrays"),
        says_other=True,
    ),
    # quality, runs, robots
    Fact("valid=false on wild rows (bool)", base(**_WILD, valid=~BAD), keep=~BAD),
    Fact("valid=0 on wild rows (int)", base(**_WILD, valid=(~BAD).astype(int)), keep=~BAD),
    Fact("error_code != 0 on wild rows", base(**_WILD, error_code=np.where(BAD, 17, 0)), keep=~BAD),
    Fact(
        "runs of two arms, time restarts",
        TWO_ARMS,
        messages(~FIRST_HALF, **OTHER_ARM, stamp=EPOCH + NS - NS[HALF]),
        says_other=True,
    ),
    Fact("the same with a column robot=A,B", {**TWO_ARMS, "robot": LABELS}, says_other=True),
    Fact(
        "episode_index 0,1; time goes on, arms differ",
        {**TWO_ARMS, "time": T, "episode_index": np.where(FIRST_HALF, 0, 1)},
        says_other=True,
    ),
    Fact("episode_index 0,1; time goes on, pose jumps", CUT_SHORT, says_other=True),
    Fact(
        "LeRobot columns, two episodes, stamps restart",
        LEROBOT,
        ways=("parquet", "feather", "pandas", "polars", "jsonl"),
        says_other=True,
    ),
    Fact(
        "robot=A,B row by row, interleaved",
        base(
            q=np.where(EVEN, TH, OTHER.theta),
            tau=np.where(EVEN, TA, OTHER.tau),
            robot=np.where(EVEN, "A", "B"),
        ),
        says_other=True,
    ),
    Fact(
        "frame_id A,B message by message, two arms",
        states=either(EVEN, messages(frame="A"), messages(**OTHER_ARM, frame="B")),
        says_other=True,
    ),
    Fact(
        "frame_id A then B, two arms, time goes on",
        states=either(FIRST_HALF, messages(frame="A"), messages(**OTHER_ARM, frame="B")),
        says_other=True,
    ),
    Fact(
        "metadata: robot=A of the file, two arms",
        Flat({**TWO_ARMS, "time": T}, metadata={"robot": "A"}),
        ways=("csv",),
        says_other=True,
    ),
    Fact("groups or structs run1, run2 of two arms", file=groups, says_other=True),
    # meaning of the torque
    Fact("only tau_cmd (commanded)", base(torque="tau_cmd{}"), ways=tuple(FLAT), says_other=True),
    Fact("only tau_ext (external)", base(torque="tau_ext{}"), ways=tuple(FLAT), says_other=True),
    Fact(
        "current1 [A], no constant",
        base(torque="current{} [A]"),
        ways=tuple(FLAT),
        says_other=True,
    ),
    Fact(
        "unit A as attribute of tau1, comment of effort",
        units(base(tau=2 * TA), _PLAIN + "A,A"),
        defined(messages(effort=2 * TA), effort=" # motor current [A]"),
    ),
    Fact(
        "metadata: effort=gravity-compensated",
        Flat(base(), metadata={"effort": "gravity-compensated"}),
        States(messages(), metadata={"effort": "gravity-compensated"}),
        says_other=True,
    ),
    Fact(
        "metadata: zero=hanging, theta2 absolute",
        Flat(base(), metadata={"zero": "hanging", "second_angle": "absolute"}),
        States(messages(), metadata={"zero": "hanging", "second_angle": "absolute"}),
        says_other=True,
    ),
    Fact("tau1, tau_cmd1 side by side (measured first)", base(**pair("tau_cmd{}", TA * 2))),
    Fact(
        "q_filt beside q_meas",
        {"time": T, **pair("q_filt{}", TH * 0.9), **pair("q_meas{}", TH), **pair("tau{}", TA)},
    ),
    # rates within one log
    Fact("torque at a quarter of the rate: null between", quarter(None, object), keep=FOURTH),
    Fact("torque at a quarter of the rate: NaN between", quarter(np.nan), keep=FOURTH),
    Fact(
        "torque at a quarter of the rate: held",
        base(tau=HELD),
        messages(effort=HELD),
        says_other=True,
    ),
    Fact("torque at a quarter of the rate: own stamps t_tau", file=own_stamps, within=0.2),
    Fact(
        "stamps of torque in a column t_tau, 50 ms late",
        base(time_tau=T + 0.05),
        ways=(*[way for way in FLAT if way != "arrays"], "json"),
        says_other=True,
    ),
    Fact(
        "effort on a topic of its own, ends early",
        states=effort_elsewhere(),
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
        states=[
            one
            for both in zip(
                messages(topic="/a/joint_states"),
                messages(**OTHER_ARM, topic="/b/joint_states"),
                strict=True,
            )
            for one in both
        ],
        says_other=True,
    ),
    # text, names, packing
    Fact("a column's name twice (tau1, other values)", file=column_twice, says_other=True),
    Fact(
        "TAU1 beside tau1 (case)",
        base(TAU1=np.full(N, 5.0), TAU2=np.full(N, 6.0)),
        says_other=True,
    ),
    Fact(
        "comment midway '# tau1, tau2 in mNm'",
        file=commented(HALF + 1, np.where(FIRST_HALF, TA, MNM)),
        says_other=True,
    ),
    Fact("comment behind the header '# tau1, tau2 in mNm'", file=commented(1, MNM)),
    Fact("UTF-8 with BOM", file=encoded("utf-8-sig", (*_TEXT, "jsonl"), base())),
    Fact("UTF-16", file=encoded("utf-16", (*_TEXT, "jsonl"), base())),
    Fact("Latin-1, 't [µs]'", file=encoded("latin-1", _TEXT, clock("t [µs]", NS / 1e3))),
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
    flat: Columns | None = base(),  # noqa: B008
    states: list[Message] | None = messages(),  # noqa: B008
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
        flat=clock("time [s]", T),
        states=None,
        says_other=True,
    ),
    _caller(
        "time_unit=ms over dates",
        {"time_unit": "ms"},
        flat=base(time=DATES),
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
        flat=IN_MNM,
        states=messages(effort=MNM),
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
