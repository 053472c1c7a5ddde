"""The command line's options of `Settings`, one a field, and those of a profile: what a log means.

A command declares its own options; `takes_settings` and `takes_profile` add these, and hand it a
`Choice` of both.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from algid.api.choices import terms
from algid.api.options import CHANNELS_OF, two_names
from algid.cli.completion import (
    Completion,
    listed,
    of_profile,
    refusing_checks,
    settings_of_profile,
)
from algid.errors import SettingError
from algid.files import parsed_toml
from algid.limits import LIMITS
from algid.options import BY_TAKER, PROFILE, SETTINGS, Option, flag, options_of
from algid.settings import OF_BOTH, PARSERS, Settings, refuse_contradictions

if TYPE_CHECKING:
    from algid.profile import Profile

MODEL, METHOD, LOG = "The arm's model", "Method", "What the log means"
"""Panels of a command's help."""
COMPLETED: dict[str, Completion] = {
    "model": listed(terms),
    "accept": listed(refusing_checks),
    "set": settings_of_profile,
}
"""Options that are text and take some words, beside those whose words a profile knows."""


def options_of_settings() -> Iterator[inspect.Parameter]:
    """An option for each field of `Settings`: a bool has no --no-; parsed fields are text."""
    hints = get_type_hints(Settings)
    for field in fields(Settings):
        option = BY_TAKER[SETTINGS, field.name]
        kind, default = hints[field.name], field.default
        if field.name in OF_BOTH:  # the profile may say it: what is not given is not known here
            kind, default = kind | None, None
        if field.name in PARSERS:
            kind, default = str | None, None if default is None else f"{default:g}"
        yield _parameter(option, kind, default, MODEL if option.model else METHOD)


def options_of_profile() -> Iterator[inspect.Parameter]:
    """An option for each setting of a profile that has a flag of its own."""
    for option in options_of(PROFILE):
        if option.name not in OF_BOTH:
            kind: Any = option.kind
            yield _parameter(option, kind | None, None, LOG)


def _parameter(option: Option, kind: Any, default: Any, panel: str) -> inspect.Parameter:
    declared = typer.Option(
        flag(option.name),
        help=option.help,
        rich_help_panel=panel,
        autocompletion=_completion(option),
    )
    return inspect.Parameter(
        option.name,
        inspect.Parameter.KEYWORD_ONLY,
        default=default,
        annotation=Annotated[kind, declared],
    )


def _completion(option: Option) -> Completion | None:
    """What completes an option: its own words, or those of the profile's annotation."""
    if option.name in COMPLETED or PROFILE not in option.of or option.kind is not str:
        return COMPLETED.get(option.name)
    if option.channels:
        return of_profile("unit", option.channels[0])
    return None if option.name in OF_BOTH else of_profile(option.name)


@dataclass(frozen=True)
class Choice:
    """What the shared options were set to; None stands for an option that was not given.

    Parameters
    ----------
    settings_flags : by the names of `Settings`' fields
    profile_flags : by the names of the profile's options
    """

    settings_flags: Mapping[str, Any]
    profile_flags: Mapping[str, Any]

    def settings(self) -> Settings:
        """As the pipeline takes them.

        Raises
        ------
        SettingError
            If an option is wrong.
        """
        given = _given(self.settings_flags)
        refuse_contradictions(given)
        for name, parse in PARSERS.items():
            if name in given:
                given[name] = parse(given[name])
        return Settings(**given)

    def profile(self, file: Path | None = None) -> Profile | None:
        """The profile of `file`, or of ``--profile``, with the flags over it.

        None where none is given.

        Raises
        ------
        SettingError
            If the file or a flag is wrong.
        """
        flags = dict(self.profile_flags)
        if file:
            flags["profile"] = file
        profile = profile_from(flags)
        given = _given({name: self.settings_flags.get(name) for name in OF_BOTH})
        if not given or (profile is None and "effort" not in given):
            return profile
        from algid.profile import Profile, with_settings

        return with_settings(profile or Profile(), given)


def _given(flags: Mapping[str, Any]) -> dict[str, Any]:
    """The flags that were given."""
    return {name: value for name, value in flags.items() if value is not None}


def profile_from(flags: Mapping[str, Any]) -> Profile | None:
    """The profile of ``--profile``, with the other flags of the profile over it, in their order.

    Raises
    ------
    SettingError
        If the file or a flag is wrong: the flag is named, and the profile's line beside it.
    """
    given = _given(flags)
    file, lines = given.pop("profile", None), given.pop("set", [])
    meanings = [(name, text) for name, text in given.items()]
    meanings += [("set", line) for line in lines]
    if not file and not meanings:
        return None
    from algid.profile import Profile, ProfileSettingError, load_profile, with_settings

    profile = load_profile(file) if file else Profile()
    for name, text in meanings:
        meaning = _meaning(name, text)
        try:
            profile = with_settings(profile, meaning)
        except ProfileSettingError as error:
            where = f"{flag(name)} (profile: {error.place})"
            raise SettingError(f"{where}: {error.why}") from error
    return profile


def _meaning(name: str, text: str) -> dict[str, Any]:
    """A profile's settings out of a flag's text."""
    if name == "joints":
        return {name: two_names(name, text)}
    if name in CHANNELS_OF:
        return {channel: {"unit": text} for channel in CHANNELS_OF[name]}
    if name != "set":
        return {name: text}
    key, _, value = text.partition("=")
    if "=" not in text or not key.strip():
        raise SettingError(f"--set {text}: expected KEY=VALUE like tau1.sign=-1")
    try:
        return parsed_toml(f"{key} = {value}")
    except (ValueError, RecursionError) as error:  # a bare word
        if key.count(".") > LIMITS.toml_key_parts:
            raise SettingError(
                f"--set {key[:40]}…: {error}; expected KEY=VALUE like tau1.sign=-1"
            ) from error
        setting: Any = value.strip()
        for part in reversed(key.split(".")):
            setting = {part.strip(): setting}
        return dict(setting)


def takes_settings(command: Callable[..., None]) -> Callable[..., None]:
    """Give `command`, whose first parameter is `Choice`, the options of logs and then settings."""
    return _taking(command, list(options_of_profile()), list(options_of_settings()))


def takes_profile(command: Callable[..., None]) -> Callable[..., None]:
    """Give `command`, whose first parameter is the `Choice`, the options of logs after its own."""
    return _taking(command, list(options_of_profile()), [])


def _taking(
    command: Callable[..., None],
    profile: list[inspect.Parameter],
    settings: list[inspect.Parameter],
) -> Callable[..., None]:
    own = list(inspect.signature(command, eval_str=True).parameters.values())[1:]

    @wraps(command)
    def with_options(**values: Any) -> None:
        chosen = {one.name: values.pop(one.name) for one in settings}
        meaning = {one.name: values.pop(one.name) for one in profile}
        command(Choice(chosen, meaning), **values)

    every = [one.replace(kind=inspect.Parameter.KEYWORD_ONLY) for one in own] + profile + settings
    # typer reads it
    with_options.__signature__ = inspect.Signature(every)  # type: ignore[attr-defined]
    with_options.__annotations__ = {parameter.name: parameter.annotation for parameter in every}
    return with_options
