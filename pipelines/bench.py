"""Time algid and its peers on the same logs in the same run, interleaved, and tell medians, ratios
and memory.

Usage: python -m pipelines.bench [-o FOLDER] [--rounds N] [--day]

Writes bench.md, bench.parquet (the table) and runs.parquet (every run). Each contender is a
process of its own; its start-up is the same process on a log of one second. `--day` takes 24 h of
log instead.
"""

from __future__ import annotations

import argparse
import os
import platform
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import polars as pl

from pipelines import bench_logs
from pipelines.bench_run import Cost, middle, python, run
from pipelines.bench_stages import stages
from pipelines.bench_table import Row, day_rows, markdown, rows

HOUR, MILLION, DAY = 3_600_000, 1_000_000, 86_400_000
_QUICK = 3  # runs a round of what takes a second: a start-up is taken from it, and both scatter
EMPTY_APP = (
    "import click\napp = click.Group()\nfor n in ('a', 'b'): app.command(n)(lambda: None)\napp()"
)


@dataclass
class Contender:
    """A command, the rounds it takes part in, how many `times` in each, and what its runs cost."""

    name: str
    command: Sequence[str]
    rounds: int = 99
    times: int = 1
    costs: list[Cost] = field(default_factory=list)
    failed: str = ""

    def go(self, number: int) -> None:
        """Run once, if this round is one of its own."""
        if number >= self.rounds or self.failed:
            return
        try:
            self.costs.append(run(self.command))
        except RuntimeError as error:
            self.failed = str(error).strip().splitlines()[-1]


def identify(log: Path, out: Path, *flags: str) -> list[str]:
    """The command that identifies a log, without pages unless `flags` say otherwise."""
    return python("-m", "algid", "identify", str(log), "-o", str(out), "--force", "-q", *flags)


def peer(name: str, log: Path) -> list[str]:
    """The command of a peer."""
    return python("-W", "ignore", "-m", "pipelines.bench_peers", name, str(log))


def contenders(folder: Path) -> list[Contender]:
    """Everything that is timed, peers beside algid; builds the logs."""
    second = bench_logs.parquet(folder / "second.parquet", 1000)
    ten = bench_logs.parquet(folder / "ten.parquet", 10_000)
    million = bench_logs.parquet(folder / "million.parquet", MILLION)
    hour = bench_logs.parquet(folder / "hour.parquet", HOUR)
    out = folder / "out"
    weak = ("--estimator", "weak", "--no-report")
    found = [
        Contender("polars", peer("polars", million), times=_QUICK),
        Contender("help", python("-m", "algid", "--help"), times=_QUICK),
        Contender("empty click help", python("-c", EMPTY_APP, "--help"), times=_QUICK),
        Contender("ten seconds, report", identify(ten, out)),
        Contender("second, report", identify(second, out)),
    ]
    for name, log in (("second", second), ("million", million)):
        found.append(
            Contender(f"weak {name}", identify(log, out, *weak, "--model", "plain"), times=_QUICK)
        )
        found.append(Contender(f"chosen {name}", identify(log, out, *weak), times=_QUICK))
        found.append(
            Contender(f"paper {name}", identify(log, out, "--estimator", "paper", "--no-report"))
        )
        found += [
            Contender(f"{p} {name}", peer(p, log), rounds=3) for p in ("least_squares", "pysindy")
        ]
        found.append(Contender(f"pinocchio {name}", peer("pinocchio", log), rounds=1))
    found.append(Contender("refined second", identify(second, out, "--no-report")))
    found.append(Contender("refined hour", identify(hour, out, "--no-report"), rounds=2))
    return found + readers(folder)


def readers(folder: Path) -> list[Contender]:
    """Readers of a bag of 100,000 joint states; none without the package that writes it."""
    try:
        bag = bench_logs.bag(folder / "bag", 100_000)
    except ImportError:
        return []
    return [
        Contender(f"{name} bag", peer(name, bag), rounds=2)
        for name in ("algid_reader", "mcap_ros2", "rosbags")
    ]


def day(folder: Path) -> list[Contender]:
    """An hour and a day of log in both formats; the files of a day take 7 GB."""
    found = []
    for kind, build in (("parquet", bench_logs.parquet), ("mcap", bench_logs.mcap)):
        for name, samples in (("second", 1000), ("hour", HOUR), ("day", DAY)):
            command = identify(
                build(folder / f"{name}.{kind}", samples),
                folder / "out",
                "--estimator",
                "weak",
                "--no-report",
            )
            found.append(Contender(f"{kind} {name}", command, rounds=1 if name == "day" else 3))
    return found


def write(
    folder: Path,
    table: Sequence[Row],
    runs: Sequence[Contender],
    extra: str = "",
    name: str = "bench",
) -> None:
    """Write the table as Markdown and Parquet, and every run."""
    machine = (
        f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, "
        f"polars {pl.__version__}"
    )
    load = "load average before and after: {:.1f}, {:.1f}".format(*_LOADS[:1], os.getloadavg()[0])
    (folder / f"{name}.md").write_text(
        f"{markdown(table)}\n{machine}; {load}.\n{extra}", encoding="utf-8"
    )
    pl.DataFrame([vars(row) for row in table]).write_parquet(folder / f"{name}.parquet")
    raw = [
        {
            "contender": one.name,
            "round": number,
            "wall_s": cost.wall,
            "cpu_s": cost.cpu,
            "peak_mb": cost.peak,
        }
        for one in runs
        for number, cost in enumerate(one.costs)
    ]
    pl.DataFrame(raw).write_parquet(folder / f"{name}_runs.parquet")


_LOADS = [os.getloadavg()[0]]


def main() -> None:
    """Build, run, tell."""
    parser = argparse.ArgumentParser()
    parser.add_argument("-o", "--out", type=Path, default=Path("build/bench"))
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--day", action="store_true")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    taking_part = day(given.out) if given.day else contenders(given.out)
    for number in range(given.rounds):
        for turn in range(_QUICK):  # the machine's speed drifts: what is compared runs side by side
            for contender in taking_part:
                if turn < contender.times:
                    contender.go(number)
    costs = {one.name: middle(one.costs) for one in taking_part if one.costs}
    failed = {one.name: one.failed for one in taking_part if one.failed}
    if given.day:
        write(given.out, day_rows(costs, failed), taking_part, name="days")
        print((given.out / "days.md").read_text(encoding="utf-8"))
        return
    profile = stages(given.out / "million.parquet")
    write(given.out, rows(costs, failed), taking_part, profile)
    print((given.out / "bench.md").read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
