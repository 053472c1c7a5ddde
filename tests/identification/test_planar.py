"""Planar arms in general: centres of mass off the links' lines, payloads that are bodies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from algid.arm import FloatArray
from algid.identification.identify import identify
from algid.log import Log
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import simulate
from pipelines.planar import PAYLOAD, Row, drawn, scene
from tests.golden.scenes import ARM, log_of, times
from tests.golden.scenes import PAYLOAD as CARRIED
from tests.intervals import distances

CHANCE = 4.5  # standard deviations: once in 150 000


def moved(constants: FloatArray, seed: int) -> Log:
    """A log of the paper's first arm with these constants, under a wide torque."""
    motion = simulate(constants, wide_multi_sine(ARM, seed), times())
    return log_of(motion, motion.tau, seed)


def test_a_payload_off_the_line_of_a_straight_arm_is_found() -> None:
    x, y, J = 0.9 * ARM.l2, 0.3 * ARM.l2, 2e-4
    logs = moved(ARM.phasors(), 1), moved(ARM.phasors(CARRIED, x, y, J), 2)
    result = identify(*logs, report=False)
    assert result.fit.model.terms == ["phases"]
    assert result.fit.intervals == "likelihood"  # not refuted
    truth = {"m_p": CARRIED, "l1": ARM.l1, "l2": x, "y_p": y, "J_p": J, "k1s": 0.0}
    assert np.abs(distances(result, truth.values(), list(truth))).max() < CHANCE


def test_an_offset_is_not_taken_for_an_inertia_where_both_would_make_that_negative() -> None:
    """Of one parameter of the body the likelier counts, not the one that has more of its own
    errors.
    """
    row = Row(10.0, 0.0, 20.0)
    result = drawn("arm21", row, 0)
    truth = dict(zip(PAYLOAD, scene("arm21", row)[1].tolist(), strict=True))
    assert "J_p" not in result.estimates
    names = ("m_p", "l1", "l2", "y_p")
    assert np.abs(distances(result, [truth[name] for name in names], names)).max() < CHANCE


def test_phases_are_a_note_of_what_they_mean_and_no_accusation() -> None:
    off1, off2, bent1, bent2 = np.radians([4.0, -3.0, 8.0, 12.0])
    arm = replace(ARM, delta1=float(bent1), delta2=float(bent2))
    log = moved(arm.phasors(), 3)
    log = replace(log, theta=log.theta - np.array([[off1], [off2]]))
    result = identify(log, report=False)
    assert result.verdict.grade == "good"
    (note,) = result.notices
    assert note.code == "PHASES"
    K1, K4 = arm.phasors()[[0, 3]] + 1j * arm.phasors()[[7, 9]]
    for name, true in (
        ("first", off1),
        ("load", np.angle(K4)),
        ("second", np.angle(K1) + off2),
    ):
        value, half = (float(one) for one in note.numbers[name].replace("°", "").split(" ± "))
        assert 0 < half < 1.5
        assert abs(value - np.degrees(true)) < 2.2 * half, name


def test_a_large_payload_on_a_bent_arm_is_no_other_convention() -> None:
    """Three phases of their own look like a motor at the base, to conventions that have
    two zeros.
    """
    result = drawn("arm23", Row(30.0, 0.15, 20.0), 0)
    assert result.verdict.grade == "good"
    assert "WRONG_CONVENTION" not in {one.code for one in result.notices}
