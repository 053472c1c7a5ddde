"""The paper's method from logs to the parts of a result."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from functools import partial
from itertools import islice
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
    estimates,
    series_of,
    stage1,
    stage2,
    wanders,
)
from algid.identification.known import wrong_inertia
from algid.identification.outcome import started
from algid.identification.recordings import Recording, Recordings
from algid.identification.series import write_columns
from algid.methods import settles
from algid.model import K6, K7
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
BLOCK = 60.0
"""s of windows that are written together."""
_FRICTION = [CONSTANT_NAMES.index(name) for name in (K6, K7)]


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
    k = known
    if survey.unloaded:
        values, wander, usable = _estimate(survey, survey.unloaded[0], settings, None, folder)
        k = values[: len(CONSTANT_NAMES)]
        # NaN where they are not known
        sure, most = np.where(usable, [values, values + FAR_BEYOND * wander], np.nan)
        no_arm = wrong_inertia(dict(zip(CONSTANT_NAMES, sure, strict=False))) is not None
        wrong = no_arm or bool(np.any(most[_FRICTION] < 0))
        parameters = _named(CONSTANT_NAMES, values, usable, wrong=wrong)
        if usable.all():
            rows = _named(UNLOADED_ROWS, np.array([*sums(UNLOADED_ROWS, k).values()]), usable)
    if survey.loaded:
        values = wander = np.zeros(len(STAGE2_SERIES))
        usable = values > 0  # none where stage 1 failed
        if k is not None and np.isfinite(k).all():
            values, wander, usable = _estimate(survey, survey.loaded[0], settings, k, folder)
        own = [STAGE2_SERIES.index(name) for name in PAYLOAD]
        wrong = bool(np.any((values + FAR_BEYOND * wander)[own] < 0))
        loaded = _named(STAGE2_NAMES, values, usable, wrong=wrong)
        payload = _named(PAYLOAD, values[own], usable[own], wrong=wrong)
    every = rows | loaded | payload
    return started(survey, settings, every, parameters=parameters, loaded=loaded, payload=payload)


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
    moving = survey.with_velocities(log, settings)
    names: tuple[str, ...]
    if k is None:
        names, file = STAGE1_SERIES, STAGE1_FILE
        series = series_of(moving, window, stage1)
    else:
        names, file = STAGE2_SERIES, STAGE2_FILE
        series = series_of(moving, window, partial(stage2, k=k, gravity=settings.gravity))
    settled = list[FloatArray]()

    def columns() -> Iterator[dict[str, FloatArray]]:
        """Blocks of whole windows."""
        while windows := list(islice(series, max(1, round(BLOCK / window)))):
            settled.extend(one.settled for one in windows)
            values = np.concatenate([one.values for one in windows], axis=1)
            named = dict(zip(names, values, strict=True))
            named.pop("k5+k3", None)  # the sum is Table 4's and follows from the others
            yield {"t": np.concatenate([one.t for one in windows])} | named

    if folder is None:
        for _ in columns():
            pass
    else:
        write_columns(folder / file, columns(), [survey.whole(log).first_ns])
    if log.duration < SHORTEST - 1e-9:
        raise LogError(
            f"{log.name}: {log.duration:.3g} s long; the paper's method needs {SHORTEST:g} s at "
            "least to settle; record longer"
        )
    estimate, wander = estimates(settled, len(names))
    return estimate, wander, ~wanders(estimate, wander)


def _named(
    names: Collection[str], values: FloatArray, usable: NDArray[np.bool_], *, wrong: bool = False
) -> dict[str, Estimate]:
    """Estimates by name; those that are not usable have none. No arm has those that are `wrong`."""
    named, good = {}, Status.IMPLAUSIBLE if wrong else Status.OK
    for name, value, there in zip(names, values.tolist(), usable.tolist(), strict=False):
        known = (finite(value), good) if there else (None, Status.WEAK_EXCITATION)
        named[name] = Estimate(estimate=known[0], unit=_UNITS[name], status=known[1])
    return named
