"""Sums over a log's cells, and what a track makes of them, by hand and by the simulator's truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.base.criteria import HOLE
from algid.base.errors import LogError
from algid.identification.identify import identify
from algid.log import Log, Origin
from algid.model import Model
from algid.settings import Settings
from algid.signals.segments import segments
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import simulate
from algid.tracks.arm import IdentifiedArm
from algid.tracks.cells import CELL, Cells, cells_of, joined
from algid.tracks.payload import HALF_BAND, track, track_log
from algid.tracks.result import Stretch, StretchStatus, TrackResult
from tests.tracks.folders import CASE, carrier, noisy
from tests.tracks.test_tables import track as masses_of

ARM = carrier()
NOTHING = np.zeros((9, 9))


def carrying(mass: float) -> FloatArray:
    """The arm's constants (7,) with `mass` kg at its tip."""
    return ARM.k + mass * ARM.unit


def loaded(mass: float, duration: float = 3.0, seed: int = 3) -> Log:
    """The first case's arm with `mass` kg at its tip, without noise, at 500 Hz."""
    k = CASE.arm.constants(mass)
    t = 2e-3 * np.arange(round(500 * duration) + 1)
    motion = simulate(k, wide_multi_sine(CASE.arm, seed), t)
    log = Log(
        np.rint(t * 1e9).astype(np.int64),
        motion.theta,
        motion.tau,
        Origin("picking.csv", "csv", {}),
    )
    return noisy(log, np.random.default_rng(seed))


@pytest.mark.parametrize("mass", [0.0, 0.3])
@pytest.mark.parametrize("about", [0.0, 0.25])
def test_cells_weigh_the_payload_wherever_they_are_linearised(mass: float, about: float) -> None:
    log = loaded(mass)
    for _ in range(4):  # noisy angles bias a mass that is linearised far from itself
        cells = joined(cells_of(segments([log]), ARM, carrying(about)))
        about = cells.mass
    std = 1 / np.sqrt(cells.A.sum())
    assert abs(cells.mass - mass) < 4.5 * std < 0.01
    assert np.diff(cells.start) == pytest.approx(CELL, abs=1e-9)
    np.testing.assert_allclose(cells.end - cells.start, CELL, atol=1e-9)
    assert cells.rows.tolist() == [20.0] * len(cells)
    # what the payload leaves is white noise of variance one: χ² of as many rows
    x = np.zeros((len(cells), 1 + len(ARM.friction)))
    x[:, 0] = cells.mass
    left, rows = cells.less(x).E.sum(), cells.rows.sum()
    assert abs(left - rows) < 5 * np.sqrt(2 * rows)


def test_a_track_is_the_weighted_mean_over_its_neighbourhood_and_its_band_that_ones_error() -> None:
    log = loaded(0.3)
    found = track(lambda: segments([log]), ARM, NOTHING)
    (stretch,) = found.stretches
    assert found.tip_equivalent == pytest.approx(CASE.arm.constants()[2] / CASE.arm.l2**2)
    assert found.colour == pytest.approx(1, abs=0.1)
    assert abs(stretch.m_p - 0.3) < 4.5 * stretch.std
    assert np.unique(found.stretch).tolist() == [0.0]
    assert np.all(np.abs(found.m_p - 0.3) < 5 * found.std)
    assert np.all(found.std > stretch.std)
    inner = (found.t > found.t[0] + HALF_BAND) & (found.t < found.t[-1] - HALF_BAND)
    # m_p(t) rests on half a second of the three: its variance is about six times the stretch's
    share = (2 * HALF_BAND + CELL) / (found.t[-1] - found.t[0])
    assert np.mean(1 / found.std[inner] ** 2) * stretch.std**2 == pytest.approx(share, rel=0.2)
    assert found.explained > 0.99
    assert np.mean(found.left**2) == pytest.approx(1, abs=0.1)
    assert found.holes.shape == (0, 2)
    assert found.changes.shape == (0, 3)


