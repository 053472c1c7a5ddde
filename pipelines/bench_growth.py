"""How processor time and memory grow with samples, logs and terms, and the exponent between the
largest two.

    python -m pipelines.bench_growth -o build/growth [--samples 7] [--logs 300] [--rounds 2]

Whole processes, less the smallest of each table, which stands for the start-up.

======  =====================================================================
symbol  name
======  =====================================================================
e       exponent: log of the ratio of processor times over that of the sizes
======  =====================================================================
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

from algid.model import CHOICES
from pipelines import bench_logs
from pipelines.bench import identify
from pipelines.bench_processor import many_logs
from pipelines.bench_run import Cost, run

LOGS = (1, 10, 100, 300)
TERMS = (0, 3, 6, 9)
STEEPEST = 1.1
FEWEST_SECONDS = 0.2  # of processor above the start-up: an exponent of less is noise


def main() -> None:
    """Run all sizes and tell."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--out", type=Path, default=Path("build/growth"))
    parser.add_argument("--samples", type=int, default=7, help="the largest power of ten")
    parser.add_argument("--logs", type=int, default=300, help="the most logs")
    parser.add_argument("--rounds", type=int, default=2, help="runs, of which the least counts")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    text = "\n".join(
        table(f"{kind}, {name}", sizes, [_least(one, given.rounds) for one in commands])
        for kind, flags in (("weak", ("--estimator", "weak")), ("refined", ()))
        for name, sizes, commands in _tables(given.out, given.samples, given.logs, flags)
    )
    (given.out / "growth.md").write_text(text, encoding="utf-8")
    print(text)


def _tables(
    folder: Path, largest: int, most: int, flags: Sequence[str]
) -> list[tuple[str, Sequence[int], list[list[str]]]]:
    """By what grows its sizes and a command for each."""
    out, bare = folder / "out", ("--no-report", *flags)
    samples = [10**power for power in range(3, largest + 1)]
    lengths = [bench_logs.parquet(folder / f"rows{n}.parquet", n) for n in samples]
    counts = [count for count in LOGS if count <= most]
    many = many_logs(folder / "many", max(counts))
    motions = tuple(term for term in CHOICES if term != "delay")
    ten = bench_logs.parquet(folder / "rows100000.parquet", 100_000)
    return [
        ("samples", samples, [identify(log, out, *bare) for log in lengths]),
        (
            "logs of 5 s",
            counts,
            [
                identify(many[0], out, *bare, "--name", "many", *map(str, many[1:count]))
                for count in counts
            ],
        ),
        (
            "terms of a log of 100 s",
            TERMS,
            [
                identify(ten, out, *bare, "--model", ",".join(motions[:count]) or "plain")
                for count in TERMS
            ],
        ),
    ]


def _least(command: Sequence[str], rounds: int) -> Cost:
    costs = [run(command) for _ in range(rounds)]
    return min(costs, key=lambda cost: cost.cpu)


def table(what: str, sizes: Sequence[int], costs: Sequence[Cost]) -> str:
    """Markdown: a line a size, and the exponent between the largest two."""
    lines = [f"| {what} | processor s | wall s | peak, MB |", "|---|---|---|---|"]
    for size, cost in zip(sizes, costs, strict=True):
        lines.append(f"| {size:,} | {cost.cpu:.2f} | {cost.wall:.2f} | {cost.peak:.0f} |")
    own = [cost.cpu - costs[0].cpu for cost in costs[-2:]]
    if min(own) > FEWEST_SECONDS and sizes[-2] > 0:
        e = math.log(own[1] / own[0]) / math.log(sizes[-1] / sizes[-2])
        lines.append(f"| exponent between the last two (at most {STEEPEST}) | {e:.2f} | | |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
