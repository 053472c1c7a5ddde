"""A first guess of payload and link lengths from the constants of the bare and of the loaded arm (Table 2)."""

from __future__ import annotations

import numpy as np

from algid.arm import FloatArray
from algid.identify.information import LogInformation, Prior, combine, scaled_pinv
from algid.identify.shared import Shared

_FIRST_MASSES = (0.02, 0.1, 0.5, 2.0, 10.0)  # kg
_FIRST_LENGTH = 0.3  # m


def first_payload(shared: Shared, bare: FloatArray, loaded: LogInformation) -> FloatArray:
    """Shared parameters (Q,) with the payload that fits the loaded log best while the bare arm stays `bare` (q,).

    `loaded` is the sum over the loaded logs, linearised at the loaded arm's own coefficients.
    """
    best: FloatArray | None = None
    best_value = -np.inf
    start = bare
    for mass in _FIRST_MASSES:
        guess = {
            "m_p": mass,
            "l1": _length(shared, loaded, bare, mass, "k4"),
            "l2": _length(shared, loaded, bare, mass, "k2"),
        }
        start = np.concatenate([bare, [guess[name] for name in shared.names[len(bare) :]]])
        beta, value = _fitted(shared, start, loaded)
        if value > best_value and np.all(beta[len(bare) :] > 0):
            best, best_value = beta, value
    return start if best is None else best


def _length(shared: Shared, loaded: LogInformation, bare: FloatArray, mass: float, name: str) -> float:
    """Length that the change of a gravity constant tells for a given mass."""
    if name not in shared.log_names:
        return _FIRST_LENGTH
    place = shared.log_names.index(name)
    length = (loaded.c0[place] - bare[place]) / (mass * shared.model.gravity)
    return float(length) if 0.01 < length < 10 else _FIRST_LENGTH


def _fitted(shared: Shared, start: FloatArray, loaded: LogInformation) -> tuple[FloatArray, float]:
    count = len(shared.log_names)
    S, _ = loaded.total
    # The bare arm is held by a prior far tighter than the loaded log.
    hold = Prior.of(shared.log_names, start[:count], scaled_pinv(S) * 1e-4)
    beta, _, value = combine(shared, [loaded], start, hold)
    return beta, value
