"""What an estimator raises where no log is long enough for it: the one `ValueError` that is the log's, not a fault."""

from __future__ import annotations


class TooShortError(ValueError):
    """No log has a stretch without a gap that is long enough."""
