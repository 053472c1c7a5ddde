"""ROS message definitions as recorded: one text, nested types separated by lines of ``=``.

.msg text is read by hand, in a twentieth of the time that rosbags takes; IDL by rosbags.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

PRIMITIVES = {
    "bool": "u1", "byte": "u1", "char": "u1", "int8": "i1", "uint8": "u1",
    "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
TEXTS = ("string", "wstring")
SEQUENCE = -1
_SHORT = {
    "time": "builtin_interfaces/Time", "duration": "builtin_interfaces/Duration",
    "Header": "std_msgs/Header",
}  # fmt: skip
_FIELD = re.compile(
    r"^(?P<type>[A-Za-z][\w/]*)(?:<=\d+)?(?P<array>\[(?P<size>(?:<=)?\d{0,10})\])?"
    r"\s+(?P<name>[A-Za-z]\w*)\s*(?P<rest>.*)$"
)


class DefinitionError(Exception):
    """A definition that cannot be understood."""


@dataclass(frozen=True)
class Field:
    """A field: the name of its type and how often it stands there (None: once, or `SEQUENCE`)."""

    name: str
    type: str
    count: int | None


Types = dict[str, tuple[Field, ...]]
_NOTHING = Field("structure_needs_at_least_one_member", "uint8", None)
"""An empty structure takes one byte in ROS 2, since IDL has none."""
_TIMES_OF_ROS1: Types = {
    "builtin_interfaces/Time": (Field("secs", "uint32", None), Field("nsecs", "uint32", None)),
    "builtin_interfaces/Duration": (Field("secs", "int32", None), Field("nsecs", "int32", None)),
}


def parse_msg(root: str, text: str, *, ros1: bool = False) -> Types:
    """Fields by type name, `root` under its full name; in ROS 1 times are primitive.

    Raises
    ------
    DefinitionError
        If a line cannot be read, or a nested type is missing.
    """
    types: Types = dict(_TIMES_OF_ROS1) if ros1 else {}
    for place, section in enumerate(re.split(r"^=+[ \t]*\r?$", text, flags=re.MULTILINE)):
        head, _, body = section.strip().partition("\n")
        heading = re.match(r"^MSG:\s*(\S+)$", head.strip())
        if place and heading is None:
            raise DefinitionError(f"{root}: expected 'MSG: package/Type', found {head[:60]!r}")
        name, body = (heading[1], body) if place and heading else (root, section)
        fields = []
        for line in body.splitlines():
            plain = line.split("#", 1)[0].strip()
            match = _FIELD.match(plain)
            if match is None and plain:
                raise DefinitionError(f"{name}: cannot read the line {line.strip()[:60]!r}")
            if match is None or match["rest"].startswith("="):  # a comment, a constant
                continue
            size = match["size"] or ""
            many = int(size) if size.isdigit() else SEQUENCE
            fields.append(Field(match["name"], match["type"], many if match["array"] else None))
        types[name] = tuple(fields) or (() if ros1 else (_NOTHING,))
    for name, own in types.items():
        types[name] = tuple(_resolved(field, name, types) for field in own)
    return types


def _resolved(field: Field, owner: str, types: Types) -> Field:
    """A field with its type's name in `types`: short, in the owner's package, or with ``msg``."""
    if field.type in PRIMITIVES or field.type in TEXTS:
        return field
    wanted = field.type if "/" in field.type else f"{owner.split('/')[0]}/{field.type}"
    long, short = wanted.replace("/", "/msg/", 1), wanted.replace("/msg/", "/")
    for name in (wanted, short, long, _SHORT.get(field.type)):
        if name in types:
            return Field(field.name, str(name), field.count)
    raise DefinitionError(f"{owner}: the type {field.type!r} of {field.name!r} is not defined")


_SECTION = re.compile(r"^=+[ \t]*\r?\nIDL:[^\n]*\n", re.MULTILINE)
_INCLUDE = re.compile(r"^[ \t]*#[^\n]*$", re.MULTILINE)
"""What rosidl begins every file with, and rosbags does not read."""
_MISREAD = re.compile(r"sequence\s*<\s*sequence|@optional")
"""What rosbags takes for something else, and rosidl never writes."""


def parse_idl(root: str, text: str) -> Types:
    """Fields by type name, `root` (``package/msg/Type``) among them, as rosbags reads IDL.

    Raises
    ------
    DefinitionError
        If the text cannot be read, or a type is missing.
    """
    from rosbags.typesys import get_types_from_idl

    if odd := _MISREAD.search(text):
        raise DefinitionError(f"{root}: {odd[0]!r} is not what ROS 2 writes")
    types: Types = {}
    try:
        for section in filter(str.strip, _SECTION.split(_INCLUDE.sub("", text))):
            for owner, (_, members) in get_types_from_idl(section).items():
                types[owner] = tuple(_member(name, *kind) for name, kind in members)
    except Exception as error:  # what the parser raises, a RecursionError too
        reason = " ".join(str(error).split())[:200]
        raise DefinitionError(f"{root}: its IDL cannot be read ({reason})") from error
    known = {*types, *PRIMITIVES, *TEXTS}
    used = {field.type for fields in types.values() for field in fields}
    for missing in sorted((used | {root}) - known):
        raise DefinitionError(f"{root}: the type {missing!r} is not defined")
    return types


def _member(name: str, form: Any, what: Any) -> Field:
    """A member of a structure out of rosbags' description of its type."""
    from rosbags.interfaces import Nodetype

    if form == Nodetype.BASE:
        return Field(name, what[0], None)
    if form == Nodetype.NAME:
        return Field(name, what, None)
    inner, size = what
    one = _member(name, *inner)
    return Field(name, one.type, size if form == Nodetype.ARRAY else SEQUENCE)
