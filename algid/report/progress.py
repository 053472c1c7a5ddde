"""Progress of long work: on standard error, and only on a terminal."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from algid.base.progress import Progress

WIDEST = 40
BESIDE = 60  # columns that words, counts and the time left take beside the bar


@contextmanager
def progress(unit: str, quiet: bool = False) -> Iterator[Progress | None]:
    """Show a bar while the block runs.

    Give what the block is to tell its progress to, None where nobody looks.

    What is done of each stage is counted in `unit`. The bar is gone once the block has ended.
    """
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    width = min(max(console.width - BESIDE, 4), WIDEST)
    counts = TextColumn("{task.fields[counts]}", markup=False)
    parts = (
        TextColumn("{task.description}", markup=False),
        BarColumn(width),
        counts,
        TimeRemainingColumn(),
    )
    with Progress(*parts, console=console, transient=True, redirect_stdout=False) as bar:

        def shown(stage: str, done: int, total: int) -> None:
            known = total if total >= done else 0
            counts = f"{done:,} of {known:,} {unit}" if known else f"{done:,} {unit}" * (done > 0)
            task = bar.tasks[0] if bar.tasks else None
            if task is None or (task.description, task.total) != (stage, known or None):
                for before in bar.task_ids:
                    bar.remove_task(before)
                bar.add_task(stage, total=known or None, completed=done, counts=counts)
            else:
                bar.update(task.id, completed=done, counts=counts)

        yield shown
