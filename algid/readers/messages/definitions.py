"""ROS 2 message definitions as recorded: one text, nested types separated by lines of ``=``.

Either .msg text, or IDL as rosidl makes it: modules, structures, sequences, arrays, typedefs. What
rosidl never makes (unions, enumerations, optional members, lists of lists) is refused.

Both are read by hand. rosbags' parser, the oracle of the tests, stops at the ``#include`` that
every IDL file of rosidl begins with; it takes 200 ms for the IDL of JointState where this one
takes 0.3 ms, and 1 ms for its .msg text where this one takes 0.05 ms; and modules nested a hundred
times end it in a RecursionError.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from algid.limits import LIMITS
from algid.words import counted

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
_TOKEN = re.compile(
    r"\s+|//[^\n]*|/\*.*?(?:\*/|\Z)|\#[^\n]*|"
    r'(?P<token>"(?:[^"\\]|\\.)*"?|(?:::)?[A-Za-z_]\w*(?:::\w+)*|\d[\w.]*|.)',
    re.DOTALL,
)
_NUMBERS = {
    "boolean": "bool", "octet": "byte", "short": "int16", "unsigned short": "uint16",
    "long": "int32", "unsigned long": "uint32",
    "long long": "int64", "unsigned long long": "uint64", "float": "float32",
    "double": "float64",
}  # fmt: skip


def _longer(names: Iterable[str]) -> Iterator[str]:
    """What names of several words begin with, of two words or more."""
    for name in names:
        words = name.split()
        for size in range(2, len(words) + 1):
            yield " ".join(words[:size])


_LONGER = frozenset(_longer(_NUMBERS))
"""Names of numbers that go on behind a blank: ``unsigned long`` and ``unsigned long long``."""


def parse_idl(root: str, text: str) -> Types:
    """Fields by type name, `root` (``package/msg/Type``) among them.

    Raises
    ------
    DefinitionError
        If the text cannot be read, a type is missing, or types contain each other.
    """
    _check_length(root, text)
    definitions = _Definitions()
    for section in _SECTION.split(text):
        tokens = [one["token"] for one in _TOKEN.finditer(section) if one["token"]]
        _Parser(root, tokens, definitions).definitions(())
    if root not in definitions.structures:
        there = ", ".join(list(definitions.structures)[:8]) or "no structure"
        raise DefinitionError(f"{root}: not defined; found {there}")
    types = {}
    for owner, members in definitions.structures.items():
        types[owner] = tuple(definitions.resolved(owner, name, spec) for name, spec in members)
    _check_depth(root, types, {})
    return types


@dataclass(frozen=True)
class _Spec:
    """A type as the text names it, from within a scope; its count as in `Field`."""

    name: str
    scope: tuple[str, ...]
    count: int | None = None

    def candidates(self) -> list[str]:
        """Names it may mean, parts joined by ``/``, the innermost first."""
        name = self.name.removeprefix("::").replace("::", "/")
        outermost = len(self.scope) if self.name.startswith("::") else 0
        return [
            "/".join((*self.scope[: len(self.scope) - up], name))
            for up in range(outermost, len(self.scope) + 1)
        ]


@dataclass
class _Definitions:
    """Members of structures, and typedefs, by name."""

    structures: dict[str, list[tuple[str, _Spec]]] = field(default_factory=dict)
    typedefs: dict[str, _Spec] = field(default_factory=dict)

    def resolved(self, owner: str, name: str, spec: _Spec) -> Field:
        """The member `name` of `owner` with its type's full name."""
        for _ in range(LIMITS.definition_depth):
            if spec.name in PRIMITIVES or spec.name in TEXTS:
                return Field(name, spec.name, spec.count)
            meant = self._defined(spec.candidates())
            if meant is None:
                raise DefinitionError(f"{owner}: the type {spec.name!r} of {name!r} is not defined")
            if meant in self.structures:
                return Field(name, meant, spec.count)
            alias = self.typedefs[meant]
            if alias.count is not None and spec.count is not None:
                raise DefinitionError(f"{owner}: {name!r} is a list of lists")
            spec = _Spec(alias.name, alias.scope, alias.count if spec.count is None else spec.count)
        raise DefinitionError(
            f"{owner}: typedefs of {name!r} nested more than {LIMITS.definition_depth} deep"
        )

    def _defined(self, names: Iterable[str]) -> str | None:
        """The first of the names that is defined."""
        for name in names:
            if name in self.structures or name in self.typedefs:
                return name
        return None


