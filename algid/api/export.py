"""A result as a model for simulators, controllers and planners."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from algid.api.given import called, opened
from algid.api.ranges import check
from algid.errors import SettingError
from algid.files import refuse_existing, whole_file
from algid.options import flag
from algid.results import Result

if TYPE_CHECKING:
    from algid.notices import Notice

FORMATS = ("urdf", "mjcf", "sdf", "python", "c", "yaml")


@dataclass(frozen=True)
class Exported:
    """An arm as a model: its text, warnings of what does not fit, and its file, if written."""

    text: str
    warnings: tuple[Notice, ...]
    path: Path | None = None

    def __repr__(self) -> str:
        codes = ", ".join(one.code for one in self.warnings) or "none"
        lines = self.text.count("\n")
        return f"Exported(lines of text: {lines}, warnings: {codes}, path={self.path!r})"


def export(
    result: Result | str | Path,
    to: Literal["urdf", "mjcf", "sdf", "python", "c", "yaml"],
    *,
    l1: float | None = None,
    l2: float | None = None,
    m1: float | None = None,
    m2: float | None = None,
    rotor1: float | None = None,
    out: str | Path | None = None,
    force: bool = False,
) -> Exported:
    """The arm of a result as a model.

    Parameters
    ----------
    result : Result or path of one
    to : 'urdf', 'mjcf', 'sdf' (robot descriptions), 'python', 'c' (dynamics) or 'yaml' (payload)
    l1, l2 : float, m
        Link lengths; what the result knows best by default.
    m1, m2 : float, kg
        Masses of the links.
    rotor1 : float, kg m²
        Joint 1's rotor at the joint, a part of k5.
    out : Path
        File to write; None writes nothing.
    force : bool
        Replace a file that is there.

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
    from algid.exports.formats import exported
    from algid.exports.links import Knowns

    if to not in FORMATS:
        raise SettingError(f"{flag('to')}: expected one of {', '.join(FORMATS)}, found {to!r:.60}")
    check("export", l1=l1, l2=l2, m1=m1, m2=m2, rotor1=rotor1)
    knowns = Knowns(l1, l2, m1, m2, rotor1)
    text, warnings = exported(opened(result), called(result), to, knowns)
    if out is None:
        return Exported(text, warnings)
    path = Path(out)
    refuse_existing(path, force)
    with whole_file(path, force=force) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return Exported(text, warnings, path)


def file_of(result: Path, to: str) -> Path:
    """The default file of a result's export: the result's name with the format's suffix."""
    from algid.exports.formats import FORMATS as WRITTEN

    folder = result
    if result.name == "result.json":
        folder = result.resolve().parent
    stem = folder.stem or "arm"
    if to == "python":
        stem = re.sub(r"\W", "_", stem)
    if to == "yaml":
        return Path(f"{stem}-payload.yaml")
    return Path(f"{stem}{WRITTEN[to].suffix}")
