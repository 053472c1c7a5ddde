"""Give algid hostile logs, calls, records and folders.

    python -m pipelines.fuzz [CASES] [SEED] [SOURCE …]

A case is made of its seed: a log of damaged bytes, one that lies by its structure, a folder of such
logs for a batch, a call, or records and folders of a batch. It may end in an answer or in one line;
a crash, a traceback, a hang, much memory, or a wrong result without a word fails. Cases run in
processes of their own, so that a crash is a finding and not the end.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import NoReturn

from pipelines import fuzz_batches, fuzz_calls, fuzz_files
from pipelines.hostile import FINE

CASES = 20_000
BATCH = 500  # cases of a process
SECONDS = {"calls": 20, "batches": 20}
"""Of a processor, that a case may take; 5 for those of other sources. A busy machine is no hang."""
WAITED = 600  # s: a case that has not ended then waits
MEMORY, ADDRESSES = 1 << 30, 6 << 30  # addresses: numpy and polars take two before they begin
SOURCES: dict[str, Callable[[Path, range], Iterator[Callable[[], tuple[str, str]]]]] = {
    "damaged": fuzz_files.damaged,
    "hostile": fuzz_files.hostile,
    "folders": fuzz_files.folders,
    "calls": fuzz_calls.calls,
    "batches": fuzz_batches.batches,
}


def fuzzed(source: str, seeds: range) -> int:
    """Print what came of the cases of a source, and count those that failed."""
    total: Counter[str] = Counter()
    slowest, most, first = 0.0, 0, seeds.start
    with tempfile.TemporaryDirectory(prefix="algid-fuzz-") as folder:
        while first < seeds.stop:
            last = min(first + BATCH, seeds.stop)
            words = ["child", source, folder, str(first), str(last)]
            command = [sys.executable, "-m", "pipelines.fuzz", *words]
            with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
                assert running.stdout is not None
                for line in running.stdout:
                    kind, text, seconds, memory = json.loads(line)
                    total[kind] += 1
                    slowest, most = max(slowest, seconds), max(most, memory)
                    if kind not in FINE:
                        print(f"{kind}: {source}, seed {first}: {text}", flush=True)
                    first += 1
            if first < last:
                total["crash"] += 1
                print(f"crash: {source}, seed {first}: exit {running.returncode}", flush=True)
                first += 1
    print(f"{len(seeds)} {source}: {dict(total)}; at most {most >> 20} MB, {slowest:.1f} s")
    return sum(total[kind] for kind in total if kind not in FINE) + (most > MEMORY)


def child(source: str, folder: Path, seeds: range) -> None:
    """Run cases, and print what came of each as a line of JSON."""
    out = os.fdopen(os.dup(1), "w")
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    signal.signal(signal.SIGPROF, _stop)
    signal.signal(signal.SIGALRM, _stop)
    for case in SOURCES[source](folder, seeds):
        start = time.process_time()
        signal.setitimer(signal.ITIMER_PROF, SECONDS.get(source, 5))
        signal.alarm(WAITED)
        try:
            kind, text = case()
        except SystemExit:
            kind, text = "hang", ""
        except BaseException:  # whatever it raises that is no message
            kind, text = "traceback", traceback.format_exc()[-1500:]
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
            signal.alarm(0)
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        print(json.dumps([kind, text, time.process_time() - start, memory]), file=out, flush=True)


def _stop(_number: int, _frame: FrameType | None) -> NoReturn:
    signal.alarm(5)  # again, should a library hold it back
    raise SystemExit(142)


def main(words: list[str]) -> int:
    """Go over the sources; those of files where none is named."""
    cases = int(words[0]) if words else CASES
    seed = int(words[1]) if len(words) > 1 else 1
    failed = 0
    for source in words[2:] or ("damaged", "hostile", "folders"):
        count = -(-cases // fuzz_files.FILES) if source == "folders" else cases
        failed += fuzzed(source, range(seed, seed + count))
    return int(failed > 0)


if __name__ == "__main__":
    if sys.argv[1:2] == ["child"]:
        child(sys.argv[2], Path(sys.argv[3]), range(int(sys.argv[4]), int(sys.argv[5])))
    else:
        sys.exit(main(sys.argv[1:]))
