"""A log read in blocks gives the estimates of the log read whole."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

import algid
from algid.arm import FloatArray
from algid.identification import recordings as surveys
from algid.identification.by_likelihood import run_fit
from algid.identification.by_paper import run_paper
from algid.identification.outcome import judged, outcome_of
from algid.identification.recordings import Recording, Recordings
from algid.log import Log
from algid.results import Result
from algid.settings import Settings
from algid.synth.sensors import Sensors
from tests.identification.fits import in_blocks

SETTINGS = {
    "weak": Settings(estimator="weak"),
    "weak, observer": Settings(estimator="weak", observer="luenberger", model="plain"),
    "refined": Settings(estimator="refined", model="plain"),
    "paper": Settings(estimator="paper"),
}


@pytest.fixture(scope="module")
def uneven() -> Log:
    """Jitter, lost samples and a gap.

    Long enough that the refined estimator leaves pieces out of its training.
    """
    sensors = Sensors(position_noise=1e-4, torque_noise=1e-2, jitter=1e-5, drop=1e-3, seed=1)
    first, _ = algid.synthesise("case1", duration=8.0, rate=500.0, torque="wide", sensors=sensors)
    stamps = np.concatenate([first.stamp_ns + 8_500_000_000 * n for n in range(12)])
    return Log(stamps, np.tile(first.theta, 12), np.tile(first.tau, 12), first.origin)


def estimates(log: Recording, settings: Settings) -> tuple[FloatArray, FloatArray, Result]:
    """Estimates, by how much sums of another order may move them, and the whole result."""
    survey = Recordings([log])
    if settings.estimator == "paper":
        result = judged(run_paper(survey, settings), survey)
        values = np.array([one.estimate for one in result.parameters.values()], dtype=np.float64)
        return values, 1e-9 * np.abs(values), result  # condition numbers to 1e6, times rounding
    found = run_fit(survey, settings)
    fit = found.fit
    assert fit.converged
    # A window or sample lost at a seam moves an estimate by 1e-4 of its deviation or more;
    # rounding, times the
    # condition of the normal equations, by 1e-9 of it.
    room = np.concatenate([fit.std, fit.std]) * 1e-7
    result = judged(outcome_of(found), survey)
    return np.concatenate([fit.values, fit.std]), room, result


@pytest.mark.parametrize("name", SETTINGS)
def test_blocks_do_not_show_in_the_estimates(name: str, uneven: Log) -> None:
    settings = SETTINGS[name]
    whole, room, result = estimates(in_blocks(uneven, []), settings)
    cut, _, streamed = estimates(in_blocks(uneven, range(2049, len(uneven), 2049)), settings)
    assert np.all(np.abs(cut - whole) < room)
    assert streamed.log == result.log
    if result.fit is not None and result.fit.residual is not None:
        # estimates that differ by 1e-7 of their deviations move it by 1e-9 at most
        np.testing.assert_allclose(streamed.fit.residual.rmse, result.fit.residual.rmse, rtol=1e-9)


@pytest.mark.parametrize(("room", "readings"), [(1 << 20, 1), (1000, 3)])
def test_logs_that_fit_in_memory_are_read_once(
    room: int, readings: int, uneven: Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(surveys, "MOST_KEPT", room)
    begun: list[int] = []
    log = in_blocks(uneven, range(5000, len(uneven), 5000))

    def blocks() -> Iterator[Log]:
        begun.append(1)
        return log.blocks()

    counting = replace(log, blocks=blocks)
    survey = Recordings([counting])
    passes = [list(survey.segments(counting)) for _ in range(3)]
    assert len(begun) == readings
    for again in passes[1:]:
        for one, other in zip(again, passes[0], strict=True):
            assert one.start == other.start
            np.testing.assert_array_equal(one.theta, other.theta)


def test_a_pass_that_ends_early_is_not_taken_for_the_whole_log(uneven: Log) -> None:
    log = in_blocks(uneven, range(5000, len(uneven), 5000))
    survey = Recordings([log])
    next(survey.segments(log))
    assert sum(map(len, survey.segments(log))) == sum(map(len, Recordings([log]).segments(log)))
