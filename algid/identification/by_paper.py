"""The paper's method from logs to the parts of a result."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import zip_longest
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from algid.arm import CONSTANT_NAMES, FloatArray
from algid.base.errors import LogError
from algid.estimators.diagnostics import FAR_BEYOND
from algid.estimators.paper import (
    SHORTEST,
    STAGE1_SERIES,
    STAGE2_NAMES,
    STAGE2_SERIES,
    PaperSeries,
    Summary,
    series_of,
    stage1,
    stage2,
    wanders,
)
from algid.identification.outcome import Identified, distrusted
from algid.identification.passes import with_velocities
from algid.identification.recordings import Recording, Recordings
from algid.identification.series import write_columns
from algid.methods import settles
from algid.model import UNITS as PARAMETER_UNITS
from algid.results import Estimate, Status
from algid.settings import Settings
from algid.table4 import UNITS, UNLOADED_ROWS, finite, sums

STAGE1_WINDOW = 2.0  # s
_UNITS = PARAMETER_UNITS | UNITS
NOTHING: FloatArray = np.zeros(0)
STAGE1_FILE = "estimates.parquet"
STAGE2_FILE = "loaded.parquet"
ROWS = 1 << 17  # of a block of the series


def run_paper(
    survey: Recordings,
    unloaded: Recording | None,
    loaded: Recording | None,
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
        parameters = _named(CONSTANT_NAMES, values, usable)
        if _is_no_arm(np.where(usable[: k.size], k, np.nan), wander):
            parameters = distrusted(parameters)
        if usable.all():
            rows |= sums(UNLOADED_ROWS, k)
    if loaded is None:
        return Identified(parameters, {}, {}, rows)
    payload = ("m_p", "l1")
    if k is None or not np.isfinite(k).all():
        return Identified(parameters, _named(STAGE2_NAMES), _named(payload), rows)
    values, wander, usable = _estimate(survey, loaded, settings, k, folder)
    names = STAGE2_NAMES + ("l1", "m_p")
    named = _named(names, values, usable)
    of_payload = slice(len(STAGE2_NAMES), len(names))
    if np.any((values + FAR_BEYOND * wander)[of_payload] < 0):
        named = distrusted(named)
    for name, one in named.items():
        if name in UNITS and one.estimate is not None:
            rows[name] = one.estimate
    return Identified(
        parameters,
        {name: named[name] for name in STAGE2_NAMES},
        {name: named[name] for name in payload},
        rows,
    )


def _estimate(
    survey: Recordings,
    log: Recording,
    settings: Settings,
    k: FloatArray | None,
    folder: Path | None,
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
    window = STAGE1_WINDOW
    if asked and settings.window is not None:
        window = settings.window
    moving = with_velocities(survey, log, settings, luenberger=settings.luenberger or not asked)
    names: Sequence[str]
    if k is None:
        names, file = STAGE1_SERIES, STAGE1_FILE
        series = series_of(moving, window, stage1)
    else:
        names, file = STAGE2_SERIES, STAGE2_FILE
        series = series_of(moving, window, partial(stage2, k=k, gravity=settings.gravity))
    summary = Summary(len(names))

    def columns() -> Iterator[dict[str, FloatArray]]:
        """Blocks of whole windows, each of some `ROWS` samples."""
        gathered, rows = list[PaperSeries](), 0
        for one in series:
            summary.add(one)
            gathered.append(one)
            rows += one.t.size
            if rows >= ROWS:
                yield _columns(gathered, names)
                gathered, rows = [], 0
        if gathered:
            yield _columns(gathered, names)

    if folder is None:
        for _ in columns():
            pass
    else:
        write_columns(folder / file, columns(), [survey.whole(log).first_ns])
    duration = survey.summary(log).duration
    if duration < SHORTEST - 1e-9:
        raise LogError(
            f"{log.name}: {duration:.3g} s long; the paper's method needs {SHORTEST:g} s at least "
            "to settle; record longer"
        )
    estimate, wander = summary.estimates()
    return estimate, wander, ~wanders(estimate, wander)


def _columns(windows: Sequence[PaperSeries], names: Sequence[str]) -> dict[str, FloatArray]:
    values = np.concatenate([window.values for window in windows], axis=1)
    columns = {"t": np.concatenate([window.t for window in windows])}
    columns |= dict(zip(names, values, strict=True))
    columns.pop("k5+k3", None)  # the sum is Table 4's and follows from the others
    return columns


def _is_no_arm(k: FloatArray, wander: FloatArray) -> bool:
    """Whether no arm has these constants (7,): friction far below zero, or mass not positive.

    Constants are NaN where they are not known.
    """
    if np.any((k + FAR_BEYOND * wander[: k.size])[[5, 6]] < 0):
        return True
    # eq. (2): det M = k3 k5 − k1² wherever joint 2 is turned by half a turn or not at all
    return bool(k[2] <= 0 or k[2] * k[4] <= k[0] ** 2)


def _named(
    names: Sequence[str], values: FloatArray = NOTHING, usable: NDArray[np.bool_] = NOTHING > 0
) -> dict[str, Estimate]:
    """Estimates by name; those that are not usable have none, as all have where stage 1 failed."""
    named = {}
    for name, value, good in zip_longest(names, values[: len(names)], usable[: len(names)]):
        weak = Estimate(estimate=None, unit=_UNITS[name], status=Status.WEAK_EXCITATION)
        named[name] = Estimate(estimate=finite(value), unit=_UNITS[name]) if good else weak
    return named
