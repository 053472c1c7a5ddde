"""The paper's Table 4 from any estimator's numbers, with truth and the paper's errors if known."""

from __future__ import annotations

from collections.abc import Mapping

from algid.arm import CONSTANT_NAMES, FloatArray
from algid.base.limits import LIMITS
from algid.base.names import named_values, within
from algid.estimators.paper import STAGE1_NAMES, STAGE2_NAMES
from algid.log import Truth
from algid.model import UNITS as PARAMETER_UNITS
from algid.results import Estimate, Table4Row

Rows = dict[str, tuple[str, ...]]
"""Constants by the row that is their sum; a loaded one holds the payload's share, z, too."""


def _summing(*rows: str) -> Rows:
    return {row: within(row.split("+"), CONSTANT_NAMES) for row in rows}


UNLOADED_ROWS = _summing(*STAGE1_NAMES)
LOADED_ROWS = _summing(*STAGE2_NAMES)
UNITS = {
    row: PARAMETER_UNITS[row.partition("+")[0]] for row in (*UNLOADED_ROWS, *LOADED_ROWS, "m_p")
}
"""By row, in their order: that of its first constant."""


def sums(rows: Rows, k: FloatArray) -> dict[str, float]:
    """The rows of an arm's, or of a loaded arm's, constants (7,)."""
    value = named_values(CONSTANT_NAMES, k)
    return {row: sum(map(value.__getitem__, names)) for row, names in rows.items()}


def true_parameters(truth: Truth | None, payload: float | None) -> dict[str, float]:
    """True k1 … k7 of a synthetic log's arm, with m_p, l1 and l2 if there is a `payload` in kg."""
    if truth is None:
        return {}
    constants = named_values(CONSTANT_NAMES, truth.arm.constants())
    if not payload:
        return constants
    return constants | {"m_p": payload, "l1": truth.arm.l1, "l2": truth.arm.l2}


def table4(
    estimates: Mapping[str, Estimate], truth: Truth | None, payload: float | None
) -> list[Table4Row]:
    """The twelve rows; what was not estimated, or is not known, is null.

    The truth is that of the arm behind a synthetic log and of the loaded log's `payload` in kg. The
    paper's errors are those of its cases, where the log comes from one unchanged.
    """
    true, paper = true_parameters(truth, payload), dict[str, float]()
    if truth is not None:
        from algid.synth.cases import case_names, load_case

        k = truth.arm.constants()
        true |= sums(UNLOADED_ROWS, k)
        if payload:
            true |= sums(LOADED_ROWS, truth.arm.constants(payload))
        if truth.case in case_names() and (case := load_case(truth.case)).arm == truth.arm:
            paper = case.paper_error_percent
    rows = []
    for name, unit in UNITS.items():
        own, known = estimates.get(name, Estimate(estimate=None, unit=unit)), true.get(name)
        row = Table4Row(
            parameter=name,
            unit=unit,
            estimate=own.estimate,
            std=own.std,
            truth=known,
            error_percent=100 * abs(own.estimate / known - 1)
            if known and own.estimate is not None
            else None,
            paper_error_percent=paper.get(name),
        )
        rows.append(row)
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
