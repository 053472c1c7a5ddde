"""The options of every command that reads a log (a profile, and flags that beat it), and those of `Settings`."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import Field, dataclass, fields
from functools import cache, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from algid.cli.completion import Completion, listed, of_profile, settings_of_profile, words
from algid.settings import Settings, flag

if TYPE_CHECKING:
    from algid.profile import Profile

MODEL, METHOD, LOG = "The arm's model", "Method", "What the log means"
"""Panels of a command's help."""
MODELLED = ("gravity", "model", "friction", "torque_offset", "rotor_inertia", "torque_hold", "delay", "l1", "l2")


def _checks() -> list[str]:
    from algid.inspection.checks import REFUSED

    return list(REFUSED)


def _terms() -> list[str]:
    from algid.model import TERMS

    return ["auto", "plain", *TERMS, "delay"]


_COMPLETED = {"model": listed(_terms), "delay": words("estimate")}
"""Settings that are text and take some words."""


def _of_log(text: str, *names: str, completed: Completion | None = None) -> Any:
    """An option that tells what the log means, with the help `text`."""
    return typer.Option(*names, help=text, autocompletion=completed, rich_help_panel=LOG)


ProfileFile = Annotated[Path | None, _of_log("algid.toml that says what the log's names and units mean.", "--profile")]
Topic = Annotated[str | None, _of_log("Topic with the joint states.")]
Joints = Annotated[str | None, _of_log("The two joints, as NAME,NAME.")]
AngleUnit = Annotated[str | None, _of_log("rad, deg, rev or counts.", completed=of_profile("unit", "theta1"))]
TorqueUnit = Annotated[str | None, _of_log('"N m", "mN m", A or mA.', completed=of_profile("unit", "tau1"))]
Zero = Annotated[str | None, _of_log("Where θ1 is zero: horizontal or hanging.", completed=of_profile("zero"))]
SecondAngle = Annotated[
    str | None, _of_log("θ2 is relative (to link 1) or absolute.", completed=of_profile("second_angle"))
]
Drive = Annotated[
    str | None,
    _of_log("Where the second motor stands: in its joint, or at the base.", completed=of_profile("drive")),
]
Passive = Annotated[
    str | None,
    _of_log("The joint without a motor, 1 or 2: its torque is zero.", completed=of_profile("passive")),
]
Sets = Annotated[
    list[str] | None,
    _of_log("Any setting of a profile, as tau1.sign=-1; may be repeated.", "--set", completed=settings_of_profile),
]
Clock = Annotated[str | None, _of_log("Stamps of the messages' header, or of the log.", completed=of_profile("clock"))]
Start = Annotated[str | None, _of_log("Leave out what comes before, s since the log's first sample.")]
End = Annotated[str | None, _of_log("Leave out what comes after, s since the log's first sample.")]
Accept = Annotated[str | None, _of_log("Checks that may warn but not refuse, as CODE,CODE.", completed=listed(_checks))]


def profile_from(file: Path | None, sets: Sequence[str] = (), **flags: str | None) -> Profile | None:
    """The profile of a file with flags over it, and `sets` over these; None where none is given.

    Raises
    ------
    SettingError
        If the file or a flag is wrong.
    """
    given = {name: value for name, value in flags.items() if value is not None}
    if file is None and not given and not sets:
        return None
    from algid.profile import Profile, load_profile, with_settings

    settings: dict[str, Any] = {}
    for name, value in given.items():
        if name == "joints":
            settings["joints"] = [part.strip() for part in value.split(",")]
        elif name == "angle_unit":
            settings |= {channel: {"unit": value} for channel in ("theta1", "theta2", "omega1", "omega2")}
        elif name == "torque_unit":
            settings |= {channel: {"unit": value} for channel in ("tau1", "tau2")}
        else:
            settings[name] = value
    for text in sets:
        _merge(settings, _setting(text))
    return with_settings(load_profile(file) if file else Profile(), settings)


@dataclass(frozen=True)
class Choice:
    """What the shared options were set to."""

    settings_flags: Mapping[str, Any]
    profile_file: Path | None
    profile_flags: Mapping[str, str | None]
    profile_sets: Sequence[str] = ()

    def settings(self) -> Settings:
        """As the pipeline takes them. Raises `SettingError` where an option is wrong."""
        return Settings(
            **{
                field.name: _value(field, self.settings_flags[field.name])
                for field in fields(Settings)
                if self.settings_flags[field.name] is not None
            }
        )

    def profile(self, file: Path | None = None) -> Profile | None:
        """The profile of `file`, or of ``--profile``, with the flags over it. Raises `SettingError`."""
        found = profile_from(file or self.profile_file, self.profile_sets, **self.profile_flags)
        gravity = self.settings_flags.get("gravity")
        if found is None or gravity is None:
            return found
        from algid.profile import with_settings

        return with_settings(found, {"gravity": gravity})


