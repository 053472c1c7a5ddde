"""The checks of a log together, and what of them a clean one passes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from algid.arm import Arm, FloatArray, inverse_dynamics
from algid.inspection.checks import admitted, examine, inspect_log
from algid.inspection.conventions import judged
from algid.inspection.figures import dynamic_figures, signal_figures
from algid.log import Log, Origin
from algid.notices import Notice, codes_of, has_code
from algid.profile import Profile
from algid.readers import read_log

K = Arm(6, 3, 0.15, 0.1, 0.3, 0.2, 0.1, 0.02, 1.5, 0.3).constants()


def moving_log(rows: int = 6000, pace: float = 1.0, k: FloatArray = K) -> Log:
    """Closed-form motion and the torque that eq. (1) gives for it, 1 kHz, with
    measurement noise.
    """
    draw = np.random.default_rng(4)
    t = np.arange(rows) * 1e-3
    theta, omega, alpha = np.zeros((3, 2, rows))
    for joint, terms in enumerate((((0.9, 2.1), (0.4, 5.3)), ((1.1, 1.3), (0.5, 6.1)))):
        for size, usual in terms:
            rate = pace * usual
            theta[joint] += size * np.sin(rate * t)
            omega[joint] += size * rate * np.cos(rate * t)
            alpha[joint] -= size * rate**2 * np.sin(rate * t)
    tau = inverse_dynamics(k, theta, omega, alpha) + draw.normal(0, 0.02, (2, rows))
    noisy = theta + draw.normal(0, 1e-4, theta.shape)
    return Log(np.arange(rows) * 1_000_000, noisy, tau, Origin("arm.csv", "csv", {}), omega)


def noticed(log: Log, *, whole: bool = True) -> tuple[Notice, ...]:
    """What the checks find in a log that is used nevertheless."""
    return admitted(log, examine(log, lambda: judged(log), whole=whole))


def of_signals(log: Log) -> tuple[Notice, ...]:
    """What the checks of its signals find in a log: no convention is sought."""
    return examine(log, lambda: None)


def codes(log: Log) -> list[str]:
    return codes_of(inspect_log(log).findings)


def test_a_clean_log_raises_nothing() -> None:
    found = inspect_log(moving_log())
    assert (repr(found), found.contradicted) == ("Inspection('arm.csv', nothing found)", False)


REFUSED = ("EFFORT_ZERO", "WRAPPED_ANGLE", "DEGREES")


def spoiled(code: str) -> Log:
    """A log that a check refuses by that code."""
    log = moving_log()
    if code == "EFFORT_ZERO":
        return replace(log, tau=np.stack([log.tau[0], 0 * log.tau[1]]))
    if code == "WRAPPED_ANGLE":
        return replace(log, theta=np.angle(np.exp(1j * (log.theta + 2.5))))
    return replace(log, theta=np.degrees(log.theta))


def test_encoder_step_and_noise_floor() -> None:
    draw = np.random.default_rng(7)
    smooth = np.sin(np.arange(5000) * 1e-3)
    # the robust deviation of 5000 draws is good to a few percent
    noisy = smooth + draw.normal(0, 1e-3, 5000)
    for values in (noisy, np.resize(noisy, 1 << 19)):  # of the longer every second value
        assert signal_figures(values).noise == pytest.approx(1e-3, rel=0.1)
    stepped = np.rint(smooth / 3.8e-4) * 3.8e-4
    assert signal_figures(stepped).step == pytest.approx(3.8e-4, rel=1e-6)
    assert signal_figures(smooth).step == 0
    for values, step in (([0, 1, 1], 0), ([0, 1, 3], 1)):  # two levels are no grid
        assert signal_figures(np.array(values, dtype=float)).step == step


@pytest.mark.slow
def test_the_recorded_runs_tell_their_zero(shared_data: Path) -> None:
    runs = sorted((shared_data / "dfki" / "C1_sysid").glob("*.csv"))
    turned = {"WRONG_ZERO", "FLIPPED_SIGN", "GRAVITY_COMPENSATED", "WRONG_CONVENTION"}
    blamed = [turned & set(codes(read_log(run))) for run in runs]
    assert set.union(*blamed) == {"WRONG_ZERO", "WRONG_CONVENTION"}
    assert sum(map(bool, blamed)) >= 5
    for run in runs:
        log = read_log(run, Profile(zero="hanging"))
        assert not turned & set(codes(log))
        figures = dynamic_figures(judged(log))
        assert figures is not None
        assert figures.explained > 0.8


@pytest.mark.parametrize("share", [0.0, 0.08, 0.15])
def test_stamps_that_jitter_have_lost_nothing_and_hide_no_loss(share: float) -> None:
    """A long step of the clock makes a step of the angles twice its neighbours'."""
    log, rng = moving_log(), np.random.default_rng(2)
    jitter = share * 1e6 * np.clip(rng.standard_normal(len(log)), -3, 3)
    stamps = log.stamp_ns + np.round(jitter).astype(np.int64)
    kept = rng.random(len(log)) > 0.05
    lost = Log(stamps[: kept.sum()], log.theta[:, kept], log.tau[:, kept], log.origin)
    assert not has_code(of_signals(replace(log, stamp_ns=stamps)), "LOST_SAMPLES")
    assert has_code(of_signals(lost), "LOST_SAMPLES")


def test_encoders_and_rest_make_no_lost_samples() -> None:
    log, step = moving_log(), 2 * np.pi / 4096
    noise = 3e-4 * np.random.default_rng(0).standard_normal(log.theta.shape)
    for theta in (np.round(log.theta / step) * step, log.theta[:, :1] + noise):
        assert not has_code(of_signals(replace(log, theta=theta)), "LOST_SAMPLES")


def test_three_samples_are_not_looked_at() -> None:
    assert of_signals(spoiled("DEGREES").part(0, 3)) == ()
    assert of_signals(spoiled("DEGREES").part(0, 4)) != ()
