"""What a result says of the link lengths, and how far a given length lies from it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from algid.results import Result, Status
from algid.settings import Settings

FAR = 5.0  # standard deviations beyond which two statements contradict each other


def has_error_bar(result: Result, name: str) -> bool:
    """Whether an estimate is sound and the result's covariance holds it."""
    found = result.estimates.get(name)
    ok = found is not None and found.status is Status.OK and found.std is not None
    return ok and result.fit is not None and name in result.fit.covariance_names


def first_length(result: Result) -> tuple[float, float] | None:
    """l1 = g k1 / k2 and its standard deviation, in m; None where the result tells neither."""
    gravity = Settings.of(result.settings).gravity
    k1, k2 = (result.parameters.get(name) for name in ("k1", "k2"))
    if not gravity or result.fit is None or k1 is None or k2 is None or not k1.estimate or not k2.estimate:
        return None
    if not all(has_error_bar(result, name) for name in ("k1", "k2")):
        return None
    places = [result.fit.covariance_names.index(name) for name in ("k1", "k2")]
    covariance = np.array(result.fit.covariance, dtype=np.float64)[np.ix_(places, places)]
    slope = gravity * np.array([1 / k2.estimate, -k1.estimate / k2.estimate**2])
    return gravity * k1.estimate / k2.estimate, float(np.sqrt(slope @ covariance @ slope))


def contradictions(result: Result, lengths: Mapping[str, float]) -> tuple[str, ...]:
    """Sentences about given lengths far from what the result says of them: by itself, and by l1 = g k1 / k2."""
    told = {name: (found.estimate, found.std) for name, found in result.payload.items() if name in ("l1", "l2")}
    by_constants = first_length(result)
    if by_constants is not None:
        told["l1"] = by_constants
    sentences = []
    for name, given in lengths.items():
        estimate, std = told.get(name, (None, None))
        if estimate is None or not std:
            continue
        distance = abs(given - estimate) / std
        if distance > FAR:
            sentences.append(
                f"--{name} {given:g} lies {distance:.0f} σ from the result's {estimate:.5g} ± {std:.2g} m; one is wrong"
            )
    return tuple(sentences)