@dataclass
class _Parser:
    """Reads the tokens of one section."""

    root: str
    tokens: list[str]
    found: _Definitions
    place: int = 0

    def definitions(self, scope: tuple[str, ...]) -> None:
        """Definitions up to the end, or to the brace that closes a module."""
        if len(scope) > LIMITS.definition_depth:
            raise DefinitionError(
                f"{self.root}: modules nested more than {LIMITS.definition_depth} deep"
            )
        while self.place < len(self.tokens) and not (scope and self.tokens[self.place] == "}"):
            self._annotations()
            kind = self._next()
            if kind == "module":
                name = self._next()
                self._expect("{")
                self.definitions((*scope, name))
                self._expect("}", ";")
            elif kind == "struct":
                self._structure(scope)
            elif kind == "typedef":
                for name, spec in self._declared(scope):
                    self.found.typedefs["/".join((*scope, name))] = spec
            elif kind == "const":
                while self._next() != ";":
                    pass
            else:
                wrong = f"{kind[:40]!r} where module, struct, typedef or const was expected"
                raise DefinitionError(f"{self.root}: {wrong}")

    def _structure(self, scope: tuple[str, ...]) -> None:
        name, members = self._next(), []
        self._expect("{")
        while self.tokens[self.place : self.place + 1] != ["}"]:
            self._annotations()
            members += self._declared(scope)
        self._expect("}", ";")
        if not members:  # rosidl gives an empty message one byte
            raise DefinitionError(f"{self.root}: the structure {name[:40]!r} has no member")
        self.found.structures["/".join((*scope, name))] = members

    def _declared(self, scope: tuple[str, ...]) -> list[tuple[str, _Spec]]:
        """A type and the names declared to be of it."""
        kind, listed = self._type()
        declared = []
        while True:
            name, count, token = self._next(), listed, self._next()
            if token == "[":
                if count is not None:
                    raise DefinitionError(f"{self.root}: {name!r} is a list of lists")
                count = self._number("]")
                token = self._next()
            declared.append((name, _Spec(kind, scope, count)))
            if token == ";":
                return declared
            if token != ",":
                raise DefinitionError(
                    f"{self.root}: {token[:40]!r} behind {name!r}; expected ',' or ';'"
                )

    def _type(self) -> tuple[str, int | None]:
        """The name of a type, and -1 for a sequence of it."""
        name = self._next()
        if name == "sequence":
            self._expect("<")
            if self.tokens[self.place : self.place + 1] == ["sequence"]:
                raise DefinitionError(f"{self.root}: a sequence of sequences")
            inner, _ = self._type()
            if self._taken(","):
                self._number(">")
            else:
                self._expect(">")
            return inner, -1
        if name in TEXTS and self._taken("<"):
            self._number(">")
        while (
            f"{name} {self.tokens[self.place] if self.place < len(self.tokens) else ''}" in _LONGER
        ):
            name = f"{name} {self._next()}"
        return _NUMBERS.get(name, name), None

    def _annotations(self) -> None:
        """Skip what is noted of the next definition."""
        while self._taken("@"):
            if (name := self._next()) == "optional":
                raise DefinitionError(f"{self.root}: @{name} members are not what ROS 2 writes")
            depth = 1 if self._taken("(") else 0
            while depth:
                depth += {"(": 1, ")": -1}.get(self._next(), 0)

    def _number(self, end: str) -> int:
        token = self._next()
        if not token.isdecimal() or len(token) > LIMITS.length_digits or int(token) == 0:
            raise DefinitionError(f"{self.root}: {token[:40]!r} where a length was expected")
        self._expect(end)
        return int(token)

    def _taken(self, token: str) -> bool:
        taken = self.tokens[self.place : self.place + 1] == [token]
        self.place += taken
        return taken

    def _expect(self, *tokens: str) -> None:
        for token in tokens:
            if (token_there := self._next()) != token:
                raise DefinitionError(
                    f"{self.root}: {token_there[:40]!r} where {token!r} was expected"
                )

    def _next(self) -> str:
        if self.place == len(self.tokens):
            raise DefinitionError(f"{self.root}: the definition breaks off")
        self.place += 1
        return self.tokens[self.place - 1]
