"""The options of every command that reads a log: a profile, and flags that beat it.

The options that decide an identification, shared by every command that identifies.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

if TYPE_CHECKING:
    from algid.profile import Profile

ProfileFile = Annotated[
    Path | None, typer.Option("--profile", help="algid.toml that says what the log's names and units mean.")
]
Topic = Annotated[str | None, typer.Option(help="Topic with the joint states.")]
Joints = Annotated[str | None, typer.Option(help="The two joints, as NAME,NAME.")]
AngleUnit = Annotated[str | None, typer.Option(help="rad, deg, rev or counts.")]
TorqueUnit = Annotated[str | None, typer.Option(help='"N m", "mN m", A or mA.')]
Zero = Annotated[str | None, typer.Option(help="Where θ1 is nought: horizontal or hanging.")]
SecondAngle = Annotated[str | None, typer.Option(help="θ2 is relative (to link 1) or absolute.")]
Clock = Annotated[str | None, typer.Option(help="Stamps of the messages' header, or of the log.")]


def profile_from(file: Path | None, **flags: str | None) -> Profile | None:
    """The profile of a file with flags over it; None where neither is given.

    Raises
    ------
    SettingError
        If the file or a flag is wrong.
    """
    given = {name: value for name, value in flags.items() if value is not None}
    if file is None and not given:
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
    return with_settings(load_profile(file) if file else Profile(), settings)


if TYPE_CHECKING:
    from algid.profile import Profile
    from algid.settings import Settings


class Estimator(StrEnum):
    """The estimators."""

    REFINED = "refined"
    WEAK = "weak"
    PAPER = "paper"


class Velocity(StrEnum):
    """Where joint velocities come from."""

    OBSERVER = "observer"
    MEASURED = "measured"


class Observer(StrEnum):
    """How joint velocities are observed."""

    LUENBERGER = "luenberger"
    ZERO_PHASE = "zero-phase"


class Friction(StrEnum):
    """Friction models."""

    VISCOUS = "viscous"
    COULOMB = "coulomb"


class Hold(StrEnum):
    """What the drive does between two torque samples."""

    FOH = "foh"
    ZOH = "zoh"


@dataclass(frozen=True)
class Choice:
    """What the shared options were set to."""

    settings_flags: Mapping[str, Any]
    profile_file: Path | None
    profile_flags: Mapping[str, str | None]

    def settings(self) -> Settings:
        """As the pipeline takes them. Raises `SettingError` where an option is wrong."""
        from algid.settings import Settings

        flags: dict[str, Any] = {
            name: value.value if isinstance(value, StrEnum) else value for name, value in self.settings_flags.items()
        }
        flags["delay"] = _delay(flags["delay"])
        poles = flags.pop("poles")
        return Settings(**flags) if poles is None else Settings(**flags, poles=_poles(poles))

    def profile(self, file: Path | None = None) -> Profile | None:
        """The profile of `file`, or of ``--profile``, with the flags over it. Raises `SettingError`."""
        return profile_from(file or self.profile_file, **self.profile_flags)


def _settings(
    estimator: Annotated[Estimator, typer.Option(help="How to estimate.")] = Estimator.REFINED,
    velocity: Annotated[Velocity, typer.Option(help="Observe velocities, or use the log's own.")] = Velocity.OBSERVER,
    observer: Annotated[
        Observer | None, typer.Option(help="The paper's observer, or the zero-phase differentiator.")
    ] = None,
    poles: Annotated[
        str | None, typer.Option(help="Six poles of the paper's observer, rad/s, three a joint, like -80,-390,….")
    ] = None,
    window: Annotated[
        float | None,
        typer.Option(help="Window, s: the paper's integrals restart after it (2), or the weak form's (0.4)."),
    ] = None,
    bandwidth: Annotated[float, typer.Option(help="Of the zero-phase differentiator, Hz.")] = 60.0,
    gravity: Annotated[float, typer.Option(help="m/s²; 0 for an arm that moves in a horizontal plane.")] = 9.81,
    friction: Annotated[Friction, typer.Option(help="Viscous, or viscous and Coulomb.")] = Friction.VISCOUS,
    torque_offset: Annotated[bool, typer.Option("--torque-offset", help="Estimate an offset of each torque.")] = False,
    rotor_inertia: Annotated[bool, typer.Option("--rotor-inertia", help="Estimate joint 2's rotor inertia.")] = False,
    torque_hold: Annotated[Hold, typer.Option(help="Torque between samples: ramped or held.")] = Hold.FOH,
    delay: Annotated[str, typer.Option(help="From torque to angle, s, or 'estimate'.")] = "0",
    l1: Annotated[float | None, typer.Option("--l1", help="Length of link 1, m, where known.")] = None,
    l2: Annotated[float | None, typer.Option("--l2", help="Length of link 2, m, where known.")] = None,
    constrain: Annotated[bool, typer.Option("--constrain", help="Solve within the physical bounds.")] = False,
    cross_validate: Annotated[
        bool, typer.Option("--cross-validate", help="Predict each log from the others and report how well.")
    ] = False,
) -> None:
    """The options of `Settings`, in its words."""


def _profile(
    profile: ProfileFile = None,
    topic: Topic = None,
    joints: Joints = None,
    angle_unit: AngleUnit = None,
    torque_unit: TorqueUnit = None,
    zero: Zero = None,
    second_angle: SecondAngle = None,
    clock: Clock = None,
) -> None:
    """The options of a profile."""


def takes_settings(command: Callable[..., None]) -> Callable[..., None]:
    """Give `command`, whose first parameter is the `Choice`, the options of logs and of settings after its own."""
    return _taking(command, _parameters(_profile), _parameters(_settings))


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
        command(Choice(chosen, meaning.pop("profile"), meaning), **values)

    every = [*own, *profile, *settings]
    with_options.__signature__ = inspect.Signature(every)  # type: ignore[attr-defined]  # typer reads it
    with_options.__annotations__ = {parameter.name: parameter.annotation for parameter in every}
    return with_options


@cache
def _parameters(function: Callable[..., None]) -> tuple[inspect.Parameter, ...]:
    found = inspect.signature(function, eval_str=True).parameters.values()
    return tuple(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY) for parameter in found)


def _delay(text: str) -> float | Literal["estimate"]:
    from algid.errors import SettingError

    if text == "estimate":
        return "estimate"
    try:
        return float(text)
    except ValueError:
        raise SettingError(f"--delay: expected seconds or 'estimate', found {text!r}") from None


def _poles(text: str) -> tuple[complex, ...]:
    """Six poles out of text; complex ones like -80+20j."""
    from algid.errors import SettingError
    from algid.signals.observers import observer_gain

    like = "give six like -80,-390,-391,-392,-393,-394"
    try:
        poles = tuple(complex(part.strip()) for part in text.split(","))
    except ValueError:
        raise SettingError(f"--poles {text}: expected numbers between commas; {like}") from None
    try:
        observer_gain(poles)
    except ValueError as error:
        raise SettingError(f"--poles {text}: {error}; {like}") from None
    return tuple(pole.real if pole.imag == 0 else pole for pole in poles)
