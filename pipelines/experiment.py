"""The command line of an experiment whose table grows row by row."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

Lines = Callable[[int, ProcessPoolExecutor], Iterator[str]]
"""By the number of draws and processes that share them the lines of a table."""


def experiment(name: str, description: str | None, lines: Lines, draws: int, each: str) -> None:
    """Print a table and write it as `build/name/name.md`, or into the folder that is asked for.

    `draws` are made by default of `each`.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--draws", type=int, default=draws, help=f"of each {each}")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("-o", "--output", type=Path, default=Path("build") / name)
    given = parser.parse_args()
    text = []
    with ProcessPoolExecutor(given.processes) as pool:
        for line in lines(given.draws, pool):
            print(line, flush=True)
            text.append(line)
    given.output.mkdir(parents=True, exist_ok=True)
    (given.output / f"{name}.md").write_text("\n".join([*text, ""]), encoding="utf-8")
