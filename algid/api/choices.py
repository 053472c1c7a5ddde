"""Names of registries, for help and completion: terms of the torque, formats, cases to simulate."""

from __future__ import annotations

from collections.abc import Callable, Mapping

CASES = ("case1", "case2")


def terms() -> list[str]:
    """What ``--model`` may hold."""
    from algid.model import CHOICES

    return ["auto", "plain", *CHOICES]


def written() -> list[str]:
    """Ends of the names of logs that algid writes."""
    from algid.writers import FORMATS

    return [f".{name}" for name in FORMATS]


LISTS: Mapping[str, Callable[[], list[str]]] = {
    "<terms>": lambda: terms()[2:],
    "<written>": written,
}
"""What stands in a help for names that only a registry tells, which is read where help is shown."""


def with_lists(text: str) -> str:
    """A help with the names that its marks stand for."""
    for mark, known in LISTS.items():
        text = text.replace(mark, ", ".join(known())) if mark in text else text
    return text
