"""Shell completion of options whose choices no type states: words, a profile's choices, cases."""

from __future__ import annotations

import glob
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from algid.api.choices import CASES

Completion = Callable[[str], list[str]]


def listed(known: Callable[[], list[str]]) -> Completion:
    """Complete the last of several words, separated by commas and each used once."""

    def complete(incomplete: str) -> list[str]:
        before, comma, last = incomplete.rpartition(",")
        used = before.split(",")
        words = [word for word in known() if word.startswith(last) and word not in used]
        return [f"{before}{comma}{word}" for word in words]

    return complete


def refusing_checks() -> list[str]:
    """Codes of the checks that may be accepted."""
    from algid.profile import Check

    return list(get_args(Check))


def of_profile(setting: str, channel: str | None = None) -> Completion:
    """Completes what a setting of a profile, or of one of its channels, may be."""

    def complete(incomplete: str) -> list[str]:
        from algid.profile import Profile

        model: Any = Profile if channel is None else Profile.model_fields[channel].annotation
        known = _choices(model.model_fields[setting].annotation)
        return [word for word in known if word.startswith(incomplete)]

    return complete


def settings_of_profile(incomplete: str) -> list[str]:
    """Completes ``KEY=`` of a profile's line, and what may stand behind it."""
    from algid.profile import Profile

    key, equals, value = incomplete.partition("=")
    completions = []
    for line, annotation in _lines(Profile):
        if not equals and line.startswith(key):
            completions.append(f"{line}=")
        elif equals and line == key:
            words = [word for word in _choices(annotation) if word.startswith(value)]
            completions += [f"{key}={word}" for word in words]
    return completions


def _lines(profile: Any) -> Iterator[tuple[str, Any]]:
    """A profile's settings, those of channels by their dotted names, with their annotations."""
    for name, field in profile.model_fields.items():
        channel = getattr(field.annotation, "model_fields", None)
        if channel is None:
            yield name, field.annotation
        else:
            for key, part in channel.items():
                yield f"{name}.{key}", part.annotation


def or_files(*known: str) -> Completion:
    """Completes some words, and files."""

    def complete(incomplete: str) -> list[str]:
        shown = [word for word in known if word.startswith(incomplete)]
        for path in sorted(glob.glob(f"{glob.escape(incomplete)}*")):  # noqa: PTH207  # as typed
            shown.append(f"{path}/" if Path(path).is_dir() else path)
        return shown

    return complete


cases = or_files(*CASES)
"""Completes the cases that algid knows, and files."""


def _choices(annotation: Any) -> list[str]:
    return list(dict.fromkeys(map(str, _literals(annotation))))


def _literals(annotation: Any) -> Iterator[object]:
    if get_origin(annotation) is Literal:
        yield from get_args(annotation)
    elif annotation is bool:
        yield from ("true", "false")
    else:
        for part in get_args(annotation):
            yield from _literals(part)
