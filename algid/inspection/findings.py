"""Which of the named checks forbid the use of a log; `messages.toml` says what each finds."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from algid.notices import Notice, Remedy

REFUSED = ("EFFORT_ZERO", "WRAPPED_ANGLE", "DEGREES")
"""The checks that refuse a log unless they are accepted."""

CONTRADICTIONS = ("WRONG_CONVENTION", "FLIPPED_SIGN", "WRONG_ZERO")
"""Findings that say that a log was read by a wrong convention."""


def yielding(notice: Notice, accepted: Collection[str]) -> Notice:
    """A refusal with what overrides it, or as a warning where its code is in `accepted`.

    Else the same.
    """
    if not notice.refuse:
        return notice
    if notice.code in accepted:
        numbers = {**notice.numbers, "accepted": True}
        return replace(notice, refuse=False, remedies=(), text="", numbers=numbers)
    override = Remedy({"accept": notice.code}, "to use it nevertheless")
    return replace(notice, remedies=(*notice.remedies, override))
