"""Processor seconds, user and system, wall time and memory of algid and its peers as whole
processes: the least of interleaved runs.

    python -m pipelines.bench_processor -o build/bench --rounds 5 [--day]

Wall time is told beside the processor's: algid reads and hashes in threads, its peers do not. What
compares with a peer is the difference to a log of one second, so that neither's imports count. The
real arm takes part where `--data` is. `--day` takes a log of 24 h instead, 7 GB of disk. Writes
processor.md or day.md.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from algid.arm import inverse_dynamics
from algid.log import Log, Origin
from algid.synth.cases import load_case
from algid.writers import write_log
from pipelines import bench_logs

HOUR, MILLION, DAY = 3_600_000, 1_000_000, 86_400_000
MANY, MANY_ROWS = 300, 5000
DFKI = Path("dfki") / "C1_sysid"
EMPTY_APP = (
    "import click\napp = click.Group()\nfor n in ('a', 'b'): app.command(n)(lambda: None)\napp()"
)
PEERS = {
    "least_squares": "filtered least squares, numpy and scipy",
    "pysindy": "PySINDy's weak form",
    "pinocchio": "FIGAROH's regressor path, pinocchio",
}

# A process inherits the peak memory of the one that starts it: a small one stands in between.
_LAUNCH = """
import json, resource, subprocess, sys, time
start = time.perf_counter()
code = subprocess.run(sys.argv[1:], stderr=subprocess.STDOUT).returncode
wall = time.perf_counter() - start
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print()
print(json.dumps([code, wall, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024]))
"""


@dataclass(frozen=True)
class Cost:
    """Wall and processor time in s, peak memory in MB, and what was printed, of one run."""

    wall: float
    cpu: float
    peak: float
    output: str


@dataclass
class Timed:
    """A command, in how many of the rounds it runs, what its runs cost, or why it failed."""

    command: Sequence[str]
    rounds: int = 99
    costs: list[Cost] = field(default_factory=list)
    failed: str = ""

    def go(self) -> None:
        """Run to the end; BLAS keeps to one thread, for the peers' good as well as algid's.

        Modules are compiled once, as they are where pip has installed them, even if the environment
        forbids it.
        """
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        environment.pop("PYTHONDONTWRITEBYTECODE", None)
        launcher = [sys.executable, "-I", "-S", "-c", _LAUNCH, *self.command]
        done = subprocess.run(launcher, capture_output=True, text=True, env=environment, check=True)
        output, _, figures = done.stdout.rstrip().rpartition("\n")
        code, wall, cpu, peak = json.loads(figures)
        if code in (0, 3):  # 3: algid tells that a constant could not be identified
            self.costs.append(Cost(wall, cpu, peak, output))
        else:
            self.failed = output.strip().rpartition("\n")[2].replace("|", "/") or f"exit {code}"

    @property
    def least(self) -> Cost:
        """The least processor time, wall time and peak memory of all runs."""
        return Cost(
            min(cost.wall for cost in self.costs),
            min(cost.cpu for cost in self.costs),
            min(cost.peak for cost in self.costs),
            min((cost.output for cost in self.costs), key=len),
        )


def python(*arguments: str) -> list[str]:
    """A command for this interpreter."""
    return [sys.executable, *arguments]


def identify(log: Path, out: Path, *flags: str) -> list[str]:
    """The command that identifies a log, with its page unless `flags` say otherwise."""
    return python("-m", "algid", "identify", str(log), "-o", str(out), "--force", "-q", *flags)


def peer(name: str, log: Path) -> list[str]:
    """The command of a peer."""
    return python("-W", "ignore", "-m", "pipelines.bench_peers", name, str(log))


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
    second = bench_logs.log(folder / "second.parquet", 1000)
    ten = bench_logs.log(folder / "ten.parquet", 10_000)
    million = bench_logs.log(folder / "million.parquet", MILLION)
    hour = bench_logs.log(folder / "hour.parquet", HOUR)
    many = [str(path) for path in many_logs(folder / "many")]
    out, bare, weak = folder / "out", ("--no-report",), ("--estimator", "weak", "--no-report")
    paper = ("--estimator", "paper", "--no-report")
    pair = ("--loaded", str(ten))
    together = ("--name", "many", *many[1:])
    synth = ("synth", "case1", "--torque-hold", "zoh", "--duration", "500", "-o", str(out))
    found = {
        "python": Timed(python("-c", "pass")),
        "numpy": Timed(python("-c", "import numpy")),
        "help": Timed(python("-m", "algid", "--help")),
        "empty click help": Timed(python("-c", EMPTY_APP, "--help")),
        "second": Timed(identify(second, out, *bare)),
        "second, page": Timed(identify(second, out)),
        "pair": Timed(identify(ten, out, *pair, *bare)),
        "pair, page": Timed(identify(ten, out, *pair)),
        "polars": Timed(peer("polars_processor", million)),
        "paper second": Timed(identify(second, out, *paper), 3),
        "paper million": Timed(identify(million, out, *paper), 3),
        "weak second": Timed(identify(second, out, *weak)),
        "weak million": Timed(identify(million, out, *weak)),
        "plain second": Timed(identify(second, out, *weak, "--model", "plain")),
        "plain million": Timed(identify(million, out, *weak, "--model", "plain")),
        "hour": Timed(identify(hour, out, *bare), 2),
        "synth": Timed(python("-m", "algid", *synth, "--force"), 1),
        "many weak": Timed(identify(Path(many[0]), out, *weak, *together), 2),
        "many refined": Timed(identify(Path(many[0]), out, *bare, *together), 2),
    }
    for name in PEERS:
        found[f"{name} second"] = Timed(peer(name, second), 2)
        found[f"{name} million"] = Timed(peer(name, million), 2)
    runs = sorted((data / DFKI).glob("*.csv"))
    if runs:
        flags = ("--zero", "hanging", "--name", "real", *map(str, runs[1:]))
        found["real arm"] = Timed(identify(runs[0], out, *bare, *flags), 3)
    return found


def table(timed: Mapping[str, Timed]) -> str:
    """Markdown: a line a figure."""
    costs = {name: one.least for name, one in timed.items() if one.costs}
    lines = ["| what | asked | processor s | wall s | peak, MB |", "|---|---|---|---|---|"]

    def line(what: str, asked: str, name: str, value: str | None = None) -> None:
        if name in costs:
            cost = costs[name]
            shown = f"{cost.cpu:.2f}" if value is None else value
            lines.append(f"| {what} | {asked} | {shown} | {cost.wall:.2f} | {cost.peak:.0f} |")
        elif name in timed:
            lines.append(f"| {what} | {asked} | did not run: {timed[name].failed} | | |")

    def net(name: str) -> float:
        """Processor seconds of a million samples, start-up taken off."""
        return costs[f"{name} million"].cpu - costs[f"{name} second"].cpu

    both = (f"{costs[name].cpu:.3f}" for name in ("python", "numpy"))
    line("python alone, and with numpy", "", "numpy", ", ".join(both))
    share = f"{costs['help'].cpu / costs['empty click help'].cpu:.2f}"
    line("`--help` to an empty click app", "≤ 1.7", "help", share)
    line("one-second Parquet log, no page", "≤ 0.45", "second")
    line("the same, page", "≤ 0.6", "second, page")
    line("ten-second pair, no page", "≤ 0.8", "pair")
    line("ten-second pair, page", "≤ 1.0", "pair, page")
    line("real arm, ten logs, no page", "≤ 1.5", "real arm")
    reading = float(json.loads(costs["polars"].output))
    for name, what in (("plain", "weak, plain model"), ("weak", "weak, terms chosen")):
        ratio = f"{net(name) / reading:.1f} ({net(name):.2f} to {reading:.3f})"
        asked = "≤ 10" if name == "weak" else ""
        line(f"{what}, 1,000,000 samples, to polars' reading", asked, f"{name} million", ratio)
    for name, what in PEERS.items():
        ran = f"{name} million" in costs and f"{name} second" in costs
        ratio = f"{net(name) / net('plain'):.1f}" if ran else ""
        line(f"{what}, to weak, plain model", "≥ 5", f"{name} million", ratio)
    line("paper's series, µs a sample", "≤ 5", "paper million", f"{net('paper'):.2f}")
    hour = f"{3600 / costs['hour'].cpu:.0f} ({costs['hour'].cpu:.1f})"
    line("refined, one hour at 1 kHz, times real time", "≥ 320", "hour", hour)
    line(f"weak, {MANY} logs of 5 s", "≤ 6", "many weak")
    line(f"refined, {MANY} logs of 5 s", "≤ 15", "many refined")
    line("synth, 1,000,000 samples of a held torque", "≤ 30", "synth")
    return "\n".join(lines) + "\n"


def day(folder: Path) -> dict[str, Timed]:
    """An hour and a day of log in both formats, weak."""
    found = {}
    for kind in ("parquet", "mcap"):
        for name, samples in (("second", 1000), ("hour", HOUR), ("day", DAY)):
            log = bench_logs.log(folder / f"{name}.{kind}", samples)
            command = identify(log, folder / "out", "--estimator", "weak", "--no-report")
            found[f"{kind} {name}"] = Timed(command, 1 if name == "day" else 3)
    return found


def day_table(timed: Mapping[str, Timed]) -> str:
    """Markdown: a line a format."""
    head = "| 24 h at 1 kHz, weak | processor s | wall s | peak, MB | time a sample, to 1 h |"
    lines = [head, "|---|---|---|---|---|"]
    for kind in ("parquet", "mcap"):
        second, hour, whole = (timed[f"{kind} {name}"].least for name in ("second", "hour", "day"))
        growth = (whole.cpu - second.cpu) / 24 / (hour.cpu - second.cpu)
        lines.append(
            f"| {kind} | {whole.cpu:.1f} | {whole.wall:.1f} | {whole.peak:.0f} | {growth:.2f} |"
        )
    return "\n".join(lines) + "\n"


def main() -> None:
    """Build, run in turn, tell."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--out", type=Path, default=Path("build/bench"))
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--day", action="store_true")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    timed = day(given.out) if given.day else commands(given.out, given.data)
    load = os.getloadavg()[0]
    for number in range(given.rounds):
        for one in timed.values():
            if number < one.rounds and not one.failed:
                one.go()
    machine = (
        f"\n{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}; "
        f"load average before and after: {load:.1f}, {os.getloadavg()[0]:.1f}.\n"
    )
    text = (day_table if given.day else table)(timed) + machine
    (given.out / f"{'day' if given.day else 'processor'}.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
