"""Processor seconds, user and system, of whole processes: the minimum of interleaved runs.

    python -m pipelines.bench_processor -o build/bench --rounds 5

Wall time is told beside it: algid reads and hashes in threads, its peers do not. What compares
with a peer is the difference to a log of one second, so that neither's imports count. The real arm
takes part where `--data` is.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from algid.arm import inverse_dynamics
from algid.log import Log, Origin
from algid.synth.cases import load_case
from algid.writers import write_log
from pipelines import bench_logs
from pipelines.bench import EMPTY_APP, HOUR, MILLION, identify, peer
from pipelines.bench_run import Cost, python, run

MANY, MANY_ROWS = 300, 5000
DFKI = Path("dfki") / "C1_sysid"


@dataclass
class Timed:
    """A command, in how many of the rounds it runs, and what its runs cost."""

    command: Sequence[str]
    rounds: int = 99
    costs: list[Cost] = field(default_factory=list)

    @property
    def least(self) -> Cost:
        """The least processor time, wall time and peak memory of all runs."""
        return Cost(
            min(cost.wall for cost in self.costs),
            min(cost.cpu for cost in self.costs),
            min(cost.peak for cost in self.costs),
            min((cost.output for cost in self.costs), key=len),
        )


def many_logs(folder: Path, count: int = MANY, rows: int = MANY_ROWS) -> list[Path]:
    """Logs of 5 s at 1 kHz of the paper's first arm, each of a motion of its own."""
    folder.mkdir(parents=True, exist_ok=True)
    k = load_case("case1").arm.constants()
    paths = [folder / f"log{number:03d}.parquet" for number in range(count)]
    for number, path in enumerate(paths):
        if path.exists():
            continue
        theta, omega, alpha = (signal[:, :rows] for signal in bench_logs.motion(number))
        noise = bench_logs.TORQUE_NOISE * np.random.default_rng(number).standard_normal((2, rows))
        tau = inverse_dynamics(k, theta, omega, alpha) + noise
        stamps = bench_logs.START_NS + np.arange(rows) * (10**9 // bench_logs.RATE)
        steps = np.rint(theta / bench_logs.ENCODER_STEP) * bench_logs.ENCODER_STEP
        write_log(path, iter([Log(stamps, steps, tau, Origin("", "", {}))]))
    return paths


def commands(folder: Path, data: Path) -> dict[str, Timed]:
    """Everything that is timed; builds the logs."""
    second = bench_logs.parquet(folder / "second.parquet", 1000)
    ten = bench_logs.parquet(folder / "ten.parquet", 10_000)
    million = bench_logs.parquet(folder / "million.parquet", MILLION)
    hour = bench_logs.parquet(folder / "hour.parquet", HOUR)
    many = [str(path) for path in many_logs(folder / "many")]
    out, bare, weak = folder / "out", ("--no-report",), ("--estimator", "weak", "--no-report")
    pair = ("--loaded", str(ten))
    together = ("--name", "many", *many[1:])
    found = {
        "python": Timed(python("-c", "pass")),
        "numpy": Timed(python("-c", "import numpy")),
        "help": Timed(python("-m", "algid", "--help")),
        "empty click help": Timed(python("-c", EMPTY_APP, "--help")),
        "second": Timed(identify(second, out, *bare)),
        "pair": Timed(identify(ten, out, *pair, *bare)),
        "pair, page": Timed(identify(ten, out, *pair)),
        "polars": Timed(peer("polars_processor", million)),
        "weak second": Timed(identify(second, out, *weak)),
        "weak million": Timed(identify(million, out, *weak)),
        "hour": Timed(identify(hour, out, *bare), 2),
        "synth": Timed(
            python("-m", "algid", "synth", "case1", "--torque-hold", "zoh", "--duration", "500")
            + ["-o", str(out), "--force"],
            1,
        ),
        "many weak": Timed(identify(Path(many[0]), out, *weak, *together), 2),
        "many refined": Timed(identify(Path(many[0]), out, *bare, *together), 2),
    }
    runs = sorted((data / DFKI).glob("*.csv"))
    if runs:
        more = map(str, runs[1:])
        flags = ("--zero", "hanging", "--name", "real", *more)
        found["real arm"] = Timed(identify(runs[0], out, *bare, *flags), 3)
    return found


def table(costs: Mapping[str, Cost]) -> str:
    """Markdown: a line a figure."""
    lines = ["| what | asked | processor s | wall s | peak, MB |", "|---|---|---|---|---|"]

    def line(what: str, asked: str, name: str, value: str | None = None) -> None:
        if name in costs:
            cost = costs[name]
            shown = f"{cost.cpu:.2f}" if value is None else value
            lines.append(f"| {what} | {asked} | {shown} | {cost.wall:.2f} | {cost.peak:.0f} |")

    weak = costs["weak million"].cpu - costs["weak second"].cpu
    reading = float(json.loads(costs["polars"].output))
    line("python alone, and with numpy", "", "numpy", _two(costs, "python", "numpy"))
    line("one-second Parquet log, no page", "≤ 0.45", "second")
    line("ten-second pair, no page", "≤ 0.8", "pair")
    line("ten-second pair, page", "≤ 1.0", "pair, page")
    line("real arm, ten logs, no page", "≤ 1.5", "real arm")
    ratio = f"{weak / reading:.1f} ({weak:.2f} to {reading:.3f})"
    line("weak, 1,000,000 samples of Parquet, to polars' reading", "≤ 10", "weak million", ratio)
    hour = f"{3600 / costs['hour'].cpu:.0f} ({costs['hour'].cpu:.1f})"
    line("refined, one hour at 1 kHz, times real time", "≥ 320", "hour", hour)
    line(f"weak, {MANY} logs of 5 s", "≤ 6", "many weak")
    line(f"refined, {MANY} logs of 5 s", "≤ 15", "many refined")
    line("synth, 1,000,000 samples of a held torque", "≤ 30", "synth")
    share = f"{costs['help'].cpu / costs['empty click help'].cpu:.2f}"
    line("`--help` to an empty click app", "≤ 1.15", "help", share)
    return "\n".join(lines) + "\n"


def _two(costs: Mapping[str, Cost], one: str, other: str) -> str:
    return f"{costs[one].cpu:.3f}, {costs[other].cpu:.3f}"


def main() -> None:
    """Build, run in turn, tell."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--out", type=Path, default=Path("build/bench"))
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    timed = commands(given.out, given.data)
    for number in range(given.rounds):
        for one in timed.values():
            if number < one.rounds:
                one.costs.append(run(one.command))
    text = table({name: one.least for name, one in timed.items()})
    (given.out / "processor.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
