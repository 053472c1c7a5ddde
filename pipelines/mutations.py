"""Damage to files: what disks, networks, crashes and enemies do to bytes."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np

from algid.arm import Arm
from algid.log import Log, Origin, Truth
from algid.writers import FORMATS, mcap, write_log

_NUMBERS = (
    0,
    1,
    0x7F,
    0xFF,
    0x7FFF,
    0xFFFF,
    0x7FFFFFFF,
    0xFFFFFFFF,
    1 << 40,
    (1 << 63) - 1,
    (1 << 64) - 1,
)
_WORDS = (
    b"nan",
    b"inf",
    b"1e999",
    b"-",
    b",",
    b"\n",
    b'"',
    b"#",
    b";",
    b"\0",
    b"\xff\xfe",
    b"<script>",
    b"\x1b[31m",
)


def damage(content: bytes, draw: random.Random) -> bytes:
    """The content with one to three pieces of damage."""
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        content = draw.choice(_KINDS)(content, draw)
    return content


def _flip_bit(content: bytes, draw: random.Random) -> bytes:
    place = draw.randrange(len(content))
    return content[:place] + bytes([content[place] ^ 1 << draw.randrange(8)]) + content[place + 1 :]


def _set_byte(content: bytes, draw: random.Random) -> bytes:
    place = draw.randrange(len(content))
    return content[:place] + bytes([draw.randrange(256)]) + content[place + 1 :]


def _set_number(content: bytes, draw: random.Random) -> bytes:
    width = draw.choice((2, 4, 8))
    place = draw.randrange(max(1, len(content) - width))
    number = draw.choice(_NUMBERS) & ((1 << 8 * width) - 1)
    return content[:place] + number.to_bytes(width, "little") + content[place + width :]


def _cut(content: bytes, draw: random.Random) -> bytes:
    return content[: draw.randrange(1, len(content))] if len(content) > 1 else content


def _remove(content: bytes, draw: random.Random) -> bytes:
    place, length = draw.randrange(len(content)), draw.choice((1, 2, 8, 100, 5000))
    return (content[:place] + content[place + length :]) or b"\0"


def _repeat(content: bytes, draw: random.Random) -> bytes:
    place, length = draw.randrange(len(content)), draw.choice((1, 9, 100, 5000))
    return content[: place + length] + content[place:]


def _insert(content: bytes, draw: random.Random) -> bytes:
    place = draw.randrange(len(content))
    return content[:place] + draw.choice(_WORDS) + content[place:]


def _zeros(content: bytes, draw: random.Random) -> bytes:
    place, length = draw.randrange(len(content)), draw.choice((4, 64, 512, 4096))
    return content[:place] + bytes(min(length, len(content) - place)) + content[place + length :]


# the end holds footers and summaries, the start magic and headers: both deserve more than their
# share
def _near_the_end(content: bytes, draw: random.Random) -> bytes:
    cut = max(0, len(content) - draw.choice((64, 400, 2000)))
    return content[:cut] + draw.choice((_flip_bit, _set_byte, _set_number))(content[cut:], draw)


def _near_the_start(content: bytes, draw: random.Random) -> bytes:
    cut = min(len(content), draw.choice((16, 64, 400)))
    return draw.choice((_flip_bit, _set_byte, _set_number))(content[:cut], draw) + content[cut:]


_KINDS = (
    *(_flip_bit, _flip_bit, _set_byte, _set_number, _cut, _remove, _repeat, _insert, _zeros),
    *(_near_the_end, _near_the_start),
)


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


def clean_files(folder: Path) -> list[Path]:
    """The clean log in every format, with a truth."""
    truth = Truth(Arm(6, 3, 0.15, 0.1, 0.3, 0.2, 0.1, 0.02, 1.5, 0.3), 0.5, "case1")
    paths = [folder / f"clean.{kind}" for kind in FORMATS]
    for path in paths:
        write_log(path, clean_log(), truth=truth)
    # small chunks, so that damage to one leaves others
    mcap.write(folder / "clean.mcap", clean_log(), truth=truth, chunk_size=8192)
    return paths
