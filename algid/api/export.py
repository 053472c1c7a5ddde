"""A result as a model for simulators, controllers and planners."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator

from algid.api import Answer
from algid.api.options import (
    AnyResult,
    Folder,
    Length,
    Mass,
    Seed,
    called,
    folder_or_none,
    opened,
    stem_of,
    verb,
)
from algid.base.errors import SettingError
from algid.base.files import whole_file
from algid.base.limits import within
from algid.options import Option, flag
from algid.profile import parts_of

if TYPE_CHECKING:
    from algid.notices import Notice


_Place = Annotated[float, within((-1e3, 1e3))]
_Degrees = Annotated[float, within((-360, 360))]
Flange = Annotated[
    Sequence[float] | str,
    Option(check=Annotated[tuple[_Place, _Place, _Degrees], BeforeValidator(parts_of)]),
]


@dataclass(frozen=True)
class Exported:
    """An arm as a model: its text, warnings of what does not fit, and its file, if written.

    Of draws `text` is the manifest, `path` a folder, and `files` what that holds, by name.
    Of a payload `call` sets it on a controller of Universal Robots.
    """

    text: str = field(repr=False)
    warnings: tuple[Notice, ...]
    path: Path | None = None
    files: Mapping[str, bytes] = field(default_factory=dict, repr=False)
    call: str = ""


@verb
def export(
    result: AnyResult,
    to: Literal["urdf", "mjcf", "sdf", "python", "c", "payload", "csv", "parquet"],
    *,
    l1: Length | None = None,
    l2: Length | None = None,
    m1: Mass | None = None,
    m2: Mass | None = None,
    rotor1: Annotated[float, within((0, 1e6))] | None = None,
    draws: Annotated[int, within((1, 100_000))] | None = None,
    seed: Seed = 0,
    flange: Flange | None = None,
    out: Folder | None = None,
    force: bool = False,
) -> Exported:
    """Write the arm of a result as a model.

    What is not known is chosen nearest to uniform links, and the file says so.

    Parameters
    ----------
    result : Result or path of one
        A result folder, or its result.json.
    to : str
        urdf, mjcf, sdf; python, c; payload; draws as csv, parquet.
    l1 : float, m
        Length of link 1, m; by default the result's.
    l2 : float, m
        Length of link 2, m; by default the result's.
    m1, m2 : float, kg
        Mass of the link, kg.
    rotor1 : float, kg m²
        Joint 1's rotor at the joint, kg m², a part of k5.
    draws : int
        Arms to draw from the estimates' joint distribution, into a folder. They come in place of
        the one arm that the estimates are.
    seed : int
        Seed of the draws. The first ones are the same however many there are.
    flange : three float, m, m and degrees
        Flange in link 2's frame, of a payload: X,Y,ANGLE in m, m, °. Its origin, and where its x
        axis points.
    out : Path
        File or folder; there the result's name is taken. None writes nothing.
    force : bool
        Replace what is there.

    Returns
    -------
    Exported
        The text and what does not fit.

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
    $ algid export case1-unloaded.algid --to mjcf --l2 0.5

    >>> import algid
    >>> log, _ = algid.synthesise("case1", duration=3.0, torque="wide")
    >>> arm = algid.identify(log, estimator="weak", model="plain")
    >>> algid.export(arm, "urdf", l2=0.1667).text.count("<link ")
    4
    """
    from algid.exports.formats import SUFFIXES, controller_call, exported

    if to in ("csv", "parquet") and draws is None:
        raise SettingError(f"{flag('to')} {to}: a table of draws; say how many by {flag('draws')}")
    said, file = {"l1": l1, "l2": l2, "m1": m1, "m2": m2, "rotor1": rotor1}, called(result)
    knowns = {name: value for name, value in said.items() if value is not None}
    if flange is not None and to != "payload":
        raise SettingError(f"{flag('flange')}: {to} holds no flange; leave it out")
    path = None if out is None else Path(out)
    if path == Path() or (path is not None and path.is_dir() and draws is None):
        name = stem_of(result)
        if to == "python" and draws is None:  # a module is imported by its name
            name = re.sub(r"\W", "_", name)
        path /= name + ("-draws" if draws is not None else SUFFIXES.get(to, "-payload.yaml"))
    read = opened(result)
    if draws is not None:
        from algid.exports.draws import drawn_files

        with folder_or_none(path, force) as folder:
            files, warnings = drawn_files(read, file, to, knowns, draws, seed)
            if folder is not None:
                for name, content in files.items():
                    (folder / name).write_bytes(content)
        return Exported(files["manifest.json"].decode(), warnings, path, files)
    text, warnings = exported(read, file, to, knowns)
    call = "" if to != "payload" else controller_call(read, file, knowns, flange)  # type: ignore[arg-type]  # numbers
    if path is not None:
        with whole_file(path, force=force) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return Exported(text, warnings, path, call=call)


def answer(made: Exported, _given: Mapping[str, Any]) -> Answer:
    """What does not fit, and the file."""
    return Answer(
        made.call.splitlines(),
        remarks=[f"wrote {made.path}"],
        complaints=[one.text for one in made.warnings],
    )
