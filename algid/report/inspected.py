"""What a log holds and is worth, as tables and lines."""

from __future__ import annotations

from collections.abc import Iterator

from algid.base.text import joined, visible
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
    rows, shown, left = [], found.entries[:MOST_SHOWN], len(found.entries) - MOST_SHOWN
    for one in shown:
        rate = "" if one.rate is None else f"{one.rate:.4g}"
        numbers = ("" if one.count is None else str(one.count), rate)
        rows.append((visible(one.name, NAME), visible(one.type, TYPE), *numbers))
    if rows:
        note = f"and {left} more" if left > 0 else ""
        yield Table("Channels", "Name | Type | Samples | Hz", rows, note)
    for one in shown:
        if one.joints or one.fields:
            joints = f"joints {', '.join(one.joints)}; " if one.joints else ""
            fields = joined(one.fields, MOST_FIELDS) or "without a number"
            yield visible(f"{one.name}: {joints}fields {fields}", 2000)
    if found.mapping:
        taken = [(name, visible(source)) for name, source in sorted(found.mapping.items())]
        yield Table("Taken as", "algid | log", taken)
    clock, rough = found.clock, found.dynamics
    if clock is not None:
        longest = f", the longest {clock.longest_gap:.3g} s" if clock.gaps else ""
        yield (
            f"{counted(clock.rows, 'sample')}, {clock.duration:.6g} s at {clock.rate:.6g} Hz, "
            f"jitter {clock.jitter * 1e3:.3g} ms, {counted(clock.gaps, 'gap')}{longest}"
        )
    figures = []
    for name, of in (found.signals or {}).items():
        values = (of.low, of.high, of.noise, of.step, 100 * of.saturated)
        figures.append((name, *(f"{value:.4g}" for value in values)))
    if figures:
        yield Table("Signals", "Channel | Low | High | Noise | Step | Saturated, %", figures)
    if rough is not None:
        yield (
            f"excitation: condition number {rough.condition:.4g}; as read, the equations of motion "
            f"explain {100 * rough.explained:.3g} % of the torques: k4 {rough.weight1:.3g} N m, "
            f"k2 {rough.weight2:.3g} N m"
        )
    for notice in (*found.notices, *found.findings):
        yield f"{notice.code}: {visible(notice.clause, 2000)}"
    refusing = joined(list(dict.fromkeys(one.code for one in found.findings if one.refuse)))
    if refusing or found.refused:
        yield f"refused: {refusing or visible(found.refused or '', 2000)}"
