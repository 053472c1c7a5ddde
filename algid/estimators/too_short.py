"""The `ValueError` of an estimator if no log is long enough: the log's fault, not a defect."""

from __future__ import annotations


class TooShortError(ValueError):
    """No log has a stretch without a gap that is long enough."""


OF_A_WINDOW = "log is long enough: expected more than a second of samples without a gap"
"""What an estimator by windows says where none is, behind which log it means."""
