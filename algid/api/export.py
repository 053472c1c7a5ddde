"""A result as a model for simulators, controllers and planners."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from algid.api.given import called, opened, parts_of
from algid.api.ranges import check
from algid.errors import SettingError
from algid.files import refuse_existing, whole_file, whole_folder
from algid.options import flag
from algid.results import Result

if TYPE_CHECKING:
    from algid.notices import Notice

FORMATS = ("urdf", "mjcf", "sdf", "python", "c", "payload", "csv", "parquet")


@dataclass(frozen=True)
class Exported:
    """An arm as a model: its text, warnings of what does not fit, and its file, if written.

    Of draws `text` is the manifest, `path` a folder, and `files` what that holds, by name.
    Of a payload `call` sets it on a controller of Universal Robots.
    """

    text: str
    warnings: tuple[Notice, ...]
    path: Path | None = None
    files: Mapping[str, bytes] = field(default_factory=dict)
    call: str = ""

    def __repr__(self) -> str:
        codes = ", ".join(one.code for one in self.warnings) or "none"
        lines = self.text.count("\n")
        return f"Exported(lines of text: {lines}, warnings: {codes}, path={self.path!r})"


def export(
    result: Result | str | Path,
    to: Literal["urdf", "mjcf", "sdf", "python", "c", "payload", "csv", "parquet"],
    *,
    l1: float | None = None,
    l2: float | None = None,
    m1: float | None = None,
    m2: float | None = None,
    rotor1: float | None = None,
    draws: int | None = None,
    seed: int = 0,
    flange: Sequence[float] | str | None = None,
    out: str | Path | None = None,
    force: bool = False,
) -> Exported:
    """The arm of a result as a model.

    Parameters
    ----------
    result : Result or path of one
    to : 'urdf', 'mjcf', 'sdf' (robot descriptions), 'python', 'c' (dynamics), 'payload' (YAML), or
        'csv' or 'parquet' (table of draws)
    l1, l2 : float, m
        Link lengths; what the result knows best by default.
    m1, m2 : float, kg
        Masses of the links.
    rotor1 : float, kg m²
        Joint 1's rotor at the joint, a part of k5.
    draws : int
        How many arms to draw from the joint distribution of the estimates, in place of the one
        that they are.
    seed : int
        Of the draws; the first ones are the same however many there are.
    flange : three float, m, m and degrees
        Of a payload: origin of the flange's frame in that of link 2, and where its x axis points.
    out : Path
        File to write, or folder of draws; None writes nothing.
    force : bool
        Replace what is there.

    Returns
    -------
    Exported
        The text and what does not fit. What is not known is chosen nearest to uniform links, and
        the text says so.

    Raises
    ------
    ResultError
        If the result cannot be read, lacks an estimate, or no arm is like it.
    SettingError
        If a number is none an arm has, or has no place in the format.
    OutputError
        If the file is there already and `force` is not set, or cannot be written.

    Examples
    --------
    >>> import algid
    >>> log, _ = algid.synthesise("case1", duration=3.0, excitation="wide")
    >>> arm = algid.identify(log, estimator="weak", model="plain")
    >>> algid.export(arm, "urdf", l2=0.1667).text.count("<link ")
    4
    """
    from algid.exports.formats import controller_call, exported
    from algid.exports.links import Knowns

    if to not in FORMATS:
        raise SettingError(f"{flag('to')}: expected one of {', '.join(FORMATS)}, found {to!r:.60}")
    if to in ("csv", "parquet") and draws is None:
        raise SettingError(f"{flag('to')} {to}: a table of draws; say how many by {flag('draws')}")
    check("export", l1=l1, l2=l2, m1=m1, m2=m2, rotor1=rotor1, draws=draws, seed=seed)
    knowns = Knowns(l1, l2, m1, m2, rotor1)
    place = None if flange is None else _flange(flange, to)
    path = None if out is None else Path(out)
    if path is not None:
        refuse_existing(path, force)
    if draws is not None:
        from algid.exports.draws import drawn_files

        files, warnings = drawn_files(opened(result), called(result), to, knowns, draws, seed)
        if path is not None:
            with whole_folder(path, force) as folder:
                for name, content in files.items():
                    (folder / name).write_bytes(content)
        return Exported(files["manifest.json"].decode(), warnings, path, files)
    read, file, call = opened(result), called(result), ""
    text, warnings = exported(read, file, to, knowns)
    if to == "payload":
        call = controller_call(read, file, knowns, place)
    if path is not None:
        with whole_file(path, force=force) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return Exported(text, warnings, path, call=call)


def _flange(given: Sequence[float] | str, to: str) -> tuple[float, float, float]:
    """A flange's place and direction out of three numbers, or of X,Y,ANGLE."""
    if to != "payload":
        raise SettingError(f"{flag('flange')}: {to} holds no flange; leave it out")
    try:
        x, y, angle = (float(part) for part in parts_of(given))
    except (TypeError, ValueError):
        x = y = angle = math.nan
    if not (abs(x) <= 1e3 and abs(y) <= 1e3 and abs(angle) <= 360):
        raise SettingError(
            f"{flag('flange')}: expected metres and degrees like 0.12,0,-90, found {given!r:.60}"
        )
    return x, y, angle


def file_of(result: Path, to: str, draws: int | None = None) -> Path:
    """The default file of a result's export: the result's name with the format's suffix.

    Of draws it is a folder.
    """
    from algid.exports.formats import FORMATS as WRITTEN

    folder = result
    if result.name == "result.json":
        folder = result.resolve().parent
    stem = folder.stem or "arm"
    if draws is not None or to in ("csv", "parquet"):
        return Path(f"{stem}-draws")
    if to == "python":
        stem = re.sub(r"\W", "_", stem)
    if to == "payload":
        return Path(f"{stem}-payload.yaml")
    return Path(f"{stem}{WRITTEN[to].suffix}")
