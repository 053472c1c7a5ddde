"""ROS message definitions as recorded, .msg or IDL: one text, read by rosbags."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

PRIMITIVES = {
    "bool": "u1", "byte": "u1", "char": "u1", "int8": "i1", "uint8": "u1",
    "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
TEXTS = ("string", "wstring")
SEQUENCE = -1


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
    "builtin_interfaces/msg/Time": (Field("secs", "uint32", None), Field("nsecs", "uint32", None)),
    "builtin_interfaces/msg/Duration": (
        Field("secs", "int32", None), Field("nsecs", "int32", None)
    ),
}  # fmt: skip
_LINE = re.compile(r"^=+[ \t]*\n\s*MSG:\s*", re.MULTILINE)
"""Between the types of one text."""
_WIDE = re.compile(r"^([ \t]*wstring)<=\d+", re.MULTILINE)
"""Texts of a bounded length, whose kind rosbags does not know in .msg."""
_CONSTANT = re.compile(r"^[ \t]*\w+(?:<=\d+)?[ \t]+\w+[ \t]*=.*$", re.MULTILINE)
"""No field; rosbags reads those in capitals alone."""
_SECTION = re.compile(r"^=+[ \t]*\nIDL:[^\n]*\n", re.MULTILINE)
_INCLUDE = re.compile(r"^[ \t]*#[^\n]*$", re.MULTILINE)
"""What rosidl begins every file with, and rosbags does not read."""
_MISREAD = re.compile(r"sequence\s*<\s*sequence|@optional")
"""What rosbags takes for something else, and rosidl never writes."""


@lru_cache(maxsize=64)
def parse(root: str, text: str, *, idl: bool = False, ros1: bool = False) -> tuple[str, Types]:
    """The full name of `root` (``package/msg/Type``), and fields by type name.

    In ROS 1 times are primitive.

    Raises
    ------
    DefinitionError
        If the text cannot be read, or a type is missing.
    """
    from rosbags.typesys import get_types_from_idl, get_types_from_msg
    from rosbags.typesys.msg import normalize_msgtype

    text, root = text.replace("\r\n", "\n"), normalize_msgtype(root)
    if idl and (odd := _MISREAD.search(text)):
        raise DefinitionError(f"{root}: {odd[0]!r} is not what ROS 2 writes")
    types: Types = dict(_TIMES_OF_ROS1) if ros1 else {}
    found: dict[str, Any] = {}
    try:
        if idl:
            for section in filter(str.strip, _SECTION.split(_INCLUDE.sub("", text))):
                found |= get_types_from_idl(section)
        else:
            plain = _WIDE.sub(r"\1", _LINE.sub(f"{'=' * 80}\nMSG: ", text))
            found |= get_types_from_msg(_CONSTANT.sub("", plain), root)
        for owner, (_, members) in found.items():
            fields = tuple(_member(name, *kind) for name, kind in members)
            types[owner] = fields or (() if ros1 else (_NOTHING,))
    except Exception as error:  # what the parser raises, a RecursionError too
        said = str(error).split("\n")  # what, the text, how far it was read, what follows
        reason = " ".join((said[0][:100], *said[3:4])).strip()[:200]
        raise DefinitionError(f"{root}: its text cannot be read ({reason})") from error
    known = {*types, *PRIMITIVES, *TEXTS}
    used = {field.type for fields in types.values() for field in fields}
    for missing in sorted((used | {root}) - known):
        raise DefinitionError(f"{root}: the type {missing!r} is not defined")
    return root, types


def _member(name: str, form: Any, what: Any) -> Field:
    """A member of a structure out of rosbags' description of its type."""
    from rosbags.interfaces import Nodetype

    if form == Nodetype.BASE:
        return Field(name, what[0], None)
    if form == Nodetype.NAME:
        plain = what.rpartition("/")[2]  # of .msg rosbags knows no wstring
        return Field(name, plain if plain in TEXTS else what, None)
    inner, size = what
    one = _member(name, *inner)
    return Field(name, one.type, size if form == Nodetype.ARRAY else SEQUENCE)
