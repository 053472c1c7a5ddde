"""What is said of a fit: warnings that a reader has to know, and notes on what its intervals leave out."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from algid import results
from algid.estimators.diagnostics import broken_bounds, length_by_constants, payload_distance
from algid.estimators.fit import Fit
from algid.estimators.instruments import ENDOGENEOUS
from algid.log import Notice

ONE_RUN = "what differs from run to run is not in the intervals: give four logs or more"
"""Of intervals that rest on blocks of logs."""
ONE_SIDED = 1.645  # standard deviations of a one-sided bound at 95 %
FAR_APART = 5.0  # standard deviations past which two logs are not of one arm
EXCHANGED = "the payload's mass is negative by far: the loaded and the unloaded logs are exchanged"


def exchanged(fit: Fit) -> bool:
    """Whether the unloaded arm bears more than the loaded one, and by far."""
    return any(b.bound == "m_p >= 0" and b.distance is not None and b.distance > FAR_APART for b in broken_bounds(fit))


def fit_warnings(fit: Fit) -> Iterator[str]:
    """What a user should know about a fit."""
    if fit.note:
        yield f"{fit.note}; {ONE_RUN}" if fit.intervals == "sandwich" else fit.note
    if not fit.converged and not (fit.note or "").startswith("--constrain"):
        yield "the refined estimator did not converge; the weak estimate is reported instead"
    yield from fit.unidentifiable
    if fit.shared.model.gravity == 0:
        yield "without gravity k2 and k4 have no effect and the payload has no weight: give --l1 or --l2 to tell it"
    if fit.endogeneity is not None and fit.endogeneity > ENDOGENEOUS and fit.estimator != "instruments":
        yield (
            f"instruments and least squares are {fit.endogeneity:.1f} standard deviations apart: torque that the model "
            "lacks drives the motion, and least squares takes the constants too small; compare --estimator instruments"
        )
    if "m_p" in fit.names:
        place = fit.names.index("m_p")
        mass, std = float(fit.values[place]), float(fit.std[place])
        if np.isfinite(std) and abs(mass) < fit.quantile * std:
            yield f"the payload is not told from zero: at most {max(mass + ONE_SIDED * std, 0.0):.3g} kg at 95 %"
        elif np.isinf(std) and not fit.shared.lengths:
            yield "without link lengths a payload near zero is not determined: give --l1 and --l2"
    for bound in broken_bounds(fit):
        distance = "" if bound.distance is None else f", {bound.distance:.1f} standard deviations beyond"
        yield f"the estimates break {bound.bound}: {bound.value:.4g}{distance}"
    given, by_constants = fit.shared.lengths.get("l1"), length_by_constants(fit)
    if given is not None and by_constants is not None and abs(by_constants[0] - given) > FAR_APART * by_constants[1]:
        length, std = by_constants
        text = f"g k1 / k2 makes l1 {length:.4g} ± {fit.quantile * std:.2g} m, given are {given:g} m: gravity is"
        why = "compensated in part, or a zero, a sign or a term of the torque is wrong"
        yield Notice("LENGTH_MISMATCH", f"LENGTH_MISMATCH: {text} {why}").text
    if exchanged(fit):
        yield Notice("EXCHANGED_LOGS", f"EXCHANGED_LOGS: {EXCHANGED}").text
    apart = payload_distance(fit)
    if apart is not None and apart > FAR_APART:
        yield f"the loaded and the unloaded logs are {apart:.1f} standard deviations from belonging to one arm"


def fit_notes(fit: results.FitSummary, warnings: list[str]) -> Iterator[str]:
    """What blocks of logs leave out where none of the `warnings` says so, how well the payload repeats, the gain."""
    if fit.intervals == "sandwich" and not any(ONE_RUN in warning for warning in warnings):
        yield ONE_RUN
    if fit.repeatability is not None:
        masses = ", ".join(f"{mass:.4g}" for mass in fit.repeatability.masses)
        low, high = fit.repeatability.ci95
        yield (
            f"the loaded runs by themselves weigh {masses} kg: repeatability {fit.repeatability.std:.2g} kg "
            f"(95 %: {low:.2g} to {high:.2g})"
        )
    gain = fit.torque_gain
    if gain is not None and (gain.estimate is None or gain.ci95 is None):
        yield "the payload that is known does not tell the gain of the torques: its mass is not told from zero"
    elif gain is not None and gain.ci95 is not None:
        yield (
            f"by the payload that is known the torques have to be multiplied by {gain.estimate:.5g} "
            f"(95 %: {gain.ci95[0]:.5g} to {gain.ci95[1]:.5g}), and with them k1 … k7, friction and masses: "
            "set torque_constant or gear_ratio of [tau1] and [tau2]"
        )
