"""The `ValueError` of an estimator if no log is long enough: the log's fault, not a defect."""

from __future__ import annotations


class TooShortError(ValueError):
    """No log has a stretch without a gap that is long enough."""
