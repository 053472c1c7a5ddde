"""The table of `bench`: figures asked for beside figures measured."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pipelines.bench_run import Cost

PEERS = {
    "least_squares": "filtered least squares, numpy and scipy",
    "pysindy": "PySINDy's weak form",
    "pinocchio": "FIGAROH's regressor path, pinocchio",
}
READERS = {"mcap_ros2": "mcap-ros2-support", "rosbags": "rosbags"}
_HOUR, _DAY = 3600.0, 86400.0


@dataclass(frozen=True)
class Row:
    """One figure: what, what is asked, what was measured, how it came about, peak memory in MB."""

    what: str
    asked: str
    measured: str
    detail: str
    peak_mb: float | None


def markdown(table: Sequence[Row]) -> str:
    """The rows as a Markdown table."""
    lines = ["| what | asked | measured | told | peak, MB |", "|---|---|---|---|---|"]
    for row in table:
        peak = "" if row.peak_mb is None else f"{row.peak_mb:.0f}"
        lines.append(f"| {row.what} | {row.asked} | {row.measured} | {row.detail} | {peak} |")
    return "\n".join(lines) + "\n"


def rows(costs: Mapping[str, Cost], failed: Mapping[str, str]) -> list[Row]:
    """The table of the default run."""
    return [*_weak(costs), *_peers(costs, failed), *_others(costs), *_readers(costs, failed)]


def _net(costs: Mapping[str, Cost], name: str, size: str = "million") -> float:
    """Seconds of a run less its start-up."""
    return costs[f"{name} {size}"].wall - costs[f"{name} second"].wall


def _busy(costs: Mapping[str, Cost], name: str) -> float:
    """Processor seconds of a run less its start-up: what other work on the machine moves least."""
    return costs[f"{name} million"].cpu - costs[f"{name} second"].cpu


def _weak(costs: Mapping[str, Cost]) -> list[Row]:
    ours, theirs = _net(costs, "weak"), float(json.loads(costs["polars"].output))
    detail = (
        f"{ours:.3f} s less start-up against {theirs:.4f} s; processor {_busy(costs, 'weak'):.3f} s"
    )
    peak = costs["weak million"].peak
    chosen = _net(costs, "chosen")
    return [
        Row(
            "weak, 1,000,000 samples of Parquet, to polars reading them",
            "≤ 10",
            f"{ours / theirs:.1f}",
            detail,
            peak,
        ),
        Row(
            "the same, and the torque's terms chosen",
            "",
            f"{chosen / theirs:.1f}",
            f"{chosen:.3f} s",
            None,
        ),
    ]


def _peers(costs: Mapping[str, Cost], failed: Mapping[str, str]) -> list[Row]:
    ours = _net(costs, "weak")
    found = []
    for peer, name in PEERS.items():
        if f"{peer} million" not in costs:
            why = failed.get(f"{peer} second") or failed.get(f"{peer} million", "")
            found.append(Row(f"{name}, to weak", "≥ 5", "did not run", why.replace("|", "/"), None))
            continue
        theirs = _net(costs, peer)
        whole, own = costs[f"{peer} million"].wall, costs["weak million"].wall
        busy = _busy(costs, peer) / _busy(costs, "weak")
        detail = (
            f"{theirs:.2f} s less start-up, processor {busy:.1f}; whole processes "
            f"{whole:.2f} s against {own:.2f} s"
        )
        found.append(
            Row(
                f"{name}, to weak",
                "≥ 5",
                f"{theirs / ours:.1f}",
                detail,
                costs[f"{peer} million"].peak,
            )
        )
    return found


def _others(costs: Mapping[str, Cost]) -> list[Row]:
    refined, paper, ten = (
        costs["refined hour"],
        costs["paper million"],
        costs["ten seconds, report"],
    )
    second, shown = costs["refined second"], costs["second, report"]
    times, each = _HOUR / refined.wall, 1e6 * _net(costs, "paper") / 1e6
    ours, theirs = costs["help"].wall, costs["empty click help"].wall
    wall = f"{refined.wall:.1f} s, start-up included; processor {refined.cpu:.1f} s"
    return [
        Row(
            "refined, an hour at 1 kHz, times real time",
            "≥ 100, aim 200",
            f"{times:.0f}",
            wall,
            refined.peak,
        ),
        Row(
            "paper's series, µs a sample",
            "≤ 5",
            f"{each:.2f}",
            f"{paper.wall:.2f} s in all",
            paper.peak,
        ),
        Row(
            "ten seconds, refined, report, s",
            "≤ 2.5",
            f"{ten.wall:.2f}",
            f"processor {ten.cpu:.2f} s",
            ten.peak,
        ),
        Row(
            "one second, refined, no report, s",
            "≤ 0.5",
            f"{second.wall:.2f}",
            f"processor {second.cpu:.2f} s",
            None,
        ),
        Row(
            "one second, refined, report, s",
            "≤ 0.6",
            f"{shown.wall:.2f}",
            f"processor {shown.cpu:.2f} s",
            None,
        ),
        Row(
            "--help to an empty click app's",
            "≤ 1.3",
            f"{ours / theirs:.2f}",
            f"{ours:.3f} s",
            costs["help"].peak,
        ),
    ]


def _readers(costs: Mapping[str, Cost], failed: Mapping[str, str]) -> list[Row]:
    if "algid_reader bag" not in costs:
        return [Row("readers of a bag", "", "did not run", "needs algid[bench]", None)]
    ours = float(json.loads(costs["algid_reader bag"].output))
    found = []
    for peer, name in READERS.items():
        if f"{peer} bag" not in costs:
            found.append(
                Row(
                    f"{name}, 100,000 joint states, to algid",
                    "",
                    "did not run",
                    failed[f"{peer} bag"],
                    None,
                )
            )
            continue
        theirs = float(json.loads(costs[f"{peer} bag"].output))
        detail = f"{theirs:.2f} s against {ours:.3f} s"
        found.append(
            Row(f"{name}, 100,000 joint states, to algid", "", f"{theirs / ours:.0f}", detail, None)
        )
    return found


def day_rows(costs: Mapping[str, Cost], failed: Mapping[str, str]) -> list[Row]:
    """The table of the run over a day."""
    found = []
    for kind in ("parquet", "mcap"):
        if f"{kind} day" not in costs:
            found.append(
                Row(f"{kind}, 24 h", "", "did not run", failed.get(f"{kind} day", ""), None)
            )
            continue
        second, hour, day = (costs[f"{kind} {name}"] for name in ("second", "hour", "day"))
        growth = (day.wall - second.wall) / (_DAY / _HOUR) / (hour.wall - second.wall)
        busy = (day.cpu - second.cpu) / (_DAY / _HOUR) / (hour.cpu - second.cpu)
        detail = (
            f"{day.wall:.1f} s, processor {day.cpu:.1f} s; an hour {hour.wall:.2f} s, "
            f"start-up {second.wall:.2f} s"
        )
        found += [
            Row(
                f"{kind}, 24 h at 1 kHz, peak memory, MB",
                "≤ 1000",
                f"{day.peak:.0f}",
                detail,
                day.peak,
            ),
            Row(
                f"{kind}, time a sample, 24 h to 1 h",
                "≤ 1.1",
                f"{growth:.2f}",
                f"of the processor {busy:.2f}",
                None,
            ),
        ]
    return found
