"""Cumulative integrals of uniformly sampled signals, fourth order in the sample time."""

from __future__ import annotations

import numpy as np

from algid.arm import FloatArray

FEWEST_SAMPLES = 4

# Integral over one sample of the cubic through four neighbours: at the edges and in between, times dt / 24.
_EDGE = np.array([9.0, 19.0, -5.0, 1.0]) / 24
_INNER = np.array([-1.0, 13.0, 13.0, -1.0]) / 24


def integral(signal: FloatArray, dt: float) -> FloatArray:
    """Integrate a uniformly sampled signal from its first sample.

    Parameters
    ----------
    signal : (..., N) float64, unit u
        Samples at 0, dt, …, (N-1) dt.
    dt : float, s

    Returns
    -------
    (..., N) float64, unit u s
        Zero at the first sample. Error O(dt^4) for smooth signals: each step integrates the cubic through the
        four samples around it.

    Raises
    ------
    ValueError
        If the signal has fewer than four samples.
    """
    if signal.shape[-1] < FEWEST_SAMPLES:
        raise ValueError(f"the signal needs at least {FEWEST_SAMPLES} samples, got {signal.shape[-1]}")
    steps = np.empty_like(signal)
    steps[..., 0] = 0
    steps[..., 1] = signal[..., :4] @ _EDGE
    steps[..., -1] = signal[..., -4:] @ _EDGE[::-1]
    steps[..., 2:-1] = _INNER[1] * (signal[..., 1:-2] + signal[..., 2:-1])
    steps[..., 2:-1] += _INNER[0] * (signal[..., :-3] + signal[..., 3:])
    steps *= dt
    return np.cumsum(steps, axis=-1, out=steps)


def nested_integral(signal: FloatArray, dt: float, order: int) -> FloatArray:
    """Integrate a uniformly sampled signal `order` times from its first sample.

    Parameters
    ----------
    signal : (..., N) float64, unit u
        Samples at 0, dt, …, (N-1) dt.
    dt : float, s
    order : int, at least 1

    Returns
    -------
    (..., N) float64, unit u s^order
        Zero at the first sample. Error O(dt^4) for smooth signals.

    Raises
    ------
    ValueError
        If order < 1 or the signal has fewer than four samples.

    Notes
    -----
    The integrals ∫^(n) of Páez-García et al. 2023, eq. (3) to (5).
    """
    if order < 1:
        raise ValueError(f"order must be at least 1, got {order}")
    for _ in range(order):
        signal = integral(signal, dt)
    return signal
