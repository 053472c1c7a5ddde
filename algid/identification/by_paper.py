"""The paper's method from logs to the parts of a result."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from algid.arm import CONSTANT_NAMES, FloatArray
from algid.base.errors import LogError, SettingError
from algid.estimators.diagnostics import FAR_BEYOND
from algid.estimators.paper import (
    SHORTEST,
    STAGE1_SERIES,
    STAGE2_NAMES,
    STAGE2_SERIES,
    PaperSeries,
    estimates,
    series_of,
    stage1,
    stage2,
    wanders,
)
from algid.identification.outcome import distrusted, started
from algid.identification.passes import with_velocities
from algid.identification.recordings import Recording, Recordings
from algid.identification.series import write_columns
from algid.methods import settles
from algid.model import UNITS as PARAMETER_UNITS
from algid.options import flag
from algid.results import Estimate, Result, Status
from algid.settings import Settings
from algid.table4 import UNITS, UNLOADED_ROWS, finite, sums

STAGE1_WINDOW = 2.0  # s
_UNITS = PARAMETER_UNITS | UNITS
PAYLOAD = ("m_p", "l1")
STAGE1_FILE = "estimates.parquet"
STAGE2_FILE = "loaded.parquet"
ROWS = 1 << 17  # of a block of the series


def run_paper(
    survey: Recordings,
    settings: Settings,
    known: FloatArray | None = None,
    folder: Path | None = None,
) -> Result:
    """Stage 1 on the first unloaded log, or the `known` constants (7,); stage 2 on the loaded one.

    Series into `folder`.

    Raises
    ------
    LogError
        If there are several logs of a kind and no other estimator, or if a log is shorter than the
        estimates need to settle, or lacks velocities that were asked for.
    SettingError
        If velocities are to come without phase.
    """
    asked = settles(settings.estimator)
    if asked and not settings.luenberger and settings.velocity == "observer":
        raise SettingError(
            f"{flag('observer')} zero-phase: the paper's method observes as the paper does; leave "
            f"it out, say {flag('velocity')}=measured, or use {flag('estimator')} refined or weak"
        )
    for logs in (survey.unloaded, survey.loaded):
        if asked and len(logs) > 1:
            raise LogError(
                f"{logs[1].name}: the paper's method takes one log of each kind; give one, or use "
                f"{flag('estimator')} refined or weak"
            )
    parameters, loaded, payload, rows = (dict[str, Estimate]() for _ in range(4))
    k, wrong = known, list[str]()
    if survey.unloaded:
        values, wander, usable = _estimate(survey, survey.unloaded[0], settings, None, folder)
        k = values[: len(CONSTANT_NAMES)]
        parameters = _named(CONSTANT_NAMES, values, usable)
        if _is_no_arm(np.where(usable[: k.size], k, np.nan), wander):
            wrong.append("parameters")
        if usable.all():
            rows = _named(UNLOADED_ROWS, np.array([*sums(UNLOADED_ROWS, k).values()]), usable)
    if survey.loaded:
        values = wander = np.zeros(len(STAGE2_SERIES))
        usable = values > 0  # none where stage 1 failed
        if k is not None and np.isfinite(k).all():
            values, wander, usable = _estimate(survey, survey.loaded[0], settings, k, folder)
        loaded = _named(STAGE2_NAMES, values, usable)
        own = [STAGE2_SERIES.index(name) for name in PAYLOAD]
        payload = _named(PAYLOAD, values[own], usable[own])
        if np.any((values + FAR_BEYOND * wander)[own] < 0):
            wrong += ["loaded", "payload"]
    result = started(survey, settings, rows | loaded | payload)
    changes = {"parameters": parameters, "loaded": loaded, "payload": payload}
    return distrusted(result.model_copy(update=changes), wrong)


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
    window = (settings.window if asked else None) or STAGE1_WINDOW
    moving = with_velocities(survey, log, settings)
    names: Sequence[str]
    if k is None:
        names, file = STAGE1_SERIES, STAGE1_FILE
        series = series_of(moving, window, stage1)
    else:
        names, file = STAGE2_SERIES, STAGE2_FILE
        series = series_of(moving, window, partial(stage2, k=k, gravity=settings.gravity))
    settled = list[FloatArray]()

    def columns() -> Iterator[dict[str, FloatArray]]:
        """Blocks of whole windows, each of some `ROWS` samples."""
        gathered, rows = list[PaperSeries](), 0
        for one in series:
            settled.append(one.settled)
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
    estimate, wander = estimates(settled, len(names))
    return estimate, wander, ~wanders(estimate, wander)


def _columns(windows: Sequence[PaperSeries], names: Sequence[str]) -> dict[str, FloatArray]:
    values = np.concatenate([window.values for window in windows], axis=1)
    columns = dict(zip(names, values, strict=True))
    columns.pop("k5+k3", None)  # the sum is Table 4's and follows from the others
    return {"t": np.concatenate([window.t for window in windows])} | columns


def _is_no_arm(k: FloatArray, wander: FloatArray) -> bool:
    """Whether no arm has these constants (7,): friction far below zero, or mass not positive.

    Constants are NaN where they are not known.
    """
    if np.any((k + FAR_BEYOND * wander[: k.size])[[5, 6]] < 0):
        return True
    # eq. (2): det M = k3 k5 − k1² wherever joint 2 is turned by half a turn or not at all
    return bool(k[2] <= 0 or k[2] * k[4] <= k[0] ** 2)


def _named(
    names: Collection[str], values: FloatArray, usable: NDArray[np.bool_]
) -> dict[str, Estimate]:
    """Estimates by name; those that are not usable have none."""
    named = {}
    for name, value, good in zip(names, values.tolist(), usable.tolist(), strict=False):
        known = (finite(value), Status.OK) if good else (None, Status.WEAK_EXCITATION)
        named[name] = Estimate(estimate=known[0], unit=_UNITS[name], status=known[1])
    return named
