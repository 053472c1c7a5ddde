"""The open race: the same simulated logs for every contender, errors, intervals and time: `make
race`.

Five kinds of arms (`pipelines.race_scenes`), one log of 10 s at 500 Hz each, another to predict.
What contenders make of real runs, `pipelines.run_to_run` measures.

===================  =============================================================================
column               meaning
===================  =============================================================================
error over bound     of k1 … k7 over their Cramér-Rao bound, RMS and median; straight arms, encoders
intervals that hold  share of 95 % intervals of k1 … k7 that hold the truth
error, %             median over parameters and arms of the error's magnitude
held out             RMSE of the torque of an unused log, motion below 20 Hz, residual below 5 Hz
processor            seconds a fit, without imports
choices              number of choices that a user makes beforehand
===================  =============================================================================

± is the standard error over arms, by the bootstrap.
"""

from __future__ import annotations

import time
from argparse import Namespace
from collections import defaultdict
from collections.abc import Iterable
from typing import Any

import numpy as np

from pipelines.experiment import Column, Seen, count, experiment, number, rms, with_error
from pipelines.race_peers import PEERS
from pipelines.race_scenes import KINDS, Scene, scenes
from pipelines.run_to_run import held_out


def draw(peer: str, scene: Scene) -> Seen:
    """One contender on one simulated arm: errors, intervals and prediction."""
    contender, choices = PEERS[peer]
    seen: Seen = defaultdict(list, {"of": [1], "choices": [choices]})
    begin = time.process_time()
    try:
        answer = contender([scene.log], scene.l1)
    except Exception:  # a contender that falls is a result
        return seen | {"fell": [1]}
    seen["seconds"] = [time.process_time() - begin]
    miss = np.abs(answer.values - scene.truth)
    seen[f"error {scene.kind}"] = [miss / np.abs(scene.truth)]
    if scene.bound is not None:
        seen["over bound"] = [miss / scene.bound]
    if answer.interval is not None:
        low, high = answer.interval.T
        given = np.isfinite(low) & np.isfinite(high)
        held = ((low <= scene.truth) & (scene.truth <= high))[given].astype(float)
        seen |= {"held": [held], f"held {scene.kind}": [held]}
    seen["held out"] = [np.sqrt([np.mean(held_out(answer, scene.ahead))])]
    return seen


def rows(given: Namespace) -> Iterable[tuple[str, Iterable[tuple[Any, ...]]]]:
    """By contender all arms, `--arms` of each kind."""
    arms = scenes(range(1, (given.arms or 30) + 1))
    return ((peer, [(peer, arm) for arm in arms]) for peer in PEERS)


if __name__ == "__main__":
    columns: dict[str, Column] = {
        "error over bound, RMS": with_error("over bound", rms),
        "median": with_error("over bound", np.median),
        "intervals that hold, %": with_error("held", np.mean, 100),
        "held out, N m": with_error("held out", np.median),
        "processor s": number("seconds", np.mean),
        "choices": number("choices", np.max),
        "fell": count("fell"),
        "of": count("of"),
    }
    columns |= {f"error %, {kind}": with_error(f"error {kind}", np.median, 100) for kind in KINDS}
    columns |= {f"hold, %, {kind}": with_error(f"held {kind}", np.mean, 100) for kind in KINDS}
    experiment("race", __doc__, rows, draw, columns)
