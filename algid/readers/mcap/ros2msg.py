"""ROS 2 message definitions as recorders store them: one text, every nested type behind a line of ``=``."""

from __future__ import annotations

import re
from dataclasses import dataclass

PRIMITIVES = {
    "bool": "u1", "byte": "u1", "char": "u1", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
_FIELD = re.compile(
    r"^(?P<type>[A-Za-z][\w/]*)(?P<bound><=\d+)?(?P<array>\[(?P<size>(<=)?\d*)\])?\s+(?P<name>[A-Za-z]\w*)\s*(?P<rest>.*)$"
)
_MOST_FIELDS = 4096
_DEEPEST = 32


class DefinitionError(Exception):
    """A definition that cannot be understood."""


@dataclass(frozen=True)
class Field:
    """A field: the name of its type and how often it stands there (None: once, -1: a sequence)."""

    name: str
    type: str
    count: int | None


Types = dict[str, tuple[Field, ...]]


def parse(root: str, text: str) -> Types:
    """Fields by type name, `root` under its full name.

    Raises
    ------
    DefinitionError
        If a line cannot be read, a nested type is missing, or types contain each other.
    """
    sections = re.split(r"^=+[ \t]*\r?$", text, flags=re.MULTILINE)
    types = {root: _fields(root, sections[0])}
    for section in sections[1:]:
        head, _, body = section.strip().partition("\n")
        found = re.match(r"^MSG:\s*(\S+)$", head.strip())
        if found is None:
            raise DefinitionError(f"{root}: expected 'MSG: package/Type', found {head[:60]!r}")
        types[found[1]] = _fields(found[1], body)
    resolved = {name: tuple(_resolved(field, name, types) for field in fields) for name, fields in types.items()}
    check_depth(root, resolved)
    return resolved


def _fields(name: str, text: str) -> tuple[Field, ...]:
    fields = [found for line in text.splitlines() if (found := _field(name, line)) is not None]
    if len(fields) > _MOST_FIELDS:
        raise DefinitionError(f"{name}: {len(fields)} fields")
    # an empty structure takes one byte, since IDL has none
    return tuple(fields) or (Field("structure_needs_at_least_one_member", "uint8", None),)


def _field(name: str, line: str) -> Field | None:
    text = line.split("#", 1)[0].strip()
    if not text:
        return None
    found = _FIELD.match(text)
    if found is None:
        raise DefinitionError(f"{name}: cannot read the line {line.strip()[:60]!r}")
    if found["rest"].startswith("="):
        return None  # a constant
    size = found["size"]
    count = None if found["array"] is None else int(size) if size.isdigit() else -1
    return Field(found["name"], found["type"], count)


def _resolved(field: Field, owner: str, types: Types) -> Field:
    if field.type in PRIMITIVES or field.type in ("string", "wstring"):
        return field
    package = owner.split("/")[0]
    short = {
        "time": "builtin_interfaces/Time",
        "duration": "builtin_interfaces/Duration",
        "Header": "std_msgs/Header",
    }
    wanted = field.type if "/" in field.type else f"{package}/{field.type}"
    for name in (wanted, wanted.replace("/msg/", "/"), _with_msg(wanted), short.get(field.type, wanted)):
        if name in types:
            return Field(field.name, name, field.count)
    raise DefinitionError(f"{owner}: the type {field.type!r} of {field.name!r} is not defined")


def _with_msg(name: str) -> str:
    package, _, rest = name.partition("/")
    return f"{package}/msg/{rest}"


def check_depth(root: str, types: Types) -> None:
    """Refuse types that contain each other, or go too deep.

    Raises
    ------
    DefinitionError
    """
    _height(root, types, {}, 0)


def _height(name: str, types: Types, known: dict[str, int], above: int) -> int:
    """Types below one another under `name`; each is looked at once, however often it is used."""
    if name not in known and above <= _DEEPEST:
        below = (_height(field.type, types, known, above + 1) for field in types[name] if field.type in types)
        known[name] = 1 + max(below, default=0)
    if above + known.get(name, 1) > _DEEPEST:
        raise DefinitionError(f"{name}: types nested more than {_DEEPEST} deep")
    return known[name]
