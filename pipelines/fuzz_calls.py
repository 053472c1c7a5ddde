"""Call algid with hostile flags, TOML files and results.

Fail on a traceback, a hang, or what it leaves behind.

Usage: python -m pipelines.fuzz_calls [CALLS] [SEED]

Each call ends with a result, or with one line and an exit code; it takes 20 s of a processor at
most, prints nothing that drives a terminal, and writes nothing outside of the folder it was given,
nor anything half-written within.
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path
from types import FrameType
from typing import NoReturn

from algid.base.faults import EXIT_INTERNAL
from algid.base.text import printable
from pipelines.hostile.calls import Call, draw_call
from pipelines.hostile.places import called, furnish

CALLS = 5_000
SECONDS = 20.0
_BATCH = 250
_MEMORY = 6 << 30  # of addresses, of which numpy and polars take two before they begin
CODES = (0, 1, 2, 3, 4)
FAILURES = (
    "crash",
    "internal",
    "traceback",
    "hang",
    "memory",
    "warning",
    "lines",
    "code",
    "escape",
    "left",
    "json",
)


def main() -> int:
    """Run batches in processes of their own, so that a crash is a finding and not the end."""
    calls = int(sys.argv[1]) if len(sys.argv) > 1 else CALLS
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    total: Counter[str] = Counter()
    slowest, start = 0.0, time.monotonic()
    with tempfile.TemporaryDirectory(prefix="algid-fuzz-") as folder:
        sound = Path(folder, "sound")
        sound.mkdir()
        furnish(sound)
        for first in range(seed, seed + calls, _BATCH):
            count = min(_BATCH, seed + calls - first)
            counts, most = _batched(sound, first, count)
            total, slowest = total + counts, max(slowest, most)
    print(
        f"{calls} calls: {dict(total)}; the slowest {slowest:.1f} s; "
        f"{time.monotonic() - start:.0f} s in all"
    )
    return int(any(total[kind] for kind in FAILURES))


def _batched(sound: Path, first: int, count: int) -> tuple[Counter[str], float]:
    """Run so many calls in a process of their own.

    a crash in one of them is one, and the others go on behind it.
    """
    counts: Counter[str] = Counter()
    slowest = 0.0
    while count > 0:
        command = [sys.executable, "-m", "pipelines.fuzz_calls", str(sound), str(first), str(count)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
            assert running.stdout is not None
            ended = 0
            for line in running.stdout:
                one = json.loads(line)
                ended += 1
                counts[one["kind"]] += 1
                slowest = max(slowest, one["seconds"])
                if one["kind"] in FAILURES:
                    print(f"{one['kind']}: seed {first + ended - 1}, {one['text']}", flush=True)
        if ended == count:
            break
        counts["crash"] += 1
        print(f"crash: seed {first + ended}, exit {running.returncode}", flush=True)
        first, count = first + ended + 1, count - ended - 1
    return counts, slowest


def batch(sound: Path, first: int, count: int) -> None:
    """Make so many calls and print a line of JSON about each."""
    out = os.fdopen(os.dup(1), "w")
    with tempfile.TemporaryDirectory(prefix="algid-fuzz-") as folder:
        outer = Path(folder)
        place = outer / "a" / "b" / "place"
        shutil.copytree(sound, place)
        os.chdir(place)
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
        signal.signal(signal.SIGPROF, _stop)
        os.environ["ALGID_TRACEBACK"] = "1"  # a finding is told with its place
        for seed in range(first, first + count):
            shutil.rmtree("out", ignore_errors=True)
            call = draw_call(seed, place)
            kind, text, seconds = outcome(call, outer)
            print(
                json.dumps({"kind": kind, "text": text, "seconds": seconds}), file=out, flush=True
            )


def _stop(_number: int, _frame: FrameType | None) -> NoReturn:
    signal.signal(signal.SIGALRM, _stop)
    signal.alarm(5)  # again, should a library hold it back
    raise SystemExit(142)


_seen: dict[str, float] = {}
"""Under "used" the seconds of a processor at the last look."""
_LOOK, _LEAST = 120, 0.5
"""Seconds between two looks, and of a processor between them: a call that had fewer only waits."""


def _look(_number: int, _frame: FrameType | None) -> None:
    """Stop a call that has waited since the last look.

    One that computes is stopped by the seconds it has had of a processor, however few a busy
    machine gives it.
    """
    used = time.process_time()
    if used - _seen.get("used", 0.0) < _LEAST:
        _stop(_number, _frame)
    _seen["used"] = used
    signal.alarm(_LOOK)


def outcome(call: Call, outer: Path) -> tuple[str, str, float]:
    """What comes of a call: "done", "refused", or one of `FAILURES`; more of it.

    And how long it took, in s.
    """
    before, own = _listing(outer), {path.name for path in Path().iterdir()}
    start = time.process_time()
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    _seen["used"] = start
    signal.signal(signal.SIGALRM, _look)
    signal.alarm(_LOOK)
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        try:
            code, out, err = called(*call.arguments)
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
            signal.alarm(0)
    seconds = time.process_time() - start
    kind, why = judged(call, code, out, err)
    new = {path.name for path in Path().iterdir()} - own - {"out"}
    outside = _listing(outer) ^ before
    if ".." in call.arguments:  # where the call itself asks to write
        outside = {path for path in outside if Path(path).name.startswith(".")}
    if kind not in FAILURES and (outside or any(name.startswith(".") for name in new)):
        kind, why = "left", f"{sorted(new)} {sorted(outside)}"
    for name in new:
        shutil.rmtree(name, ignore_errors=True) if Path(name).is_dir() else Path(name).unlink()
    told = f"{' '.join(call.arguments)[:500]!r} | {call.note!r} | {why}" if kind in FAILURES else ""
    return kind, told, seconds


def _listing(outer: Path) -> set[str]:
    """What stands in the folders above the call's own."""
    return {
        str(path) for folder in (outer, outer / "a", outer / "a" / "b") for path in folder.iterdir()
    }


