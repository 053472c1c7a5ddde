"""Hostile schemas and messages in the four languages: ros2msg, ros2idl, protobuf and JSON."""

from __future__ import annotations

import json
import random
import struct
from io import BytesIO

from google.protobuf import descriptor_pb2

from pipelines.hostile import Hostile
from pipelines.hostile.records import NUMBERS, log_of_records
from pipelines.mutations import Topic, joint_states, write_topics

_LENGTHS = ("", "0", "1", "2", "<=3", "4294967295", "99999999999", "9" * 5000, "-1", "x")
_TYPES = (
    *("float64", "float32", "int8", "uint64", "string", "wstring", "bool"),
    *("a/T", "a/Zero", "Header", "time", "gone/T"),
)
_IDL = """module a { } ; struct T typedef double sequence < > , [ ] 3 @ ( ) effort ::a::msg::T
string unsigned long const " /* */ // # \\ union \u202e"""


def beside(draw: random.Random) -> Hostile:
    """The joints' topic, and hostile ones beside it."""
    log = log_of_records()
    topics = [_topic(draw, number) for number in range(draw.choice((1, 2, 30)))]
    return Hostile(".mcap", _file([joint_states(log), *topics]), "beside", log)


def alone(draw: random.Random) -> Hostile:
    """A hostile topic, and no other."""
    return Hostile(".mcap", _file([_topic(draw, 0)]), "alone", None)


def _file(topics: list[Topic]) -> bytes:
    stream = BytesIO()
    write_topics(stream, topics, chunk_size=1 << 16)
    return stream.getvalue()


def _topic(draw: random.Random, number: int) -> Topic:
    encoding, name, kind, definition, contents = draw.choice((_msg, _idl, _protobuf, _json))(draw)
    start = int(log_of_records().stamp_ns[0])
    stamped = [(start + row * 10**6, content) for row, content in enumerate(contents)]
    return f"/hostile{number}", encoding, name, kind, definition, stamped


