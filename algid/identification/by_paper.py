"""The paper's method from logs to the parts of a result."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from algid.arm import CONSTANT_NAMES, FloatArray, mass_matrix
from algid.errors import LogError
from algid.estimators.diagnostics import FAR_BEYOND
from algid.estimators.paper import (
    SHORTEST,
    STAGE1_SERIES,
    STAGE2_NAMES,
    STAGE2_SERIES,
    PaperSeries,
    Summary,
    stage1_series,
    stage2_series,
    wanders,
)
from algid.identification.outcome import Identified, distrusted
from algid.identification.series import series_blocks, write_columns
from algid.identification.source import LogSource
from algid.identification.survey import Survey
from algid.identification.velocities import with_velocities
from algid.methods import settles
from algid.model import UNITS as PARAMETER_UNITS
from algid.results import Estimate, Status
from algid.settings import Settings
from algid.table4 import UNITS, finite, unloaded_rows

STAGE1_WINDOW = 2.0  # s
STAGE1_FILE = "estimates.parquet"
STAGE2_FILE = "loaded.parquet"


def run_paper(
    survey: Survey,
    unloaded: LogSource | None,
    loaded: LogSource | None,
    settings: Settings,
    known: FloatArray | None = None,
    folder: Path | None = None,
) -> Identified:
    """Stage 1 on `unloaded`, or the `known` constants (7,); stage 2 on `loaded`.

    Series into `folder`.

    Raises
    ------
    LogError
        If a log is shorter than the estimates need to settle, or lacks velocities that were asked
        for.
    """
    parameters: dict[str, Estimate] = {}
    rows: dict[str, float] = {}
    k = known
    if unloaded is not None:
        values, wander, usable = _estimate(survey, unloaded, settings, None, folder)
        k = values[: len(CONSTANT_NAMES)]
        parameters = _named(CONSTANT_NAMES, PARAMETER_UNITS, values, usable)
        if _is_no_arm(np.where(usable[: k.size], k, np.nan), wander):
            parameters = distrusted(parameters)
        if usable.all():
            rows |= unloaded_rows(k)
    if loaded is None or k is None or not np.isfinite(k).all():
        return Identified(
            parameters, _weak(STAGE2_NAMES, loaded), _weak(("m_p", "l1"), loaded), rows
        )
    values, wander, usable = _estimate(survey, loaded, settings, k, folder)
    names = (*STAGE2_NAMES, "l1", "m_p")
    named = _named(names, {**UNITS, "l1": "m"}, values, usable)
    if np.any((values + FAR_BEYOND * wander)[[names.index("l1"), names.index("m_p")]] < 0):
        named = distrusted(named)
    rows |= {
        name: estimate.estimate for name, estimate in named.items() if estimate.estimate is not None
    }
    return Identified(
        parameters,
        {name: named[name] for name in STAGE2_NAMES},
        {name: named[name] for name in ("m_p", "l1")},
        {name: value for name, value in rows.items() if name in UNITS},
    )


def _estimate(
    survey: Survey, log: LogSource, settings: Settings, k: FloatArray | None, folder: Path | None
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Estimates from one log's series, how far they wander, and which can be used.

    Writes the series on the way.

    Raises
    ------
    LogError
        Where the log is too short for the observer to settle.
    """
    # else beside another estimator, whose settings are not its own
    asked = settles(settings.estimator)
    window = settings.window if asked and settings.window is not None else STAGE1_WINDOW
    moving = with_velocities(survey, log, settings, luenberger=settings.luenberger or not asked)
    names: Sequence[str] = STAGE1_SERIES if k is None else STAGE2_SERIES
    series = (
        stage1_series(moving, window)
        if k is None
        else stage2_series(moving, window, k, settings.gravity)
    )
    summary = Summary(len(names))

    def watched() -> Iterator[PaperSeries]:
        for one in series:
            summary.add(one)
            yield one

    if folder is None:
        for _ in watched():
            pass
    else:
        # the sum k5+k3 is Table 4's and follows from the others
        columns = (
            {name: column for name, column in block.items() if name != "k5+k3"}
            for block in series_blocks(watched(), names)
        )
        write_columns(
            folder / (STAGE1_FILE if k is None else STAGE2_FILE),
            columns,
            [survey.seen(log).first_ns],
        )
    duration = survey.summary(log).duration
    if duration < SHORTEST - 1e-9:
        raise LogError(
            f"{log.name}: {duration:.3g} s long; the paper's method needs {SHORTEST:g} s at least "
            "to settle; record longer"
        )
    estimate, wander = summary.estimates()
    return estimate, wander, ~wanders(estimate, wander)


def _is_no_arm(k: FloatArray, wander: FloatArray) -> bool:
    """Whether no arm has these constants (7,): friction far below zero, or mass not positive.

    Constants are NaN where they are not known.
    """
    if np.any((k + FAR_BEYOND * wander[: k.size])[[5, 6]] < 0):
        return True
    m11, m12, m22 = mass_matrix(k, np.array([[0.0, 0.0], [0.0, np.pi]]))
    return bool(np.any(m22 <= 0) or np.any(m11 * m22 - m12**2 <= 0))


def _named(
    names: Sequence[str], units: dict[str, str], values: FloatArray, usable: NDArray[np.bool_]
) -> dict[str, Estimate]:
    return {
        name: Estimate(estimate=finite(value), unit=units[name])
        if good
        else Estimate(estimate=None, unit=units[name], status=Status.WEAK_EXCITATION)
        for name, value, good in zip(names, values, usable, strict=False)
    }


def _weak(names: Sequence[str], loaded: LogSource | None) -> dict[str, Estimate]:
    """No estimates where a loaded log was given but stage 1 failed."""
    if loaded is None:
        return {}
    units = {**UNITS, "l1": "m"}
    return {
        name: Estimate(estimate=None, unit=units[name], status=Status.WEAK_EXCITATION)
        for name in names
    }
