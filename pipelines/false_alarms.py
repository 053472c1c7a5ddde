"""How many sound logs bring a warning: `make false-alarms`.

Each log is of another simulated arm under a wide torque, by sensors with white noise, every second
one with Coulomb friction, read as it is. Nothing is wrong with it: each reason for a verdict other
than Good is a false alarm. Prints them by code, and the share of logs that have one with its 95 %
interval (Clopper-Pearson).
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterable, Sequence

from scipy.stats import beta

from algid.identification.identify import identify
from pipelines.conventions import ROWS, log_of, motion_of

FIRST_ARM = 1000  # seeds of arms that nothing was tuned on


def alarms(number: int) -> list[str]:
    """Codes of the verdict's reasons on sound log `number`, each printed with its sentence."""
    motion = motion_of(f"arm{FIRST_ARM + number}")[1]
    log = log_of(motion, ROWS["nothing"], friction=bool(number % 2), seed=FIRST_ARM + number)
    reasons = identify(log, report=False).verdict.reasons
    for reason in reasons:
        print(f"log {number}: {reason.code}: {reason.sentence}", flush=True)
    return [reason.code for reason in reasons]


def interval(count: int, of: int) -> tuple[float, float]:
    """The 95 % interval of a share that `count` of so many have."""
    low = beta.ppf(0.025, count, of - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, of - count) if count < of else 1.0
    return float(low), float(high)


def table(seen: Iterable[Sequence[str]]) -> list[str]:
    """Lines of the codes and of the share of logs."""
    logs = [set(codes) for codes in seen]
    counts = Counter(code for codes in logs for code in codes)
    lines = [f"| {code} | {count} |" for code, count in counts.most_common()]
    warned = sum(bool(codes) for codes in logs)
    low, high = interval(warned, len(logs))
    share = f"{warned} of {len(logs)}: {warned / len(logs):.1%} (95 %: {low:.1%} to {high:.1%})"
    return ["| code | logs |", "|---|---|", *lines, "", f"Sound logs with a warning: {share}"]


def main() -> None:
    """Identify the logs and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--logs", type=int, default=300)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    numbers = range(given.first, given.first + given.logs)
    print("\n".join(table([alarms(number) for number in numbers])))


if __name__ == "__main__":
    main()