def _profile(
    profile: ProfileFile = None,
    topic: Topic = None,
    joints: Joints = None,
    angle_unit: AngleUnit = None,
    torque_unit: TorqueUnit = None,
    zero: Zero = None,
    second_angle: SecondAngle = None,
    drive: Drive = None,
    passive: Passive = None,
    clock: Clock = None,
    start: Start = None,
    end: End = None,
    accept: Accept = None,
    sets: Sets = None,
) -> None:
    """The options of a profile."""


def takes_settings(command: Callable[..., None]) -> Callable[..., None]:
    """Give `command`, whose first parameter is the `Choice`, the options of logs and of settings after its own."""
    return _taking(command, _parameters(_profile), _settings())


def takes_profile(command: Callable[..., None]) -> Callable[..., None]:
    """Give `command`, whose first parameter is the `Choice`, the options of logs after its own."""
    return _taking(command, _parameters(_profile), ())


def _taking(
    command: Callable[..., None], profile: Sequence[inspect.Parameter], settings: Sequence[inspect.Parameter]
) -> Callable[..., None]:
    own = _parameters(command)[1:]

    @wraps(command)
    def with_options(**values: Any) -> None:
        chosen = {parameter.name: values.pop(parameter.name) for parameter in settings}
        meaning = {parameter.name: values.pop(parameter.name) for parameter in profile}
        command(Choice(chosen, meaning.pop("profile"), meaning, meaning.pop("sets") or ()), **values)

    every = [*own, *profile, *settings]
    with_options.__signature__ = inspect.Signature(every)  # type: ignore[attr-defined]  # typer reads it
    with_options.__annotations__ = {parameter.name: parameter.annotation for parameter in every}
    return with_options


@cache
def _parameters(function: Callable[..., None]) -> tuple[inspect.Parameter, ...]:
    found = inspect.signature(function, eval_str=True).parameters.values()
    return tuple(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY) for parameter in found)


@cache
def _settings() -> tuple[inspect.Parameter, ...]:
    """An option for each field of `Settings`."""
    hints = get_type_hints(Settings)
    return tuple(_option(field, hints[field.name]) for field in fields(Settings))


def _setting(text: str) -> dict[str, Any]:
    """A profile's setting out of KEY=VALUE: the value as TOML has it, or a bare word."""
    import tomllib

    from algid.errors import SettingError

    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise SettingError(f"--set {text}: expected KEY=VALUE like tau1.sign=-1")
    try:
        return tomllib.loads(f"{key} = {value}")
    except tomllib.TOMLDecodeError:
        pass
    try:
        return tomllib.loads(f"{key} = {json.dumps(value.strip())}")
    except tomllib.TOMLDecodeError as error:
        raise SettingError(f"--set {text}: expected KEY=VALUE like tau1.sign=-1 ({error})") from error


def _merge(settings: dict[str, Any], more: Mapping[str, Any]) -> None:
    """Set what `more` holds, channel by channel."""
    for name, value in more.items():
        if isinstance(value, Mapping):
            settings[name] = {**settings.get(name, {}), **value}
        else:
            settings[name] = value


def _option(field: Field[Any], kind: Any) -> inspect.Parameter:
    """A field's option; a bool has no --no-, and what its type does not tell is text for its own parser."""
    default = field.default
    if field.metadata.get("profile"):  # the profile may say it: what is not given is not known here
        kind, default = kind | None, None
    if "parse" in field.metadata:
        kind, default = str | None, None if default is None else f"{default:g}"
    panel = MODEL if field.name in MODELLED else METHOD
    completed = _COMPLETED.get(field.name)
    option = typer.Option(
        flag(field.name), help=field.metadata["help"], rich_help_panel=panel, autocompletion=completed
    )
    annotation = Annotated[kind, option]
    return inspect.Parameter(field.name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


def _value(field: Field[Any], given: Any) -> Any:
    return field.metadata["parse"](given) if "parse" in field.metadata else given
