"""Six runs of one motion beside six different motions: whether repeats count as more than they
tell.

    python -m pipelines.repeats --arms 3

What the model lacks is the same in each repeat, so that their estimates agree and are wrong
together. Asked are 92 % of the intervals of k1 … k7.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

import numpy as np

from algid.arm import CONSTANT_NAMES
from algid.identification.identify import identify
from algid.log import Log, Origin
from algid.signals.segments import Segment
from pipelines import real_arms

ROWS = ("torque ripple 3 %", "backlash 0.15° behind a stiff joint", "all of it, mildly")
RUNS = 6
FIRST_ARM = 80


def as_log(log: Segment, name: str) -> Log:
    """A stretch as a log that was read."""
    stamps = np.round(log.t * 1e9).astype(np.int64)
    return Log(stamps, log.theta, log.tau, Origin(name, "csv", {}))


def evaluate(row: str, arms: int) -> Iterator[tuple[str, float, float, list[str]]]:
    """For repeats and for different motions: coverage in %, RMS error in %, and the estimators."""
    numbers = list(range(FIRST_ARM, FIRST_ARM + arms))
    made = real_arms.campaigns(real_arms.ROWS[row], numbers, RUNS)
    for what in ("repeats", "different"):
        inside, errors, estimators = [], [], []
        for number in numbers:
            runs = made[number] if what == "different" else RUNS * made[number][:1]
            rng = np.random.default_rng([number, RUNS])
            logs = [as_log(run.log(rng), f"run {n}") for n, run in enumerate(runs)]
            result = identify(logs, report=False)
            estimators.append(result.estimator)
            for name in CONSTANT_NAMES:
                found, truth = result.parameters[name], runs[0].truth[name]
                low, high = found.ci95 or (None, None)
                if found.estimate is not None and low is not None and high is not None:
                    inside.append(low <= truth <= high)
                    errors.append(100 * (found.estimate / truth - 1))
        yield (
            what,
            100 * float(np.mean(inside)),
            float(np.sqrt(np.mean(np.square(errors)))),
            estimators,
        )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--arms", type=int, default=3)
    parser.add_argument("--row", action="append", choices=tuple(real_arms.ROWS))
    given = parser.parse_args()
    for row in given.row or ROWS:
        for what, coverage, error, estimators in evaluate(row, given.arms):
            shown = ", ".join(estimators)
            print(f"{row}, {what}: {coverage:.3g} % inside, {error:.3g} % RMS; {shown}", flush=True)


if __name__ == "__main__":
    main()
