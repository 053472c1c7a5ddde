"""What experiments share: rows of draws, the judgement of a result, and a table of columns.

An experiment is a scene, its rows and its columns. Each draw gives what was seen in it, numbers by
key; a column makes one cell of those of a row. Of right intervals a cell of those that hold is
marked with "!" once in a thousand.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binom

from algid.base.errors import exit_of
from algid.results import Result

CHANCE = 1e-3  # that a cell of right intervals is marked
Seen = dict[str, list[Any]]
Column = Callable[[Seen], str]
Rows = Callable[[argparse.Namespace], Iterable[tuple[str, Iterable[tuple[Any, ...]]]]]
"""By the options given the rows of a table: a title, and the arguments of each draw."""


def judged(result: Result, truth: Mapping[str, float]) -> Seen:
    """What is seen in a result: its grade, its codes, and its usable intervals against the truth.

    Under "held" whether intervals hold, under "z" errors in standard deviations, under "error" in
    shares of the truth, all together and by name.
    """
    failed = result.verdict.failed or not result.complete
    seen: Seen = defaultdict(list)
    seen["draw"] = [1]
    seen["good"] = [result.verdict.grade == "good"]
    seen["failed"] = [result.verdict.failed]
    seen["exit 0"] = [not exit_of(failed=failed, lost=result.data_lost)]
    for code in {notice.code for notice in result.notices}:
        seen[code] = [1]
    for name, true in truth.items():
        one = result.estimates.get(name)
        if one is None or not one.usable or one.estimate is None or one.half is None:
            continue
        error = one.estimate - true
        found = {"held": abs(error) <= one.half, "error": error / true if true else np.nan}
        if one.std:
            found["z"] = abs(error) / one.std
        for key, value in found.items():
            seen[key].append(value)
            seen[f"{key} {name}"].append(value)
    return seen


def count(key: str) -> Column:
    """How often something was seen."""
    return lambda seen: str(int(sum(seen[key])))


def share(key: str) -> Column:
    """How many of how many hold, and the mark."""

    def cell(seen: Seen) -> str:
        held, told = int(sum(seen[key])), len(seen[key])
        if not told:
            return "–"
        low, high = binom.interval(1 - CHANCE, told, 0.95)
        return f"{held}/{told}" + ("" if low <= held <= high else " !")

    return cell


def number(key: str, of: Callable[[Any], Any], factor: float = 1.0) -> Column:
    """A statistic of numbers, such as their median."""
    return lambda seen: f"{factor * of(np.array(seen[key])):.3g}" if seen[key] else "–"


def with_error(key: str, of: Callable[[Any], Any], factor: float = 1.0) -> Column:
    """A statistic of the numbers of all draws, ± its standard error over draws by the bootstrap."""

    def cell(seen: Seen) -> str:
        kept = [np.asarray(one)[np.isfinite(one)] for one in seen[key]]
        if not sum(map(len, kept)):
            return "–"
        drawn = np.random.default_rng(0).integers(len(kept), size=(400, len(kept)))
        again = [of(np.concatenate([kept[place] for place in row])) for row in drawn]
        return f"{factor * of(np.concatenate(kept)):.3g} ± {factor * np.nanstd(again):.2g}"

    return cell


def rms(values: Any) -> Any:
    """The root of the mean square."""
    return np.sqrt(np.mean(np.square(values)))


def words(key: str) -> Column:
    """How often each word was seen."""
    return lambda seen: ", ".join(f"{seen[key].count(one)} {one}" for one in sorted({*seen[key]}))


def grid(rows: Mapping[str, tuple[Any, ...]], arms: Sequence[Any]) -> Rows:
    """Rows each of whose draws has the row's arguments, an arm and a seed."""

    def made(given: argparse.Namespace) -> Iterable[tuple[str, Iterable[tuple[Any, ...]]]]:
        seeds = range(given.first, given.first + given.draws)
        draws = [*product(arms[: given.arms], seeds)]
        return ((title, [(*row, *draw) for draw in draws]) for title, row in rows.items())

    return made


def experiment(
    name: str,
    description: str | None,
    rows: Rows,
    draw: Callable[..., Seen],
    columns: Mapping[str, Column],
    draws: int = 10,
) -> Seen:
    """Print a table row by row and write it as `build/name/name.md`, or into the folder asked for.

    Its last row is of all draws together; what was seen in them is returned.
    """
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--draws", type=int, default=draws, help="of each arm and row")
    parser.add_argument("--first", type=int, default=0, help="number of the first draw")
    parser.add_argument("--arms", type=int, help="the first so many, by default all")
    parser.add_argument("--rows", nargs="*", help="words of the titles wanted, by default all")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("-o", "--output", type=Path, default=Path("build") / name)
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    every: Seen = defaultdict(list)
    with (
        (given.output / f"{name}.md").open("w", encoding="utf-8") as file,
        ProcessPoolExecutor(given.processes) as pool,
    ):

        def line(*cells: str) -> None:
            text = f"| {' | '.join(cells)} |"
            print(text, flush=True)
            print(text, file=file, flush=True)

        line("", *columns)
        line(*["---"] * (1 + len(columns)))
        for title, jobs in rows(given):
            if given.rows and not any(word in title for word in given.rows):
                continue
            of_row: Seen = defaultdict(list)
            for seen in pool.map(draw, *zip(*jobs, strict=True)):
                for key, values in seen.items():
                    of_row[key] += values
                    every[key] += values
            line(title, *(cell(of_row) for cell in columns.values()))
        line("all", *(cell(every) for cell in columns.values()))
    return every
