"""The formats of an export by name, and how one is written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from algid.errors import SettingError
from algid.export.c99 import c99
from algid.export.description import Description, describe
from algid.export.links import Knowns
from algid.export.mjcf import mjcf
from algid.export.payload_yaml import payload_yaml
from algid.export.python_module import python_module
from algid.export.sdf import sdf
from algid.export.urdf import urdf
from algid.identification.lengths import contradictions
from algid.results import Result


@dataclass(frozen=True)
class Format:
    """A format: its files' suffix, the text of an arm in it, what it is made of links, and what it may be told."""

    suffix: str
    text: Callable[[Description], str]
    links: bool
    takes: frozenset[str]


_LINKS = frozenset({"l1", "l2", "m1", "m2", "rotor1"})
FORMATS = {
    "urdf": Format(".urdf", urdf, True, _LINKS),
    "mjcf": Format(".xml", mjcf, True, _LINKS),
    "sdf": Format(".sdf", sdf, True, _LINKS),
    "python": Format(".py", python_module, False, frozenset({"l1"})),
    "c": Format(".c", c99, False, frozenset({"l1"})),
}
PAYLOAD = "yaml"


def exported(result: Result, file: str, to: str, knowns: Knowns) -> tuple[str, tuple[str, ...]]:
    """The text of an export, and warnings about what does not fit.

    Parameters
    ----------
    result : Result
    file : str
        What the result's file is called.
    to : str
        A name in `FORMATS`, or "yaml" for the payload.
    knowns : Knowns

    Raises
    ------
    ResultError
        If the result lacks an estimate, or no arm is like it.
    SettingError
        If what is known leaves no positive mass or inertia, is no positive number, or has no place in the format.
    """
    takes = frozenset({"l2"}) if to == PAYLOAD else FORMATS[to].takes
    for name, value in knowns.given.items():
        if not 0 < value < float("inf") and not (name == "rotor1" and value == 0):
            raise SettingError(f"--{name}: expected a positive number, found {value:g}")
        if name not in takes:
            raise SettingError(f"--{name}: {to} holds no such number; leave it out")
    if to == PAYLOAD:
        return payload_yaml(result, file, knowns), contradictions(result, knowns.given)
    arm = describe(result, file, knowns, links=FORMATS[to].links)
    return FORMATS[to].text(arm), arm.warnings
