"""What a log holds and is worth, as tables and lines."""

from __future__ import annotations

from collections.abc import Iterator

from algid.base.text import joined, visible
from algid.inspection.report import Inspection
from algid.notices import codes_of
from algid.report.document import Table

MOST_SHOWN = 100
"""Entries of a log that are listed."""
MOST_FIELDS = 12
CLOCK = (
    "{rows:,} samples, {duration:.6g} s at {rate:.6g} Hz, jitter {jitter:.3g} s, gaps: {gaps}, the "
    "longest {longest_gap:.3g} s"
)
SIGNAL = "{low:.4g} | {high:.4g} | {noise:.4g} | {step:.4g} | {saturated:.4g}"
DYNAMICS = (
    "excitation: condition number {condition:.4g}; as read, the equations of motion explain "
    "{explained:.1%} of the torques: k4 {weight1:.3g} N m, k2 {weight2:.3g} N m"
)


def inspection_content(found: Inspection) -> Iterator[Table | str]:
    """Tables, and lines between them, from what the log holds to what is wrong with it."""
    synthetic = ", synthetic" if found.synthetic else ""
    yield f"{visible(found.path, 1000)}: {found.format}{synthetic}"
    rows, shown, left = [], found.entries[:MOST_SHOWN], len(found.entries) - MOST_SHOWN
    for one in shown:
        count = "" if one.count is None else f"{one.count}"
        rows.append((one.name, one.type, count, "" if one.rate is None else f"{one.rate:.4g}"))
    if rows:
        note = f"and {left} more" if left > 0 else ""
        yield Table("Channels", "Name | Type | Samples | Hz", rows, note)
    for one in shown:
        if one.joints or one.fields:
            joints = f"joints {', '.join(one.joints)}; " if one.joints else ""
            fields = joined(one.fields, MOST_FIELDS) or "without a number"
            yield visible(f"{one.name}: {joints}fields {fields}", 2000)
    if found.mapping:
        yield Table("Taken as", "algid | log", sorted(found.mapping.items()))
    if found.clock is not None:
        yield CLOCK.format(**vars(found.clock))
    if found.signals:
        figures = [
            (name, *SIGNAL.format(**vars(of)).split(" | ")) for name, of in found.signals.items()
        ]
        yield Table("Signals", "Channel | Low | High | Noise | Step | Saturated share", figures)
    if found.dynamics is not None:
        yield DYNAMICS.format(**vars(found.dynamics)).replace("%", " %")
    for notice in (*found.notices, *found.findings):
        yield f"{notice.code}: {visible(notice.clause, 2000)}"
    refusing = joined(codes_of(one for one in found.findings if one.refuse))
    if refusing or found.refused:
        yield f"refused: {refusing or visible(found.refused or '', 2000)}"