def test_a_hole_in_a_log_is_told_and_cuts_no_stretch() -> None:
    log = loaded(0.3, 4.0)
    stamps = log.stamp_ns + np.where(np.arange(len(log)) >= 1000, 2_000_000_000, 0)
    found = track(lambda: segments([replace(log, stamp_ns=stamps)]), ARM, NOTHING)
    (hole,) = found.holes
    assert hole == pytest.approx([2.0, 4.0], abs=2 * CELL + 0.02)  # a whole cell and the stencil
    assert hole[1] - hole[0] > HOLE
    assert len(found.stretches) == 1
    assert not np.any((found.t > 2.02) & (found.t < 3.98))


def test_a_log_too_short_to_hold_a_change_is_refused(weighed_arm: Path) -> None:
    log = loaded(0.0)
    with pytest.raises(
        LogError, match=r"^picking\.csv: the log is too short: expected 0\.4 s at least; record"
    ):
        track_log(log.part(0, 150), weighed_arm)
    with pytest.raises(LogError, match=r"^picking\.csv: it holds no samples; record longer$"):
        track_log(log.part(0, 0), weighed_arm)


@pytest.fixture(scope="module")
def weighed_arm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Result of an arm whose links' lengths are known."""
    folder = tmp_path_factory.mktemp("arm")
    lengths = Settings(estimator="weak", model="plain", l1=CASE.arm.l1, l2=CASE.arm.l2)
    identify(loaded(0.0, seed=5), None, lengths, out=folder, name="arm", report=False)
    return folder / "arm.algid"


def judged(*stretches: Stretch) -> TrackResult:
    made = masses_of([0.0] * len(stretches))
    found = replace(made.track, stretches=list(stretches), tip_equivalent=0.1)
    return replace(made, track=found)


@pytest.mark.parametrize(
    ("m_p", "std", "status"),
    [
        (0.0, 0.049, StretchStatus.OK),  # half of link 2's own weight at the tip
        (0.0, 0.051, StretchStatus.WEAK_EXCITATION),
        (1.0, 0.49, StretchStatus.OK),  # half of the payload, which is heavier
        (1.0, 0.51, StretchStatus.WEAK_EXCITATION),
        (0.0, np.nan, StretchStatus.WEAK_EXCITATION),
        (-0.099, 0.025, StretchStatus.OK),  # four deviations
        (-0.101, 0.025, StretchStatus.NEGATIVE_MASS),
    ],
)
def test_a_stretchs_status_goes_by_its_deviation_and_its_sign(
    m_p: float, std: float, status: StretchStatus
) -> None:
    found = judged(Stretch(0.0, 2.0, 0.0, 0.01), Stretch(2.0, 4.0, m_p, std))
    assert found.statuses == [StretchStatus.OK, status]
    assert found.complete is (status is StretchStatus.OK)


@pytest.mark.parametrize("name", ["l1", "l2", "y_p", "J_p"])
def test_scores_shift_with_a_bodys_shape_by_its_derivatives(name: str) -> None:
    """Of an arm with bent links: against central differences of what a kilogram adds."""
    model = Model(("phases",))
    k = np.array([0.1, 0.5, 0.2, 0.9, 0.4, 0.1, 0.1, 0.02, 0.15, 0.05])
    arm = carrier(model, k, 0.4, 0.3, y_p=0.05, J_p=0.07**2)
    step = 1e-6 * np.isin(arm.shared.names, name)

    def moved(by: FloatArray) -> IdentifiedArm:
        return replace(arm, beta=arm.beta + by)

    slope = (moved(step).unit - moved(-step).unit) / 2e-6
    row = ("l1", "l2", "y_p", "J_p").index(name)
    np.testing.assert_allclose(arm.by_shape[row], slope, atol=1e-8)
    P = np.arange(1.0, 4.0)[:, None, None] * np.arange(30.0).reshape(3, 10)
    nothing = np.zeros(3)
    cells = Cells(nothing, nothing, P, P[..., 0], nothing, nothing, nothing, np.eye(3, 10))
    mass = np.array([0.2, 0.5, 1.1])
    T = cells.sensitivity(arm, mass)
    assert T.shape == (3, 3, 14)
    np.testing.assert_allclose(T[..., 10 + row], mass[:, None] * (P @ slope), atol=1e-6)
