"""Shell completion of options whose choices no type states: words, a profile's choices, cases."""

from __future__ import annotations

import glob
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from algid.options import BY_SET

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


def terms() -> list[str]:
    """What ``--model`` may hold."""
    from algid.model import CHOICES

    return ["auto", "plain", *CHOICES]


def of_profile(setting: str) -> Completion | None:
    """Completes what a setting of a profile may be; None where that is the user's own."""
    from algid.profile import CHANNELS_OF, Profile

    model: Any = Profile
    if setting in CHANNELS_OF:
        model = Profile.model_fields[CHANNELS_OF[setting][0]].annotation
        setting = "unit"
    known = _choices(model.model_fields[setting].annotation)
    if not known:
        return None
    return lambda incomplete: [word for word in known if word.startswith(incomplete)]


def set_lines(incomplete: str) -> list[str]:
    """Completes ``KEY=`` of a profile's line or of a setting, and what may stand behind it."""
    from algid.profile import Profile
    from algid.settings import Settings

    key, equals, value = incomplete.partition("=")
    lines = dict(_lines(Settings))
    lines = {name: kind for name, kind in lines.items() if name in BY_SET} | dict(_lines(Profile))
    if not equals:
        return [f"{line}=" for line in lines if line.startswith(key)]
    words = _choices(lines.get(key))
    return [f"{key}={word}" for word in words if word.startswith(value)]


def _lines(model: Any) -> Iterator[tuple[str, Any]]:
    """A model's fields, those of channels by their dotted names, with their annotations."""
    for name, field in model.model_fields.items():
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


CASES = ("case1", "case2")
cases = or_files(*CASES)
"""Completes the cases that algid knows, and files."""
excitations = or_files("case", "wide", "none")
COMPLETED: Mapping[str, Completion] = {
    "model": listed(terms),
    "accept": listed(refusing_checks),
    "set": set_lines,
}
"""Settings that are text and take some words, beside those whose words a type states."""


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