def _payloads(draw: random.Random) -> list[bytes]:
    head = draw.choice((b"\0\1\0\0", b"\0\0\0\0", b"\0\7\0\0", b"", b"\0"))
    size = draw.choice((0, 1, 8, 200, 5000, 100_000))
    filled = draw.choice(
        (bytes(size), b"\xff" * size, struct.pack("<I", 2) * (size // 4), draw.randbytes(size))
    )
    count = struct.pack("<I", draw.choice(NUMBERS) & 0xFFFFFFFF)
    return [
        head + draw.choice((b"", count)) + filled[: draw.randrange(size + 1)]
        for _ in range(draw.choice((1, 3, 60)))
    ]


def _msg(draw: random.Random) -> tuple[str, str, str, bytes, list[bytes]]:
    def fields() -> str:
        lines = []
        for number in range(draw.choice((0, 1, 4, 4, 4, 3000))):
            bracket = f"[{draw.choice(_LENGTHS)}]" if draw.random() < 0.4 else ""
            lines.append(
                f"{draw.choice(_TYPES)}{bracket} "
                f"{draw.choice(('effort', 'position', 'name', f'f{number}'))}"
            )
        lines.append(
            draw.choice(
                (
                    "",
                    "# effort",
                    "int8 X=1",
                    "=" * 5000,
                    "\0\0",
                    "float64 \u202e",
                    '"' * 3000,
                    "a" * 70_000,
                )
            )
        )
        return "\n".join(lines)

    line = "\n" + "=" * 80 + "\n"
    parts = [
        fields(),
        f"MSG: a/T\n{fields()}",
        "MSG: a/Zero\nfloat64[0] x\nfloat64[0] y",
        f"MSG: std_msgs/Header\n{fields()}",
    ]
    text = line.join(parts[: draw.randrange(1, 5)])
    return (
        "cdr",
        "a/msg/T",
        "ros2msg",
        text.encode() + draw.choice((b"", b"\xff\xfe")),
        _payloads(draw),
    )


def _idl(draw: random.Random) -> tuple[str, str, str, bytes, list[bytes]]:
    words = (*_IDL.split(), "9" * 5000, "\n")
    member = " ".join(draw.choice(words) for _ in range(draw.choice((3, 30, 3000))))
    sound = draw.choice(
        (
            "sequence<double> effort;",
            "double x[3];",
            "T effort;",
            "sequence<T> effort;",
            "string effort;",
        )
    )
    text = (
        f"module a {{ module msg {{ struct T {{ {sound} {draw.choice((member, '', member))} "
        f"}}; }}; }};"
    )
    nested = draw.choice(('"', "/* ", "module a {", "sequence<", "(", "@a(", '"\\')) * draw.choice(
        (100, 100_000)
    )
    return (
        "cdr",
        "a/msg/T",
        "ros2idl",
        draw.choice((text, text, nested, member, text + nested)).encode(),
        _payloads(draw),
    )


def _protobuf(draw: random.Random) -> tuple[str, str, str, bytes, list[bytes]]:
    file = descriptor_pb2.FileDescriptorProto(
        name="a.proto", package=draw.choice(("a", "")), syntax="proto3"
    )
    for name in ("T", "U"):
        message = file.message_type.add(name=name)
        for number in range(1, draw.choice((1, 3, 10, 2000))):
            kind = draw.choice((1, 2, 3, 5, 9, 11, 11, 12, 14, 17, 10))
            target = draw.choice((".a.T", ".a.U", ".T", ".gone", "")) if kind == 11 else ""
            field = draw.choice((f"f{number}", "effort", "position", "name", ""))
            message.field.add(
                name=field, number=number, type=kind, label=draw.choice((1, 3)), type_name=target
            )
    data = descriptor_pb2.FileDescriptorSet(
        file=[file] * draw.choice((0, 1, 1, 1, 2))
    ).SerializeToString()
    cut = data[: draw.randrange(len(data) + 1)]
    data = draw.choice(
        (data, data, data, cut, draw.randbytes(200), b"\x0a\xff\xff\xff\xff\x0f effort")
    )
    entry = b"".join(
        bytes([draw.randrange(256)]) + draw.randbytes(draw.randrange(9))
        for _ in range(draw.choice((1, 9, 2000)))
    )
    deep = b"\x0a\x80\x80\x01" * 5000
    return (
        "protobuf",
        draw.choice(("a.T", "T", "gone")),
        "protobuf",
        data,
        [draw.choice((entry, deep, b"", draw.randbytes(50)))] * 9,
    )


def _json(draw: random.Random) -> tuple[str, str, str, bytes, list[bytes]]:
    number = draw.choice(
        (
            "1",
            "1.5",
            "NaN",
            "Infinity",
            "-1e999",
            "9" * 30,
            "9" * 400,
            "9" * 5000,
            "true",
            "null",
            '"x"',
            "[]",
            "{}",
        )
    )
    names = draw.choice(
        (["a", "b"], ["a", "a"], ["1", "1"], ["1", "2"], [], ["a"] * 3000, [""], [None], [1, 2])
    )
    stamp = (
        draw.choice(('{"sec": 1, "nanosec": %s}', '{"sec": %s, "nanosec": 5}', "[%s]", "%s"))
        % number
    )
    values = draw.choice(
        (
            f"[1.0, {number}]",
            f"[{number}, 2]",
            f"[{number}]",
            number,
            "[" * 3000,
            '{"a": 1, "b": 2}',
        )
    )
    text = (
        f'{{"header": {{"stamp": {stamp}}}, "name": {json.dumps(names)}, "position": {values}, '
        f'"effort": {values}}}'
    )
    plain = (
        '{"header": {"stamp": {"sec": %d, "nanosec": 5}}, "name": ["a", "b"], "position": [1, '
        '2], "effort": [3, 4.5]}'
    )
    rows = [(plain % row).encode() for row in range(draw.choice((0, 5, 90)))]
    return "json", "a", "jsonschema", b"{}", [*rows, text.encode(), *rows[:1]]