def judged(call: Call, code: int, out: str, err: str) -> tuple[str, str]:
    """The kind of an end, and why it is no good."""
    last = err.strip().splitlines()[-3:]
    if code == 142:
        return "hang", ""
    if code == EXIT_INTERNAL:
        return "internal", _trace(err)
    if "not enough memory" in err:
        return "memory", _trace(err)
    if "Warning: " in err:
        return "warning", err[-600:]
    if (
        "Traceback" in err
        and "AlgidError" not in err
        and not any(line.startswith("algid: ") for line in last)
    ):
        return "traceback", _trace(err)
    if code not in CODES:
        return "code", f"{code}: {err[-300:]}"
    own_words = "╰" in err  # typer's box about a wrong call shows the caller's own arguments
    if printable(out) != out or (printable(err) != err and not own_words):
        return "escape", repr((out + err)[-600:])
    told = bool(last) and last[-1].startswith(("algid: ", "╰"))
    # which prints why, among the rest
    if code == 2 and not told and "inspect" not in call.arguments:
        return "lines", err[-600:]
    if code == 2 and "a library cannot take it" in err:
        return "library", ""
    if "json" in call.arguments and code != 2:
        try:
            json.loads(out, parse_constant=_no_number)
        except ValueError as error:
            return "json", f"{error}: {out[-300:]}"
    return ("refused" if code == 2 else "done"), ""


def _trace(err: str) -> str:
    """The places in algid of a traceback, the last ones first, and its last line."""
    lines = [line.strip() for line in err.splitlines()]
    places = [
        line.rpartition("/algid/")[2]
        for line in lines
        if line.startswith("File ") and "/algid/" in line
    ]
    return f"{' < '.join(places[:-6:-1])}: {lines[-2:]}"


def _no_number(word: str) -> NoReturn:
    raise ValueError(f"{word} is no JSON")


if __name__ == "__main__":
    if len(sys.argv) > 3:
        batch(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
        sys.exit(0)
    sys.exit(main())
