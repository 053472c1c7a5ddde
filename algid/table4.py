"""The paper's Table 4 from any estimator's numbers, with truth and the paper's errors if known."""

from __future__ import annotations

from collections.abc import Mapping

from algid.arm import CONSTANT_NAMES, FloatArray, with_payload
from algid.base.limits import LIMITS
from algid.estimators.paper import STAGE1_NAMES
from algid.log import Truth
from algid.model import UNITS as PARAMETER_UNITS
from algid.results import Table4Row

UNLOADED_ROWS = STAGE1_NAMES
LOADED_ROWS = ("k5+k3+z1+z2", "k1+z3", "k3+z2", "k4+z4", "k2+z5")
UNITS = {
    row: PARAMETER_UNITS[row.partition("+")[0]] for row in UNLOADED_ROWS + LOADED_ROWS + ("m_p",)
}
"""By row, in their order: that of its first constant."""


def unloaded_rows(k: FloatArray) -> dict[str, float]:
    """The first six rows from k1 … k7 (7,)."""
    k1, k2, k3, k4, k5, k6, _ = k.tolist()
    return dict(zip(UNLOADED_ROWS, (k5 + k3, k1, k3, k6, k4, k2), strict=True))


def loaded_rows(k: FloatArray) -> dict[str, float]:
    """The next five rows from the loaded arm's constants (7,)."""
    k1, k2, k3, k4, k5, _, _ = k.tolist()
    return dict(zip(LOADED_ROWS, (k5 + k3, k1, k3, k4, k2), strict=True))


def true_rows(truth: Truth | None, payload: float | None) -> dict[str, float]:
    """All rows of the arm behind a synthetic log, with the loaded log's `payload` in kg."""
    if truth is None:
        return {}
    k = truth.arm.constants()
    rows = unloaded_rows(k)
    if payload:
        rows |= loaded_rows(with_payload(k, truth.arm.payload_constants(payload)))
        rows["m_p"] = payload
    return rows


def true_parameters(truth: Truth | None, payload: float | None) -> dict[str, float]:
    """True k1 … k7 of a synthetic log's arm, with m_p, l1 and l2 if there is a `payload` in kg."""
    if truth is None:
        return {}
    constants = dict(zip(CONSTANT_NAMES, truth.arm.constants().tolist(), strict=True))
    if not payload:
        return constants
    return constants | {"m_p": payload, "l1": truth.arm.l1, "l2": truth.arm.l2}


def paper_errors(truth: Truth | None) -> dict[str, float]:
    """The paper's errors in percent, where the log comes from one of its cases unchanged."""
    if truth is None or not truth.case:
        return {}
    from algid.synth.cases import case_names, load_case

    if truth.case not in case_names():
        return {}
    case = load_case(truth.case)
    if case.arm != truth.arm:
        return {}
    return case.paper_error_percent


def table4(
    estimates: Mapping[str, float],
    std: Mapping[str, float],
    true: Mapping[str, float],
    paper: Mapping[str, float],
) -> list[Table4Row]:
    """The twelve rows; what was not estimated, or is not known, is null."""
    rows = []
    for name, unit in UNITS.items():
        estimate, truth = finite(estimates.get(name)), true.get(name)
        error = None
        if estimate is not None and truth:
            error = 100 * abs(estimate / truth - 1)
        spread, of_paper = finite(std.get(name)), paper.get(name)
        rows.append(
            Table4Row(
                parameter=name,
                unit=unit,
                estimate=estimate,
                std=spread,
                truth=truth,
                error_percent=error,
                paper_error_percent=of_paper,
            )
        )
    return rows


def finite(value: float | None) -> float | None:
    """The value as a result holds it: None where it is not a finite number, or beyond all bounds.

    One whose inverse is beyond them is rounding, and zero.
    """
    if value is None or not abs(value) <= LIMITS.largest_value:
        return None
    if abs(value) * LIMITS.largest_value < 1:
        return 0.0
    return float(value)
