"""`algid inspect`: what a log holds and is worth, before anyone identifies anything."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from algid.cli.output import console, say
from algid.cli.settings import Choice, takes_profile
from algid.exits import Exit, exit_of
from algid.words import counted

if TYPE_CHECKING:
    from rich.console import Console

    from algid.inspection.report import Inspection

MOST_SHOWN = 100
"""Entries of a log that are listed."""


@takes_profile
def inspect(
    choice: Choice,
    log: Annotated[Path, typer.Argument(help="CSV, Parquet or MCAP log, or a rosbag2 folder.")],
    output: Annotated[
        Literal["table", "json"], typer.Option("--format", help="table or json.")
    ] = "table",
) -> None:
    """Show what a log holds, which channels would be used, and what is wrong with it.

    Example: algid inspect arm.mcap --joints shoulder,elbow --zero hanging

    Raises
    ------
    typer.Exit
        At the end: with 2 for a log that would be refused, 3 where physics contradicts its
        convention, 4 where samples are missing, else with 0.
    """
    import json

    from algid.inspection.report import inspect_log

    found = inspect_log(log, choice.profile())
    if output == "json":
        say(json.dumps(found.as_dict(), indent=2))
    else:
        terminal = console(highlight=False)
        _print_content(found, terminal)
        _print_worth(found, terminal)
    raise typer.Exit(
        Exit.USAGE if found.refused else exit_of(failed=found.contradicted, lost=found.lossy)
    )


def _print_content(found: Inspection, console: Console) -> None:
    """What the log holds, and which of it would be used."""
    from rich.markup import escape

    console.print(
        f"{escape(plain(found.path))}: {found.format}{', synthetic' if found.synthetic else ''}"
    )
    shown = found.entries[:MOST_SHOWN]
    rows = [
        (one.name[:80], one.type[:60], _known(one.count, "d"), _known(one.rate, ".4g"))
        for one in shown
    ]
    if len(found.entries) > len(shown):
        rows.append((f"and {len(found.entries) - len(shown)} more", "", "", ""))
    rated = any(one.rate for one in shown)
    header = ("name", "type", "samples", "Hz")
    _table(
        console,
        "channels",
        header if rated else header[:3],
        rows if rated else [row[:3] for row in rows],
    )
    for entry in shown:
        if entry.joints or entry.fields:
            joints = f"joints {', '.join(entry.joints)}; " if entry.joints else ""
            fields = ", ".join(entry.fields[:12]) + (" …" if len(entry.fields) > 12 else "")
            console.print(
                escape(plain(f"{entry.name}: {joints}fields {fields or 'without a number'}"))
            )
    _table(console, "taken as", ("algid", "log"), sorted((found.mapping or {}).items()))


def _known(value: float | None, form: str) -> str:
    return "" if value is None else format(value, form)


def _print_worth(found: Inspection, console: Console) -> None:
    """What the log is worth: figures of clock, signals and dynamics, then what was found wrong."""
    from rich.markup import escape

    if found.clock is not None:
        clock = found.clock
        console.print(
            f"{counted(clock.rows, 'sample')}, {clock.duration:.6g} s at {clock.rate:.6g} Hz, "
            f"jitter {clock.jitter * 1e3:.3g} ms, {counted(clock.gaps, 'gap')}, the longest {clock.longest_gap:.3g} s"
        )
    signals = [
        (
            name,
            *(
                f"{value:.4g}"
                for value in (one.low, one.high, one.noise, one.step, 100 * one.saturated)
            ),
        )
        for name, one in (found.signals or {}).items()
    ]
    _table(console, "signals", ("channel", "low", "high", "noise", "step", "saturated %"), signals)
    if found.dynamics is not None:
        rough = found.dynamics
        console.print(
            f"excitation: condition number {rough.condition:.4g}; rough fit explains "
            f"{100 * rough.explained:.3g} % of the torques, "
            f"gravity {100 * rough.gravity_share:.3g} %: k4 {rough.weight1:.3g} N m, "
            f"k2 {rough.weight2:.3g} N m, turned by {round(rough.turn)}°"
        )
    for notice in found.notices:
        console.print(f"{notice.code}: {escape(plain(notice.clause))}")
    for finding in found.findings:
        console.print(f"{finding.code}: {escape(plain(finding.clause))}")
    if found.refused:
        console.print(f"refused: {escape(plain(found.refused))}")


def plain(text: str) -> str:
    """The text without control characters: names in a log are another's words."""
    return "".join(letter if letter.isprintable() else "\ufffd" for letter in text)


def _table(
    console: Console, title: str, header: tuple[str, ...], rows: Sequence[tuple[str, ...]]
) -> None:
    from rich.markup import escape
    from rich.table import Table

    if rows:
        table = Table(*header, title=title, title_justify="left")
        for row in rows:
            table.add_row(*(escape(plain(cell)) for cell in row))
        console.print(table)
