"""Read damaged logs and fail on a traceback, a hang, much memory, or a wrong result without a word.

Usage: python -m pipelines.fuzz [FILES] [SEED]
"""

from __future__ import annotations

import random
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from algid.errors import LogError
from algid.log import Log
from algid.readers import read_log
from pipelines.mutations import clean_files, damage

FILES = 20_000
_BATCH = 500
_SECONDS = 5.0
_MEMORY = 1 << 30


def main() -> int:
    """Run batches in processes of their own, so that a crash is a finding and not the end."""
    files = int(sys.argv[1]) if len(sys.argv) > 1 else FILES
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    total: Counter[str] = Counter()
    worst = 0
    for batch in range(0, files, _BATCH):
        command = [
            sys.executable,
            "-m",
            "pipelines.fuzz",
            "--batch",
            str(seed + batch),
            str(min(_BATCH, files - batch)),
        ]
        done = subprocess.run(command, capture_output=True, text=True, timeout=_BATCH * _SECONDS, check=False)
        if done.returncode not in (0, 1):
            total["crash"] += 1
            print(f"seed {seed + batch}: crashed with {done.returncode}\n{done.stderr[-2000:]}")
        for line in done.stdout.splitlines():
            kind, _, text = line.partition("\t")
            if kind == "memory":
                worst = max(worst, int(text))
            elif kind.startswith("count "):
                total[kind.removeprefix("count ")] += int(text)
            else:
                print(line)
    print(f"{files} files: {dict(total)}; at most {worst >> 20} MB")
    return int(any(total[kind] for kind in ("crash", "traceback", "hang", "silent")) or worst > _MEMORY)


def batch(seed: int, files: int) -> int:
    """Read so many damaged files and print what came of them."""
    counts: Counter[str] = Counter()
    folder = Path(tempfile.mkdtemp(prefix="algid-fuzz-"))
    try:
        clean = [(path, path.read_bytes(), read_log(path)) for path in clean_files(folder)]
        for number in range(files):
            draw = random.Random(seed + number)
            path, content, log = clean[number % len(clean)]
            path.write_bytes(damage(content, draw))
            kind, text = _outcome(path, log)
            counts[kind] += 1
            if kind in ("traceback", "hang", "silent"):
                print(f"{kind}\t{path.suffix} seed {seed + number} of batch {seed}: {text}")
    finally:
        shutil.rmtree(folder)
    for kind, count in counts.items():
        print(f"count {kind}\t{count}")
    print(f"memory\t{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024}")
    return 0


def _outcome(path: Path, clean: Log) -> tuple[str, str]:
    start = time.perf_counter()
    try:
        found = read_log(path)
    except LogError as error:
        outcome = ("refused", "") if "\n" not in str(error) else ("traceback", "more than one line")
    except BaseException as error:
        return "traceback", f"{type(error).__name__}: {error}"[:400]
    else:
        outcome = _compared(found, clean)
    return ("hang", "") if time.perf_counter() - start > _SECONDS else outcome


def _compared(found: Log, clean: Log) -> tuple[str, str]:
    same = all(
        getattr(found, name) is not None and getattr(found, name).tobytes() == getattr(clean, name).tobytes()
        for name in ("stamp_ns", "theta", "tau", "omega")
    )
    if same and found.origin.truth == clean.origin.truth:
        return "same", ""
    if found.notices:
        return "told", ""
    return "silent", f"{len(found)} samples, truth {found.origin.truth}"


if __name__ == "__main__":
    if len(sys.argv) > 1 and sys.argv[1] == "--batch":
        sys.exit(batch(int(sys.argv[2]), int(sys.argv[3])))
    sys.exit(main())
