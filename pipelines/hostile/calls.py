"""Hostile calls of algid: flags that nobody means, TOML files and results that nobody wrote.

Each is drawn from a seed. A call is made in a folder that holds what `places.furnish` puts there.
"""

from __future__ import annotations

import json
import random
import shutil
from functools import cache
from pathlib import Path
from typing import Any

import polars as pl

from algid.cli.app import COMMANDS, command
from pipelines.hostile import places, values
from pipelines.mutations import damage

UNLOADED, LOADED = "case1-unloaded.csv", "case1-loaded.csv"
RESULTS = ("full.algid", "weak.algid", "paper.algid")
NOISE = "--position-noise 1e-3 --torque-noise 1e-2"
DESIGN = f"--range 1.2 --speed 3 --torque 1.5 --duration 1 --rate 50 {NOISE}"
QUICK = "--estimator weak --model plain --no-report"
LENGTHS = "--l1 0.1626 --l2 0.1232"
CALLS = {
    "inspect": UNLOADED,
    "design": f"case1 -o out {DESIGN}",
    "identify": f"{UNLOADED} -o out {QUICK}",
    "validate": f"full.algid {UNLOADED}",
    "export": "full.algid --to urdf -o out/arm.urdf",
    "track": f"{LOADED} --parameters full.algid {LENGTHS} -o out",
    "report": "weak.algid",
    "compare": "full.algid weak.algid -o out",
    "synth": "case1 -o out --duration 0.2 --rate 50",
    "convert": f"{UNLOADED} -o out/copy.mcap",
    "guide": "",
}
NEVER = [
    "--help",
    "--watch",
    "--scheduler",
    "--version",
]
"""Options that wait for ever by intent, talk to a cluster, or print nothing else."""
SLOW = {("identify", "--estimator"), ("identify", "--model"), ("identify", "--cross-validate")}
"""Flags that choose honest work of more than a second."""


Call = tuple[str, ...]
"""The arguments of a command."""


def draw_call(seed: int, place: Path) -> Call:
    """The call of that seed; the files that it needs are put into `place`."""
    draw = random.Random(seed)
    return draw.choice((flags, flags, flags, toml, result, result, series))(draw, place)


@cache
def options(name: str) -> tuple[Any, ...]:
    """A command's options."""
    every = command(name).params
    return tuple(
        one for one in every if one.param_type_name == "option" and one.opts[-1] not in NEVER
    )


def flags(draw: random.Random, _place: Path) -> Call:
    """A sound call with one to three flags of any value."""
    name = draw.choice([one for one in COMMANDS if one in CALLS])
    given = sound = CALLS[name].split()
    for option in draw.choices(options(name), k=draw.choice((1, 1, 2, 3))) if options(name) else ():
        if (name, option.opts[-1]) not in SLOW or draw.random() < 0.2:
            given = given + _given(option, draw)
    if draw.random() < 0.1 and sound:
        given[draw.randrange(len(sound))] = values.text(draw)
    # no argument of a process holds a NUL, nor half a character
    words = [word.replace("\0", "").replace("\ud800", "\udcff") for word in given]
    return name, *words


def _given(option: Any, draw: random.Random) -> list[str]:
    """An option and its value."""
    flag, kind = option.opts[0], option.type.name
    if option.is_flag:
        return [flag]
    if option.metavar == "WORD":
        known = [one.value for one in option.shell_complete(None, "")]
    elif kind == "float":
        known = [repr(values.number(draw)) for _ in range(4)]
    elif kind == "integer":
        known = [str(draw.choice(values.WHOLE[:-1])) for _ in range(4)]
    elif kind == "path":
        known = [
            *RESULTS,
            UNLOADED,
            LOADED,
            "results",
            "out",
            "absent",
            "/dev/zero",
            "/dev/full",
            ".",
        ]
    else:
        known = _words(draw)
    value = draw.choice(known) if draw.random() < 0.85 else values.text(draw)
    return [f"{flag}={value}" if flag.startswith("--") else flag + value]


def _words(draw: random.Random) -> list[str]:
    """What an option of text may hold: numbers in every arrangement that some option has."""
    one, two, three, four = (repr(values.number(draw)) for _ in range(4))
    key = draw.choice(
        [
            "tau1.sign",
            "theta1.unit",
            "theta1.offset",
            "gravity",
            "start",
            "accept",
            "a.b.c",
            "signs",
        ]
    )
    arranged = f"{one} {one},{two} {one}:{two},{three}:{four} {one},{two},{three},{four}"
    assigned = f"{one}={two},{three}={four} {key}={one}"
    return [*arranged.split(), *assigned.split(), f"{key}={values.text(draw)}", values.text(draw)]


def toml(draw: random.Random, place: Path) -> Call:
    """A file of settings, some of it changed."""
    file = "hostile.toml"
    known = (
        ("profile", f"identify {UNLOADED} -o out {QUICK} --profile {file}"),
        ("profile", f"inspect {UNLOADED} --profile {file}"),
        ("profile", f"convert {UNLOADED} -o out/copy.csv --profile {file}"),
        ("arm", f"synth {file} -o out --duration 0.2 --rate 50"),
        ("arm", f"design {file} -o out {DESIGN}"),
        ("limits", f"design case1 -o out --limits {file} {NOISE}"),
        ("tolerances", f"validate full.algid --max-error {file}"),
        ("manifest", f"batch {file} -o out --workers 1 {QUICK} -q"),
    )
    kind, arguments = draw.choice(known[:-1] if draw.random() < 0.95 else known)
    content = places.SOUND[kind]
    written = values.as_toml(values.changed(content, draw)).encode("utf-8", "surrogatepass")
    if draw.random() < 0.2:
        written = damage(written or b" ", draw)
    (place / file).write_bytes(written)
    return tuple(arguments.split())


