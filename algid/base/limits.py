"""Bounds on what a file may claim, ask for or hold, in one object so that each can be tested.

A size, a count or a depth that stands in a file is anybody's. Whatever loops over such a number,
or reserves memory for it, compares it with a bound from here first. Each is far beyond what a
recorder of a two-link arm writes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class FileLimits:
    """The bounds; sizes are in bytes where nothing else is said."""

    # settings, profiles, manifests, results
    text_bytes: int = 1 << 26
    """Of a file that is read whole: profiles, limits, manifests, results have some thousand."""

    toml_bytes: int = 1 << 22
    """Of a TOML file: a manifest of 60,000 jobs; tomllib takes up to three seconds a MiB."""

    # tables of every format
    columns: int = 4096
    list_cells: int = 64
    """Cells that are taken of a column of lists or a matrix; a joint has one."""
    whole_bytes: int = 1 << 30
    """Of a file that is read as a whole: NumPy, MATLAB, HDF5, JSON lines."""
    reserved_rows: int = 1 << 24
    """Rows to reserve memory for on a file's word alone, 0.9 GiB of seven columns; beyond that a
    log's arrays grow with it."""
    largest_value: float = 1e30
    """A larger value is no angle or torque; its eighth power, in covariances, is a double."""
    largest_time_ns: float = 9.2e18
    """int64 nanoseconds end at 292 years."""
    shortest_step_ns: float = 1000.0
    """Between samples, in the median: filters have as many taps as samples in their time."""

    # text
    head_bytes: int = 1 << 16
    """Of a file that are looked at to know its format and its dialect."""
    line_bytes: int = 1 << 16
    """Of one line of a table."""
    title_lines: int = 40
    """Lines above a table's header that are passed over."""
    stated_lines: int = 64
    """Lines above a table that are looked at for units."""
    stated_letters: int = 2000
    """Of one such line."""
    unit_letters: int = 40
    """Of a unit that a schema states."""
    name_letters: int = 512
    """Of a name of a column, topic or joint to take apart; a longer one is no joint's."""
    number_letters: int = 400
    """Of a cell that holds a number: the largest float64 has 309 digits before its point."""
    free_text_bytes: int = 256 << 20
    text_a_byte: int = 250
    """What a table of n bytes may unpack to is the former and n times the latter: numbers pack 3
    to 20 times, a log at rest 100 times."""

    # MCAP
    chunk_bytes: int = 1 << 28
    """Of a chunk, packed and unpacked: recorders close one at some MiB; more is not genuine."""

    # messages
    message_bytes: int = 1 << 24
    """Of one message; a joint state has some hundred."""
    layouts: int = 256
    """Past so many layouts of one size messages are walked one by one."""
    definition_depth: int = 32
    """Types, typedefs, modules and Protobuf messages within one another."""
    json_depth: int = 8
    """Lists and objects within one another in a JSON line."""
    joints: int = 256
    """Names of joints in one message."""
    other_joints: int = 32
    """Joints that are not read and are looked at."""

    # batches
    name_bytes: int = 1000
    """Of a job's name with its folders: a path may have 4096."""


LIMITS = FileLimits()


Range = tuple[float, float]
"""The least and the largest value."""


def within(bounds: Range, default: Any = ...) -> Any:
    """What pydantic holds a number against, and its default where it is a field."""
    from pydantic import Field

    return Field(default, ge=bounds[0], le=bounds[1])


@dataclass(frozen=True)
class Physical:
    """Valid ranges of quantities in SI units: beyond any arm, with powers that are still finite."""

    length: Range = (1e-4, 1e3)
    mass: Range = (1e-9, 1e6)
    inertia: Range = (0.0, 1e9)
    friction: Range = (0.0, 1e9)
    gravity: Range = (0.0, 1e3)
    """0 is an arm that moves in a horizontal plane."""
    torque: Range = (-1e9, 1e9)
    angle: Range = (-1e6, 1e6)
    speed: Range = (-1e4, 1e4)
    rate: Range = (1e-3, 1e6)
    duration: Range = (1e-3, 1e6)
    samples: Range = (2, 1e8)
    """More than a day at 1 kHz."""
    delay: Range = (-10.0, 10.0)
    window: Range = (1e-3, 3600.0)
    bandwidth: Range = (1e-2, 1e5)
    pole: Range = (1e-6, 1e6)
    noise: Range = (0.0, 1e3)


PHYSICAL = Physical()

PLANNED: dict[str, Range] = {
    "tip_height": (-1e6, 1e3),
    "duration": (0.5, 120),
    "rate": (20, 1e5),
}
"""What a design takes, in m, s and Hz."""
KNOWN_LENGTH: Range = (1e-3, 1e3)
KNOWN_MASS: Range = (1e-6, 1e6)
"""A link's length in m and a mass in kg as a user knows them."""
PRIOR_ERROR: Range = (1, 100)
"""Per cent: what is known better is no drawing's."""
