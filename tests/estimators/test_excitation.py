"""Constants of which no error bar stands: a joint stood still, or the joints contradict each
other.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from algid.estimators import weak
from algid.estimators.diagnostics import contradicted
from algid.notices import Notice
from algid.signals.segments import Segment
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import simulate

from .conftest import DT, Bench, problem_of

REFUTED = Notice("REFUTED", numbers={"case": "noise", "kept": "weak"})


@pytest.mark.parametrize(
    ("factor", "count", "told"),
    [
        (2.5, 1, True),
        (2.0, 4, True),
        (1.5, 1, False),
        (1.3, 4, True),
        (0.7, 4, True),
        (1.2, 4, False),
    ],
)
def test_torques_that_contradict_each_other_are_told_by_any_number_of_logs(
    bench: Bench, factor: float, count: int, told: bool
) -> None:
    """From four runs on, what the model lacks has shown itself: a smaller contradiction counts."""
    scale = np.array([[1.0], [factor]])
    logs = [replace(log, tau=log.tau * scale) for log in _runs(bench, count)]
    known = problem_of(*logs)
    found = contradicted(weak.fit(known), known)
    assert (found is not None) is told
    assert found is None or found.code == "JOINTS_CONTRADICT"


def _runs(bench: Bench, count: int) -> list[Segment]:
    return [bench.log(sigma=1e-4, seed=seed) for seed in range(count)]


def test_a_light_second_link_is_driven(bench: Bench) -> None:
    """Its motor needs 1 % of the other's torque, which the same constants explain."""
    arm = replace(bench.arm, m2=0.002, I2=2e-5, b2=1e-3)
    motion = simulate(arm.constants(), wide_multi_sine(arm, 3), np.arange(4001) * DT)
    rng = np.random.default_rng(0)
    size = np.sqrt(np.mean(motion.tau**2, axis=1, keepdims=True))
    assert size[1] < 0.02 * size[0]
    tau = motion.tau + 0.01 * size * rng.standard_normal(motion.tau.shape)
    log = Segment(0.0, DT, motion.theta + 1e-4 * rng.standard_normal(tau.shape), tau)
    fit = replace(weak.fit(problem_of(log)), notes=(REFUTED,))
    assert contradicted(fit, problem_of(log)) is None


def test_a_loaded_log_is_held_against_itself(bench: Bench) -> None:
    """The joints of the loaded log agree about the loaded arm: that the arm alone differs is no
    contradiction.
    """
    bare, burdened = bench.log(sigma=1e-4), bench.log(True, 1e-4)
    right = problem_of(bare, loaded=[burdened])
    assert contradicted(weak.fit(right), right) is None
    idle = replace(burdened, tau=burdened.tau * np.array([[0.02], [1.0]]))
    wrong = problem_of(bare, loaded=[idle])
    assert contradicted(weak.fit(wrong), wrong) is not None


def test_a_refuted_log_in_which_a_joint_stood_still_is_not_ok(bench: Bench) -> None:
    log = bench.log(sigma=1e-4)
    tremble = 1e-3 * np.sin(40 * log.t)  # backlash, say: told well enough to be determined
    still = replace(log, theta=np.stack([log.theta[0], 0.3 + tremble]))
    fit = weak.fit(problem_of(still))
    found = contradicted(fit, problem_of(still))
    assert found.text == "joint 2 never moved: give a log in which both joints do"
    assert contradicted(weak.fit(problem_of(log)), problem_of(log)) is None
