"""What a batch is made of: a job is the logs of one arm on one occasion."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from algid.errors import SettingError

Label = str | float | int | bool


@dataclass(frozen=True)
class Job:
    """One identification of a batch.

    Parameters
    ----------
    name : str
        Unique in the batch; the result folder is ``OUT/NAME.algid``, so that it may hold slashes.
    logs, loaded : paths or URLs of the logs without and with payload
    profile : path of a profile, or None for the batch's
    robot : str or None
    time : ISO 8601 or None, when the logs were taken, where their stamps do not tell
    labels : anything else that is known, such as ``payload`` in kg
    """

    name: str
    logs: tuple[str, ...] = ()
    loaded: tuple[str, ...] = ()
    profile: str | None = None
    robot: str | None = None
    time: str | None = None
    labels: Mapping[str, Label] = field(default_factory=dict)


def checked_name(name: str, place: str) -> str:
    """`name`, once it is certain that a file of that name lies within OUT.

    Raises
    ------
    SettingError
        If a part of it is empty, starts with a dot, or holds what no file name should.
    """
    for part in name.split("/"):
        if not part or part.startswith(".") or not part.isprintable() or "\\" in part or len(part.encode()) > 200:
            raise SettingError(
                f"{place}: a job's name becomes a folder's: expected parts of printable characters, none starting "
                f"with a dot, found {name!r:.60}"
            )
    return name


def label_of(value: object) -> Label:
    """A manifest's value: a number where it reads like a finite one, text otherwise."""
    if isinstance(value, bool | int | float):
        return value
    text = str(value)
    try:
        number = float(text)
    except ValueError:
        return text
    return number if math.isfinite(number) else text
