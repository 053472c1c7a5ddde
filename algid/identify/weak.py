"""The weak estimator: weighted least squares on the momentum form.

See `algid.identify.moments` for the equations and `algid.identify.normal` for the one pass over each log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from algid.arm import FloatArray
from algid.identify.fit import Fit, conclude
from algid.identify.information import LogInformation, Prior
from algid.identify.normal import Normal, Source, WeakSettings, normal_equations, solve
from algid.identify.payload import first_payload
from algid.identify.shared import Shared

__all__ = ["Source", "WeakSettings", "fit"]

_DELAY_PASSES = 4
_DELAY_SETTLED = 0.02  # samples


def fit(
    unloaded: Sequence[Source],
    loaded: Sequence[Source] = (),
    settings: WeakSettings | None = None,
    lengths: dict[str, float] | None = None,
    prior: Prior | None = None,
) -> Fit:
    """Least-squares parameters of the arm, and of its payload where there are loaded logs.

    Parameters
    ----------
    unloaded, loaded : sequences of callables
        Each gives a fresh iterable of `Segment`, the stretches of one log in time. It is called once, and a few
        times more where a delay is estimated.
    settings : WeakSettings
    lengths : dict
        Known link lengths "l1", "l2" in m.
    prior : Prior
        What an earlier result knows of the arm; unloaded logs are not needed then.

    Raises
    ------
    ValueError
        If no log is long enough for a window, or there is neither an unloaded log nor a prior.
    """
    settings = settings or WeakSettings()
    shared = Shared(settings.model, settings.estimate_delay, bool(loaded), dict(lengths or {}))
    for _ in range(_DELAY_PASSES):
        bare = _normals(unloaded, settings)
        burdened = _normals(loaded, settings)
        beta, logs = _start(shared, bare, burdened, prior)
        if not shared.delay:
            break
        place = len(settings.model.names)
        change = float(beta[place])
        settings = replace(settings, delay=settings.delay + change)
        beta[place] = settings.delay
        logs = [_with_delay(log, place, settings.delay - change) for log in logs]
        if abs(change) < _DELAY_SETTLED * max(normal.dt for normal in bare + burdened):
            break
    moved = np.max([normal.moved for normal in bare + burdened], axis=0)
    return replace(conclude("weak", shared, logs, beta, moved, prior, coloured=True), moved=moved)


def _normals(sources: Sequence[Source], settings: WeakSettings) -> list[Normal]:
    found = [normal_equations(source, settings) for source in sources]
    return [normal for normal in found if normal is not None]


def _start(
    shared: Shared, bare: list[Normal], burdened: list[Normal], prior: Prior | None
) -> tuple[FloatArray, list[LogInformation]]:
    """Shared parameters from which `conclude` starts, and each log's likelihood."""
    if not bare and (prior is None or not burdened):
        raise ValueError("no unloaded log is long enough: expected at least a second of samples without a gap")
    logs: list[LogInformation] = []
    arm: FloatArray = np.zeros(len(shared.log_names))
    if bare:
        arm, logs = solve(bare)
    elif prior is not None:
        arm[[shared.log_names.index(name) for name in prior.names]] = prior.mean
    if not shared.payload:
        return arm, logs
    if not burdened:
        raise ValueError("no loaded log is long enough: expected at least a second of samples without a gap")
    _, under_load = solve(burdened, loaded=True)
    together = LogInformation(True, under_load[0].c0, *_stacked(under_load))
    return first_payload(shared, arm, together), logs + under_load


def _stacked(logs: Sequence[LogInformation]) -> tuple[FloatArray, FloatArray]:
    return np.concatenate([log.S for log in logs]), np.concatenate([log.g for log in logs])


def _with_delay(log: LogInformation, place: int, base: float) -> LogInformation:
    """The log's likelihood in the whole delay, where it was linearised in the change from `base`."""
    c0 = log.c0.copy()
    c0[place] += base
    return replace(log, c0=c0)
