"""Damage to files: what disks, networks, crashes and enemies do to bytes."""

from __future__ import annotations

import random
from collections.abc import Iterable
from heapq import merge
from itertools import repeat
from pathlib import Path
from typing import IO, Any

import numpy as np
from mcap.writer import Writer

from algid.base.ros2 import JOINT_STATE, JOINT_STATE_DEFINITION
from algid.log import Log, Origin
from algid.writers import mcap

_NUMBERS = (0, 1, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 1 << 40, (1 << 63) - 1)
_WORDS = (
    *(b"nan", b"inf", b"1e999", b"-", b",", b"\n", b'"', b"#", b";", b"\0", b"\xff\xfe"),
    *(b"<script>", b"\x1b[31m"),
)


def damage(content: bytes, draw: random.Random) -> bytes:
    """The content with one to three pieces of damage."""
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        # the end holds footers and summaries, the start magic and headers: both deserve more than
        # their share
        end = len(content)
        near = draw.choice((16, 64, 400, 2000))
        first, last = draw.choice(((0, end), (0, end), (0, end), (0, near), (end - near, end)))
        place = draw.randrange(max(0, first), max(1, min(last, end)))
        width = draw.choice((2, 4, 8))
        number = draw.choice((*_NUMBERS, (1 << 64) - 1)) & ((1 << 8 * width) - 1)
        some = content[place : place + draw.choice((1, 9, 64, 512, 5000))]
        byte = content[place : place + 1]
        small = (  # the commonest
            (byte, bytes([draw.randrange(256)])),
            (byte, bytes([content[place] ^ 1 << draw.randrange(8)])),
            (content[place : place + width], number.to_bytes(width, "little")),
        )
        large = (
            (content[place:], b""),  # cut off
            (some, b""),
            (some, some + some),
            (some, bytes(len(some))),
            (b"", draw.choice(_WORDS)),
        )
        old, new = draw.choice((*small, *small, *large))
        content = (content[:place] + new + content[place + len(old) :]) or b"\0"
    return content


def clean_log(rows: int = 400) -> Log:
    """A small log with velocities, of smooth motion."""
    t = np.arange(rows) * 1e-3
    theta = np.stack([np.sin(3 * t), np.cos(5 * t)])
    tau = np.stack([np.cos(2 * t) * 4, np.sin(7 * t)])
    omega = np.stack([3 * np.cos(3 * t), -5 * np.sin(5 * t)])
    return Log(
        np.arange(rows) * 1_000_000 + 1_700_000_000_000_000_000,
        theta,
        tau,
        Origin("", "", {}),
        omega,
    )


Topic = tuple[str, str, str, str, bytes, Iterable[tuple[int, bytes]]]
"""A topic's name, the encoding of its messages, its type, how that is defined, the definition, and
stamps in ns and contents of its messages."""


def joint_states(log: Log) -> Topic:
    """The log's messages in CDR."""
    contents = (payload.tobytes() for payload in mcap.messages(Path(), log)[mcap.TOPIC])
    stamped = zip(log.stamp_ns.tolist(), contents, strict=True)
    definition = JOINT_STATE_DEFINITION.encode()
    return "/joint_states", "cdr", JOINT_STATE, "ros2msg", definition, stamped


def write_topics(stream: IO[bytes], topics: Iterable[Topic], **options: Any) -> None:
    """An MCAP file, its messages in the order of their stamps."""
    writer = Writer(stream, **options)
    writer.start(profile="ros2", library="algid pipelines")
    waiting = []
    for topic, encoding, name, kind, definition, contents in topics:
        channel = writer.register_channel(
            topic, encoding, writer.register_schema(name, kind, definition)
        )
        waiting.append(zip(repeat(channel), contents))
    for row, (channel, (stamp, content)) in enumerate(merge(*waiting, key=lambda one: one[1][0])):
        writer.add_message(channel, stamp, content, stamp, row)
    writer.finish()  # type: ignore[no-untyped-call]
