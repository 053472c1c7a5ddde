"""The tables of a track: finished text that terminal, Markdown and HTML merely set."""

from __future__ import annotations

import math

from algid.report.facts import settings_table, tables_of
from algid.report.numbers import ABSENT, significant
from algid.report.table import Column, Table
from algid.report.text import file_name, visible
from algid.track.payload import Stretch
from algid.track.result import TrackResult

COLUMNS = (
    Column("Stretch", "name"),
    Column("From, s", "number"),
    Column("To, s", "number"),
    Column("Payload", "number"),
    Column("± 95 %", "number"),
    Column("Unit", "text"),
    Column("Status", "status"),
    Column("95 % interval", "number", rank=3),
    Column("Truth", "number", rank=1),
    Column("Error", "number", rank=2),
)


def stretch_table(result: TrackResult) -> Table:
    """The stretches, their masses and intervals."""
    rows = tuple(
        _row(place, stretch, status.value, result.truth(stretch))
        for place, (stretch, status) in enumerate(zip(result.track.stretches, result.statuses, strict=True), start=1)
    )
    return Table("Payload by stretch", COLUMNS, rows).without_empty()


def _row(place: int, stretch: Stretch, status: str, truth: float | None) -> tuple[str, ...]:
    low, high = (fixed(end, stretch.std) for end in stretch.ci95)
    return (
        str(place),
        f"{stretch.start:.3f}",
        f"{stretch.end:.3f}",
        mass_text(stretch),
        half_text(stretch),
        "kg",
        status,
        f"[{low}, {high}]",
        ABSENT if truth is None else fixed(truth, stretch.std),
        ABSENT if truth is None else fixed(stretch.m_p - truth, stretch.std),
    )


def change_table(result: TrackResult) -> Table:
    """When the payload changed, and by how much."""
    columns = (
        Column("Change", "name"),
        Column("At, s", "number"),
        Column("Between, s", "number", rank=1),
        Column("By", "number"),
        Column("Unit", "text"),
        Column("Truth at, s", "number", rank=2),
    )
    stretches = result.track.stretches
    rows = tuple(
        (
            str(place + 1),
            f"{moment:.3f}",
            f"[{low:.3f}, {high:.3f}]",
            _signed(stretches[place + 1].m_p - stretches[place].m_p, max(s.std for s in stretches[place : place + 2])),
            "kg",
            ABSENT if (true := _true_change(result, moment)) is None else f"{true:.3f}",
        )
        for place, (moment, low, high) in enumerate(result.track.changes.tolist())
    )
    note = "Times between tell neither mass: a grasp jolts the arm."
    return Table("Changes", columns, rows, note).without_empty()


def _true_change(result: TrackResult, moment: float) -> float | None:
    times = [time for time, _ in result.schedule or () if time > 0]
    return min(times, key=lambda time: abs(time - moment), default=None)


def quality_tables(result: TrackResult) -> list[Table]:
    """The log, its channels, and where it has no samples."""
    log, channels = tables_of([result.log])
    kept = [i for i, column in enumerate(log.columns) if column.heading != "Arm"]
    holes = tuple((f"{start:.3f}", f"{end:.3f}") for start, end in result.track.holes.tolist())
    table = Table("Times without samples", (Column("From, s", "name"), Column("To, s", "number")), holes)
    return [log.only(kept), channels.only([0, 1]), *([table] if holes else [])]


def fit_table(result: TrackResult) -> Table:
    """What the track leaves of the torque."""
    rows = (
        ("torque explained by arm and payload, noise aside", _percent(result.track.explained)),
        ("slow errors and noise over the sensors' noise", significant(math.sqrt(result.track.colour), 3)),
    )
    return Table("Fit", (Column("What", "name"), Column("Value", "number")), rows)


def _percent(share: float) -> str:
    """A share in percent, never rounded up to all."""
    return f"{100 * share:.2f} %" if share <= 0.9999 else "over 99.99 %"


def provenance_tables(result: TrackResult) -> list[Table]:
    """What the track was made with, from what."""
    rows = (
        ("algid", visible(result.version)),
        ("arm's result", visible(result.arm)),
        ("sha256 of the arm's result", visible(result.arm_sha256)),
        ("path of the log", visible(result.log.path)),
        (f"sha256 of {file_name(result.log.path)}", visible(result.log.sha256 or "unknown, fetched in part")),
    )
    return [
        settings_table(result.settings),
        Table("Provenance", (Column("What", "name"), Column("Value", "text")), rows),
    ]


def mass_text(stretch: Stretch) -> str:
    """A stretch's mass in kg, down to the second digit of its standard deviation."""
    return fixed(stretch.m_p, stretch.std)


def half_text(stretch: Stretch) -> str:
    """Half the 95 % interval in kg, with the mass's digits."""
    return fixed(stretch.ci95[1] - stretch.m_p, stretch.std)


def fixed(value: float, std: float) -> str:
    """`value` with as many decimals as its standard deviation resolves, so that a column lines up."""
    decimals = 3 if not (math.isfinite(std) and std > 0) else min(max(1 - math.floor(math.log10(std)), 0), 9)
    text = f"{value:.{decimals}f}"
    return text.removeprefix("-") if float(text) == 0 else text


def _signed(value: float, std: float) -> str:
    text = fixed(value, std)
    return text if text.startswith("-") else f"+{text}"
