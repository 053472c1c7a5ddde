"""What a caller says beside the logs: a profile in any form, and single settings by their names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

from algid.errors import SettingError
from algid.options import PROFILE, flag, options_of
from algid.settings import OF_BOTH, PARSERS, Settings, refuse_contradictions

if TYPE_CHECKING:
    from algid.profile import Profile

    ProfileLike = Profile | str | Path | Mapping[str, Any]
    """A profile, the path of its file, or what would stand in that."""

CHANNELS_OF = {one.name: one.channels for one in options_of(PROFILE) if one.channels}
"""Options that set the unit of several channels."""


def with_options(
    settings: Settings | None, profile: ProfileLike | None, options: Mapping[str, Any]
) -> tuple[Settings, Profile | None]:
    """Settings and profile with single settings of either over them, as flags are over a file.

    Parameters
    ----------
    settings : Settings or None
    profile : Profile, path of one, mapping or None
    options : mapping
        By the names of the fields of `Settings`, and of `Profile`'s that `Settings` does not have.

    Raises
    ------
    SettingError
        If an option is not known, or a value is wrong.
    """
    given, known = settings or Settings(), profile_of(profile)
    if not options:
        return given, known
    from algid.profile import with_settings

    own = [field.name for field in fields(Settings)]
    _refuse_unknown(options, own + _of_profile())
    of_settings, of_profile = {}, {}
    for name, value in options.items():
        if name not in own:
            of_profile[name] = value
        elif name in PARSERS and value is not None:
            of_settings[name] = PARSERS[name](_text(name, value))
        else:
            of_settings[name] = value
    refuse_contradictions(options)
    known = _over(known, of_profile)
    of_both = {name: of_settings[name] for name in OF_BOTH if name in of_settings}
    if known is not None and of_both:
        known = with_settings(known, of_both)
    return replace(given, **of_settings), known


def meaning(profile: ProfileLike | None, options: Mapping[str, Any]) -> Profile | None:
    """The profile with single settings of it over it; for verbs that have no `Settings`.

    Raises
    ------
    SettingError
        If an option is not known, or a value is wrong.
    """
    _refuse_unknown(options, _of_profile())
    return _over(profile_of(profile), options)


def profile_of(given: ProfileLike | None) -> Profile | None:
    """The profile that is given in any form.

    Raises
    ------
    SettingError
        If its file cannot be read, or a setting of it is wrong.
    """
    from algid.profile import Profile, load_profile, over

    if given is None or isinstance(given, Profile):
        return given
    if isinstance(given, str | Path):
        return load_profile(Path(given))
    if not isinstance(given, Mapping):
        raise SettingError(
            f"profile: expected a path, a dict or a Profile, found {type(given).__name__}"
        )
    return over(None, given)


def two_names(name: str, given: object) -> tuple[str, str]:
    """The names in ``NAME,NAME`` or a pair; raises `SettingError` where there are not two."""
    parts = given
    if isinstance(given, str):
        parts = given.split(",")
    if isinstance(parts, list | tuple) and len(parts) == 2:
        first, second = str(parts[0]).strip(), str(parts[1]).strip()
        if first and second:
            return first, second
    raise SettingError(f"{flag(name)}: expected two names like shoulder,elbow, found {given!r:.60}")


def _of_profile() -> list[str]:
    from algid.profile import Profile

    return list(Profile.model_fields) + list(CHANNELS_OF)


def _over(profile: Profile | None, options: Mapping[str, Any]) -> Profile | None:
    """The profile with options over it, one after another."""
    from algid.profile import Profile, with_settings

    for name, value in options.items():
        settings = {name: value}
        if name in CHANNELS_OF:
            settings = {channel: {"unit": value} for channel in CHANNELS_OF[name]}
        elif name == "joints" and value is not None:
            settings = {name: two_names(name, value)}
        profile = with_settings(profile or Profile(), settings)
    return profile


def _refuse_unknown(options: Mapping[str, Any], known: list[str]) -> None:
    for name in options:
        if name not in known:
            mend = f"known are {', '.join(dict.fromkeys(known))}"
            for near in get_close_matches(name, known, n=1):
                mend = f"did you mean {near}?"
            raise SettingError(f"{name}: no setting has this name; {mend}")


def _text(name: str, value: object) -> str:
    """What the command line would be given."""
    if isinstance(value, str):
        return value
    if not isinstance(value, list | tuple):
        raise SettingError(f"{flag(name)}: expected text or numbers, found {value!r:.60}")
    return ",".join(map(str, value))
