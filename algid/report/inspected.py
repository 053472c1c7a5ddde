"""What a log holds and is worth, as tables and lines."""

from __future__ import annotations

from collections.abc import Iterator

from algid.base.text import visible
from algid.base.words import counted
from algid.inspection.report import Inspection
from algid.report.document import Table

MOST_SHOWN = 100
"""Entries of a log that are listed."""
MOST_FIELDS = 12
NAME, TYPE = 80, 60
"""Letters of an entry's name and type that are shown."""


def inspection_content(found: Inspection) -> Iterator[Table | str]:
    """Tables, and lines between them, from what the log holds to what is wrong with it."""
    synthetic = ", synthetic" if found.synthetic else ""
    yield f"{visible(found.path, 1000)}: {found.format}{synthetic}"
    yield from _held(found)
    if found.mapping:
        rows = tuple((name, visible(source)) for name, source in sorted(found.mapping.items()))
        yield Table("Taken as", "algid | log", rows)
    yield from _figures(found)
    for notices in (found.notices, found.findings):
        for one in notices:
            yield f"{one.code}: {visible(one.clause, 2000)}"
    refusing = [one.code for one in found.findings if one.refuse]
    if refusing:
        yield f"refused: {', '.join(dict.fromkeys(refusing))}"
    elif found.refused:
        yield f"refused: {visible(found.refused, 2000)}"


def _held(found: Inspection) -> Iterator[Table | str]:
    """Columns or topics, then what the messages of each topic hold."""
    columns = "Name | Type | Samples | Hz"
    rows, shown = [], found.entries[:MOST_SHOWN]
    for one in shown:
        count = "" if one.count is None else str(one.count)
        rate = "" if one.rate is None else f"{one.rate:.4g}"
        rows.append((visible(one.name, NAME), visible(one.type, TYPE), count, rate))
    left = len(found.entries) - MOST_SHOWN
    note = f"and {left} more" if left > 0 else ""
    if rows:
        yield Table("Channels", columns, tuple(rows), note).without_empty()
    for one in shown:
        if one.joints or one.fields:
            joints = f"joints {', '.join(one.joints)}; " if one.joints else ""
            fields = ", ".join(one.fields[:MOST_FIELDS]) or "without a number"
            more = " …" if len(one.fields) > MOST_FIELDS else ""
            yield visible(f"{one.name}: {joints}fields {fields}{more}", 2000)


def _figures(found: Inspection) -> Iterator[Table | str]:
    """Of clock, signals and dynamics."""
    if found.clock is not None:
        clock = found.clock
        longest = f", the longest {clock.longest_gap:.3g} s" if clock.gaps else ""
        yield (
            f"{counted(clock.rows, 'sample')}, {clock.duration:.6g} s at {clock.rate:.6g} Hz, "
            f"jitter {clock.jitter * 1e3:.3g} ms, {counted(clock.gaps, 'gap')}{longest}"
        )
    if found.signals:
        columns = "Channel | Low | High | Noise | Step | Saturated, %"
        rows = []
        for name, one in found.signals.items():
            values = (one.low, one.high, one.noise, one.step, 100 * one.saturated)
            rows.append((name,) + tuple(f"{value:.4g}" for value in values))
        yield Table("Signals", columns, tuple(rows))
    if found.dynamics is not None:
        rough = found.dynamics
        yield (
            f"excitation: condition number {rough.condition:.4g}; as read, the equations of motion "
            f"explain {100 * rough.explained:.3g} % of the torques: k4 {rough.weight1:.3g} N m, "
            f"k2 {rough.weight2:.3g} N m"
        )
