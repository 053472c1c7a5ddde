"""ROS 2 message definitions as recorded: one text, nested types separated by lines of ``=``.

.msg text is read by hand, in a twentieth of the time that rosbags takes; IDL by rosbags.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from algid.base.limits import LIMITS
from algid.base.words import counted

PRIMITIVES = {
    "bool": "u1", "byte": "u1", "char": "u1", "int8": "i1", "uint8": "u1",
    "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
TEXTS = ("string", "wstring")
_SHORT = {
    "time": "builtin_interfaces/Time", "duration": "builtin_interfaces/Duration",
    "Header": "std_msgs/Header",
}  # fmt: skip
_FIELD = re.compile(
    r"^(?P<type>[A-Za-z][\w/]*)(?P<bound><=\d+)?(?P<array>\[(?P<size>(<=)?\d*)\])?"
    r"\s+(?P<name>[A-Za-z]\w*)\s*(?P<rest>.*)$"
)


class DefinitionError(Exception):
    """A definition that cannot be understood."""


@dataclass(frozen=True)
class Field:
    """A field: the name of its type and how often it stands there (None: once, -1: a sequence)."""

    name: str
    type: str
    count: int | None


Types = dict[str, tuple[Field, ...]]
_NOTHING = Field("structure_needs_at_least_one_member", "uint8", None)


_TIMES_OF_ROS1: Types = {
    "builtin_interfaces/Time": (Field("secs", "uint32", None), Field("nsecs", "uint32", None)),
    "builtin_interfaces/Duration": (Field("secs", "int32", None), Field("nsecs", "int32", None)),
}


def parse_ros1(root: str, text: str) -> Types:
    """Fields by type name of a ROS 1 definition; times are primitive, structures may be empty.

    Raises
    ------
    DefinitionError
        As `parse_msg`.
    """
    types = dict(parse_msg(root, text, _TIMES_OF_ROS1))
    for name, fields in types.items():
        types[name] = tuple(one for one in fields if one != _NOTHING)
    return types


def parse_msg(root: str, text: str, known: Types | None = None) -> Types:
    """Fields by type name, `root` under its full name; `known` types need no section of the text.

    Raises
    ------
    DefinitionError
        If a line cannot be read, a nested type is missing, or types contain each other.
    """
    _check_length(root, text)
    sections = re.split(r"^=+[ \t]*\r?$", text, flags=re.MULTILINE)
    types = {**(known or {}), root: _fields(root, sections[0])}
    for section in sections[1:]:
        head, _, body = section.strip().partition("\n")
        heading = re.match(r"^MSG:\s*(\S+)$", head.strip())
        if heading is None:
            raise DefinitionError(f"{root}: expected 'MSG: package/Type', found {head[:60]!r}")
        types[heading[1]] = _fields(heading[1], body)
    resolved = {}
    for name, fields in types.items():
        resolved[name] = tuple(_resolved(field, name, types) for field in fields)
    _check_depth(root, resolved, {})
    return resolved


def _check_length(root: str, text: str) -> None:
    if len(text) > LIMITS.definition_letters:
        raise DefinitionError(
            f"{root}: a definition of {counted(len(text), 'character')}; expected "
            f"{LIMITS.definition_letters} at most"
        )


def _fields(name: str, text: str) -> tuple[Field, ...]:
    """The fields of a structure, a line each; comments and constants are passed over."""
    fields = []
    for line in text.splitlines():
        match = _FIELD.match(line.split("#", 1)[0].strip())
        if match is None and line.split("#", 1)[0].strip():
            raise DefinitionError(f"{name}: cannot read the line {line.strip()[:60]!r}")
        if match is None or match["rest"].startswith("="):
            continue
        size = match["size"]
        if size and len(size.removeprefix("<=")) > LIMITS.length_digits:
            wrong = f"a length of {counted(len(size), 'digit')} in the line {line.strip()[:60]!r}"
            raise DefinitionError(f"{name}: {wrong}")
        count = None if match["array"] is None else int(size) if size.isdigit() else -1
        fields.append(Field(match["name"], match["type"], count))
    if len(fields) > LIMITS.definition_fields:
        raise DefinitionError(f"{name}: {counted(len(fields), 'field')}")
    # an empty structure takes one byte, since IDL has none
    return tuple(fields) or (_NOTHING,)


def _resolved(field: Field, owner: str, types: Types) -> Field:
    """A field with its type's name in `types`: short, in the owner's package, or with ``msg``."""
    if field.type in PRIMITIVES or field.type in TEXTS:
        return field
    wanted = field.type if "/" in field.type else f"{owner.split('/')[0]}/{field.type}"
    package, _, rest = wanted.partition("/")
    for name in (
        wanted,
        wanted.replace("/msg/", "/"),
        f"{package}/msg/{rest}",
        _SHORT.get(field.type, wanted),
    ):
        if name in types:
            return Field(field.name, name, field.count)
    raise DefinitionError(f"{owner}: the type {field.type!r} of {field.name!r} is not defined")


def _check_depth(name: str, types: Types, known: dict[str, int], above: int = 0) -> int:
    """Types below one another under `name`, each looked at once, however often it is used.

    Raises
    ------
    DefinitionError
        Where types are nested too deep.
    """
    if name not in known and above <= LIMITS.definition_depth:
        deepest = 0
        for field in types[name]:
            if field.type in types:
                deepest = max(deepest, _check_depth(field.type, types, known, above + 1))
        known[name] = 1 + deepest
    if above + known.get(name, 1) > LIMITS.definition_depth:
        raise DefinitionError(f"{name}: types nested more than {LIMITS.definition_depth} deep")
    return known[name]


_SECTION = re.compile(r"^=+[ \t]*\r?\nIDL:[^\n]*\n", re.MULTILINE)
_INCLUDE = re.compile(r"^[ \t]*#[^\n]*$", re.MULTILINE)
"""What rosidl begins every file with, and rosbags does not read."""
_MISREAD = re.compile(r"sequence\s*<\s*sequence|@optional")
"""What rosbags takes for something else: rosidl never writes it."""


def parse_idl(root: str, text: str) -> Types:
    """Fields by type name, `root` (``package/msg/Type``) among them, as rosbags reads IDL.

    Raises
    ------
    DefinitionError
        If the text cannot be read, a type is missing, or types contain each other.
    """
    from rosbags.typesys import get_types_from_idl

    _check_length(root, text)
    if odd := _MISREAD.search(text):
        raise DefinitionError(f"{root}: {odd[0]!r} is not what ROS 2 writes")
    types: Types = {}
    try:
        for section in filter(str.strip, _SECTION.split(_INCLUDE.sub("", text))):
            for owner, (_, members) in get_types_from_idl(section).items():
                types[owner] = tuple(_member(name, kind) for name, kind in members)
    except Exception as error:  # what the parser raises, a RecursionError too
        reason = " ".join(str(error).split())[:200]
        raise DefinitionError(f"{root}: its IDL cannot be read ({reason})") from error
    for owner, fields in types.items():
        for one in fields:
            if one.type not in types and one.type not in PRIMITIVES and one.type not in TEXTS:
                raise DefinitionError(
                    f"{owner}: the type {one.type!r} of {one.name!r} is not defined"
                )
    if root not in types:
        there = ", ".join(list(types)[:8]) or "no structure"
        raise DefinitionError(f"{root}: not defined; found {there}")
    _check_depth(root, types, {})
    return types


def _member(name: str, kind: Any) -> Field:
    """A member of a structure out of rosbags' description of its type."""
    from rosbags.interfaces import Nodetype

    form, what = kind
    if form in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        inner, size = what
        one = _member(name, inner)
        if one.count is not None:
            raise DefinitionError(f"{name!r} is a list of lists")
        return Field(name, one.type, size if form == Nodetype.ARRAY else -1)
    return Field(name, what[0] if form == Nodetype.BASE else what, None)
