"""Names of registries, for help and completion: terms of the torque, formats, cases to simulate."""

from __future__ import annotations

CASES = ("case1", "case2")


def terms() -> list[str]:
    """What ``--model`` may hold."""
    from algid.model import CHOICES

    return ["auto", "plain", *CHOICES]


def written() -> list[str]:
    """Ends of the names of logs that algid writes."""
    from algid.writers import FORMATS

    return [f".{name}" for name in FORMATS]
