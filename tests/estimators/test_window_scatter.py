"""What windows of other lengths move is in the error bars of few logs, and of many is not asked."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from algid.estimators import shrunk
from algid.estimators.fit import Fit
from algid.estimators.too_short import TooShortError
from algid.estimators.weak import Source, WeakSettings
from algid.estimators.window_scatter import scattered
from algid.signals.segments import Segment
from pipelines.race_peers import even
from pipelines.run_to_run import runs as runs_of

from .conftest import Bench

SETTINGS = WeakSettings()
NAMES = ("k1", "k2", "k3", "k4", "k5")


def source_of(log: Segment) -> Source:
    return lambda: [log]


def rubbing(bench: Bench) -> Segment:
    """A log whose torque has a disturbance that no term holds."""
    log = bench.log(sigma=1e-4)
    return replace(log, tau=log.tau + 0.02 * np.sin(40 * log.theta))


def test_the_covariance_grows_by_the_mean_square_of_what_other_windows_move(bench: Bench) -> None:
    sources = [source_of(rubbing(bench))]
    least = shrunk.fit(sources, (), SETTINGS)
    found = scattered(least, least, sources, (), SETTINGS)
    moved = [
        shrunk.fit(sources, (), replace(SETTINGS, window=window)).values - least.values
        for window in (0.2, 0.8)
    ]
    grown = found.covariance - least.covariance
    assert grown == pytest.approx((np.outer(*2 * moved[:1]) + np.outer(*2 * moved[1:])) / 2)
    assert np.array_equal(found.values, least.values)
    assert np.all(found.std >= least.std)


def test_logs_that_are_left_out_tell_it_themselves(bench: Bench) -> None:
    sources = [source_of(rubbing(bench))]
    least = replace(shrunk.fit(sources, (), SETTINGS), intervals="jackknife")
    assert scattered(least, least, sources, (), SETTINGS) is least


def test_what_is_not_identifiable_moves_nothing(bench: Bench) -> None:
    sources = [source_of(rubbing(bench))]
    least = shrunk.fit(sources, (), SETTINGS)
    open_ = replace(least, status=("NOT_IDENTIFIABLE", *least.status[1:]))
    grown = scattered(open_, open_, sources, (), SETTINGS).covariance - open_.covariance
    assert not grown[0].any()
    assert grown[1, 1] > 0


def test_windows_that_are_too_long_are_passed_over(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    sources = [source_of(rubbing(bench))]
    least = shrunk.fit(sources, (), SETTINGS)
    fit = shrunk.fit

    def refusing(*given: object) -> Fit:
        settings = given[2]
        assert isinstance(settings, WeakSettings)
        if settings.window > SETTINGS.window:
            raise TooShortError
        return fit(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(shrunk, "fit", refusing)
    moved = fit(sources, (), replace(SETTINGS, window=0.2)).values - least.values
    grown = scattered(least, least, sources, (), SETTINGS).covariance - least.covariance
    assert grown == pytest.approx(np.outer(moved, moved))


@pytest.mark.slow
def test_a_single_run_of_a_real_arm_agrees_with_the_others(shared_data: Path) -> None:
    """Run 7 of design A.0 was 3.9 standard deviations of the difference off."""
    runs = [even(log) for log in runs_of(shared_data, "A.0")]
    alone = [source_of(runs[6])]
    others = [source_of(run) for place, run in enumerate(runs) if place != 6]
    least, rest = (shrunk.fit(sources, (), SETTINGS) for sources in (alone, others))
    found = scattered(least, least, alone, (), SETTINGS)
    places = [found.names.index(name) for name in NAMES]
    away = np.abs(found.values - rest.values)[places]
    assert np.max(away / np.hypot(least.std, rest.std)[places]) > 3
    assert np.max(away / np.hypot(found.std, rest.std)[places]) < 3
