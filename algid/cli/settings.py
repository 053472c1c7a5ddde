"""The command line's options of `Settings`, one a field, and those of a profile: what a log means.

A command declares its own options; `takes_settings` and `takes_profile` add these, and hand it a
`Choice` of both.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
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
from algid.settings import OF_BOTH, Settings, flag, refuse_contradictions
from algid.units import names_of

if TYPE_CHECKING:
    from algid.profile import Profile

MODEL, METHOD, LOG = "The arm's model", "Method", "What the log means"
"""Panels of a command's help."""
MODELLED = ("gravity", "effort", "model", "torque_hold", "delay", "l1", "l2")


COMPLETED = {"model": listed(terms)}
"""Settings that are text and take some words."""


def _words(names: Sequence[str]) -> str:
    """Names as a command line takes them, the last behind "or"."""
    *most, last = (f'"{name}"' if " " in name else name for name in names)
    return f"{', '.join(most)} or {last}"


OF_PROFILE: Mapping[str, tuple[Any, str, Completion | None]] = {
    "profile": (Path, "algid.toml that says what the log's names and units mean.", None),
    "topic": (str, "Topic with the joint states.", None),
    "joints": (str, "The two joints, as NAME,NAME.", None),
    "rate": (str, "Samples a second, Hz, of a table without a time.", None),
    "columns": (str, "Names of the columns of a CSV without a header, as t,theta1,….", None),
    "angle_unit": (str, f"{_words(names_of('angle'))}.", of_profile("unit", "theta1")),
    "torque_unit": (str, f"{_words(names_of('torque', 'current'))}.", of_profile("unit", "tau1")),
    "zero": (str, "Where θ1 is zero: horizontal, hanging or upright.", of_profile("zero")),
    "second_angle": (str, "θ2 is relative (to link 1) or absolute.", of_profile("second_angle")),
    "drive": (
        str,
        "Where the second motor stands: in its joint, or at the base.",
        of_profile("drive"),
    ),
    "passive": (
        str,
        "The joint without a motor, 1 or 2: its torque is zero.",
        of_profile("passive"),
    ),
    "clock": (str, "Stamps of the messages' header, or of the log.", of_profile("clock")),
    "start": (str, "Leave out what comes before, s since the log's first sample.", None),
    "end": (str, "Leave out what comes after, s since the log's first sample.", None),
    "torque_file": (Path, "File with the torques, where LOG has none: joined on the stamps.", None),
    "segment": (str, "One run alone, 1 for the first, where the log's time starts again.", None),
    "accept": (str, "Checks that may warn but not refuse, as CODE,CODE.", listed(refusing_checks)),
    "set": (
        list[str],
        "Any setting of a profile, as tau1.sign=-1; may be repeated.",
        settings_of_profile,
    ),
}
"""Type, help and completion of a profile's file, its settings with flags, and any other."""


def options_of_settings() -> Iterator[inspect.Parameter]:
    """An option for each field of `Settings`: a bool has no --no-; parsed fields are text."""
    hints = get_type_hints(Settings)
    for field in fields(Settings):
        kind, default = hints[field.name], field.default
        if field.metadata.get(
            "profile"
        ):  # the profile may say it: what is not given is not known here
            kind, default = kind | None, None
        if "parse" in field.metadata:
            kind, default = str | None, None if default is None else f"{default:g}"
        panel = MODEL if field.name in MODELLED else METHOD
        yield _option(
            field.name, kind, default, field.metadata["help"], panel, COMPLETED.get(field.name)
        )


def options_of_profile() -> Iterator[inspect.Parameter]:
    """An option for each row of `OF_PROFILE`."""
    for name, (kind, text, completed) in OF_PROFILE.items():
        yield _option(name, kind | None, None, text, LOG, completed)


def _option(
    name: str, kind: Any, default: Any, text: str, panel: str, completed: Completion | None
) -> inspect.Parameter:
    option = typer.Option(flag(name), help=text, rich_help_panel=panel, autocompletion=completed)
    return inspect.Parameter(
        name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[kind, option]
    )


@dataclass(frozen=True)
class Choice:
    """What the shared options were set to; None stands for an option that was not given.

    Parameters
    ----------
    settings_flags : by the names of `Settings`' fields
    profile_flags : by the names of `OF_PROFILE`
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
        parsers = {
            field.name: field.metadata.get("parse", lambda given: given)
            for field in fields(Settings)
        }
        given = {name: value for name, value in self.settings_flags.items() if value is not None}
        refuse_contradictions(given)
        return Settings(**{name: parsers[name](value) for name, value in given.items()})

    def profile(self, file: Path | None = None) -> Profile | None:
        """The profile of `file`, or of ``--profile``, with the flags over it.

        None where none is given.

        Raises
        ------
        SettingError
            If the file or a flag is wrong.
        """
        found = profile_from(
            {**self.profile_flags, "profile": file or self.profile_flags.get("profile")}
        )
        said = {name: self.settings_flags.get(name) for name in OF_BOTH}
        given = {name: value for name, value in said.items() if value is not None}
        if not given or (found is None and "effort" not in given):
            return found
        from algid.profile import Profile, with_settings

        return with_settings(found or Profile(), given)


def profile_from(flags: Mapping[str, Any]) -> Profile | None:
    """The profile of ``--profile``, with the other flags of `OF_PROFILE` over it, in their order.

    Raises
    ------
    SettingError
        If the file or a flag is wrong: the flag is named, and the profile's line beside it.
    """
    given = {name: value for name, value in flags.items() if value not in (None, [])}
    if not given:
        return None
    from algid.profile import Profile, ProfileSettingError, load_profile, with_settings

    file = given.pop("profile", None)
    found = load_profile(file) if file else Profile()
    texts = {name: value if name == "set" else [value] for name, value in given.items()}
    for name, text in ((name, text) for name, every in texts.items() for text in every):
        meaning = _meaning(name, text)
        try:
            found = with_settings(found, meaning)
        except ProfileSettingError as error:
            where = f"{flag(name)} (profile: {error.place})"
            raise SettingError(f"{where}: {error.why}") from error
    return found


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
    return _taking(command, [*options_of_profile()], [*options_of_settings()])


def takes_profile(command: Callable[..., None]) -> Callable[..., None]:
    """Give `command`, whose first parameter is the `Choice`, the options of logs after its own."""
    return _taking(command, [*options_of_profile()], [])


def _taking(
    command: Callable[..., None],
    profile: Sequence[inspect.Parameter],
    settings: Sequence[inspect.Parameter],
) -> Callable[..., None]:
    _, *own = inspect.signature(command, eval_str=True).parameters.values()

    @wraps(command)
    def with_options(**values: Any) -> None:
        chosen, meaning = (
            {one.name: values.pop(one.name) for one in part} for part in (settings, profile)
        )
        command(Choice(chosen, meaning), **values)

    every = [
        *(one.replace(kind=inspect.Parameter.KEYWORD_ONLY) for one in own),
        *profile,
        *settings,
    ]
    # typer reads it
    with_options.__signature__ = inspect.Signature(every)  # type: ignore[attr-defined]
    with_options.__annotations__ = {parameter.name: parameter.annotation for parameter in every}
    return with_options