def result(draw: random.Random, place: Path) -> Call:
    """A command on a result whose result.json, or a track whose track.json, is changed."""
    source = draw.choice((*RESULTS, RESULTS[0], "case1-loaded.track"))
    folder, name = (
        ("hostile.track", "track.json")
        if source.endswith(".track")
        else ("hostile.algid", "result.json")
    )
    _copied(place / source, place / folder)
    content = json.loads((place / source / name).read_text())
    written = json.dumps(values.changed(content, draw)).encode()
    if draw.random() < 0.15:
        written = damage(written, draw)
    (place / folder / name).write_bytes(written)
    return _reading(folder, draw)


def _reading(folder: str, draw: random.Random) -> tuple[str, ...]:
    """A command that reads that result or track."""
    form = f"--format {draw.choice(('table', 'json'))}"
    if folder.endswith(".track"):
        return tuple(f"report {folder} {form}{draw.choice(('', ' --export mcap'))}".split())
    known = (
        f"report {folder} {form}",
        f"report {folder} --export mcap",
        f"compare {folder} weak.algid -o out {form}",
        f"compare full.algid {folder} {form}",
        f"validate {folder} --max-error 50",
        f"validate {folder} --max-error paper",
        f"validate {folder} {UNLOADED} {form}",
        f"validate {folder} {UNLOADED} --loaded {LOADED} --simulate",
        *(
            f"export {folder} --to {to} -o out/arm.x"
            for to in ["urdf", "mjcf", "sdf", "python", "c", "payload"]
        ),
        f"identify {LOADED} --parameters {folder} -o out {QUICK}",
        f"track {LOADED} --parameters {folder} -o out {LENGTHS}",
        f"track {LOADED} --parameters {folder} -o out",
        f"design {folder} -o out {DESIGN}",
    )
    return tuple(draw.choice(known).split())


def _copied(source: Path, target: Path) -> None:
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(source, target)


def series(draw: random.Random, place: Path) -> Call:
    """A command on a folder one of whose Parquet tables, or a design's trajectory, is changed."""
    kind = draw.choice(("jobs", "jobs", "result", "track", "design"))
    if kind == "jobs":
        _copied(place / "results", place / "hostile")
        file = place / "hostile" / "jobs.parquet"
        arguments = f"report hostile -o out --format {draw.choice(('table', 'json'))}"
    elif kind == "design":
        _copied(place / "case1.design", place / "hostile.design")
        file = place / "hostile.design" / draw.choice(("trajectory.csv", "design.json"))
        arguments = "synth case1 --motion hostile.design -o out --duration 0.5 --rate 50"
    else:
        base = "full.algid" if kind == "result" else "case1-loaded.track"
        folder = f"hostile{Path(base).suffix}"
        _copied(place / base, place / folder)
        file = draw.choice(sorted((place / folder).glob("*.parquet")))
        arguments = f"report {folder}{draw.choice(('', ' --export mcap'))}"
    _spoil(file, draw)
    return tuple(arguments.split())


TYPES: tuple[Any, ...] = (
    *(
        pl.String,
        pl.Int64,
        pl.UInt8,
        pl.Float32,
        pl.Float64,
        pl.Boolean,
        pl.Date,
        pl.Datetime("ns"),
        pl.Datetime("ms"),
    ),
    *(
        pl.Duration,
        pl.Time,
        pl.Binary,
        pl.Categorical,
        pl.Null,
        pl.List(pl.Float64),
        pl.Struct({"a": pl.Int64}),
    ),
    *(pl.Datetime("us", "Europe/Rome"), pl.Int128, pl.Decimal(38, 4)),
)


def _spoil(file: Path, draw: random.Random) -> None:
    if file.suffix != ".parquet" or draw.random() < 0.3:
        if draw.random() < 0.1:
            file.unlink()
        else:
            file.write_bytes(damage(file.read_bytes(), draw))
        return
    frame = pl.read_parquet(file)
    for _ in range(draw.choice((1, 1, 2))):
        if frame.width:
            frame = _spoilt_column(frame, draw.choice(frame.columns), draw)
    frame.write_parquet(file)


def _spoilt_column(frame: pl.DataFrame, column: str, draw: random.Random) -> pl.DataFrame:
    kind, to = draw.randrange(6), draw.choice(TYPES)
    if kind == 0:
        return frame.drop(column)
    if kind == 1:
        return frame.rename({column: column + values.text(draw)[:50].replace("\ud800", "x")})
    if kind == 2:
        return frame.head(draw.choice((0, 1, 2)))
    if kind == 3:
        return pl.concat([frame] * draw.choice((2, 9)))
    if kind == 4:
        word = values.text(draw).replace("\ud800", "x")
        value = draw.choice((None, values.number(draw), word))
        return frame.with_columns(pl.lit(value).alias(column))
    try:
        return frame.with_columns(pl.col(column).cast(to, strict=False))
    except pl.exceptions.PolarsError:
        return frame.with_columns(pl.lit(None, dtype=to).alias(column))
