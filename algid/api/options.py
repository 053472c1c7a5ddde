"""What a caller says beside the logs: a profile in any form, and single settings by their names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypedDict

from algid.api.signature import refuse_unknown
from algid.base.errors import SettingError
from algid.base.files import parsed_toml
from algid.base.limits import KNOWN_LENGTH, LIMITS
from algid.options import ADVANCED, Option, flag
from algid.profile import (
    CHANNELS_OF,
    KEYWORDS,
    Effort,
    Profile,
    load_profile,
    over,
    with_settings,
)
from algid.settings import OF_BOTH, Settings, refuse_contradictions

if TYPE_CHECKING:
    from algid.identification.open_logs import LogLike
    from algid.results import Result

ProfileLike = Annotated["Profile | str | Path | Mapping[str, Any]", Option(kind=Path)]
"""A profile, the path of its file, or what would stand in that."""
AnyLog = Annotated["LogLike", Option(kind=Path)]
"""A path, a `Log`, a pandas or polars frame, or a dict of arrays."""
Logs = Annotated["LogLike | Iterable[LogLike]", Option(kind=list[Path])]
Loaded = Annotated["LogLike | Iterable[LogLike]", Option(kind=list[Path], flag="--loaded")]
AnyResult = Annotated["Result | str | Path", Option(kind=Path)]
"""A result, or the path of one."""
OUT = "-o"
Folder = Annotated[str | Path, Option(kind=Path, default=Path())]
"""Where a command writes: the working folder by default."""
Place = Annotated[str | Path, Option(kind=Path, flag=OUT)]
Length = Annotated[float, Option(range=KNOWN_LENGTH)]
Force = Annotated[bool, Option(panel=ADVANCED)]
Export = Annotated[bool | Literal["mcap"], Option(kind=str, panel=ADVANCED)]
"""Whether what is shown over time is also written as MCAP."""


def cases() -> list[str]:
    """The cases that algid knows, for completion."""
    return ["case1", "case2"]


class _OfLogs(TypedDict, total=False):
    """What a log means: the fields of `Profile`."""

    topic: str | None
    joints: tuple[str, str] | list[str] | str | None
    clock: Literal["header", "log"] | None
    time: str | None
    time_unit: Literal["s", "ms", "us", "ns"] | None
    rate: float | None
    columns: Iterable[str] | str | None
    angle_unit: str
    torque_unit: str
    zero: Literal["horizontal", "hanging", "upright"]
    second_angle: Literal["relative", "absolute"]
    drive: Literal["joint", "base"]
    passive: Literal[1, 2] | None
    gravity: float
    effort: Effort | None
    signs: tuple[int, int] | list[int]
    offsets: tuple[float, float] | list[float]
    start: float | None
    end: float | None
    torque_file: str | Path | None
    prior: str | Path | None
    prior_error: float | None
    segment: int | None
    accept: Iterable[str] | str
    theta1: Mapping[str, Any]
    theta2: Mapping[str, Any]
    tau1: Mapping[str, Any]
    tau2: Mapping[str, Any]
    omega1: Mapping[str, Any]
    omega2: Mapping[str, Any]
    q_des1: Mapping[str, Any]
    q_des2: Mapping[str, Any]


class LogOptions(_OfLogs, total=False):
    """Keywords of a verb that reads logs."""

    velocity: bool


class Options(_OfLogs, total=False):
    """Keywords of a verb that identifies: the fields of `Settings` beside those of `Profile`."""

    estimator: Literal["refined", "weak", "instruments", "paper"]
    velocity: Literal["observer", "measured"]
    observer: Literal["luenberger", "zero-phase"] | None
    poles: Iterable[complex] | str | None
    window: float | None
    bandwidth: float
    model: str
    torque_hold: Literal["auto", "foh", "zoh"]
    delay: float
    l1: float | None
    l2: float | None
    payload_mass: float | None
    constrain: bool
    cross_validate: bool


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
    refuse_unknown(options, (*Settings.model_fields, *KEYWORDS))
    refuse_contradictions(options)
    of_settings, of_profile = {}, {}
    for name, value in options.items():
        # a profile's velocity is true or false
        if name in Settings.model_fields and not (name == "velocity" and isinstance(value, bool)):
            of_settings[name] = value
        else:
            of_profile[name] = value
    asked = (settings or Settings()).but(**of_settings)
    known = profile_of(profile)
    of_both = {name: of_settings[name] for name in OF_BOTH if name in of_settings}
    # a driver's effort says how its torques are read, gravity alone says nothing of a log
    if known is not None or of_profile or "effort" in of_both:
        of_profile |= of_both
    return asked, _over(known, of_profile)


def meaning(profile: ProfileLike | None, options: Mapping[str, Any]) -> Profile | None:
    """The profile with single settings of it over it; for verbs that have no `Settings`.

    Raises
    ------
    SettingError
        If an option is not known, or a value is wrong.
    """
    refuse_unknown(options, KEYWORDS)
    return _over(profile_of(profile), options)


def profile_of(given: ProfileLike | None) -> Profile | None:
    """The profile that is given in any form.

    Raises
    ------
    SettingError
        If its file cannot be read, or a setting of it is wrong.
    """
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


def setting_of(line: str) -> dict[str, Any]:
    """A setting out of ``NAME=VALUE``, as a line of TOML; a bare word is text.

    Raises
    ------
    SettingError
        If it is none.
    """
    key, _, value = line.partition("=")
    like = "expected KEY=VALUE like tau1.sign=-1"
    if "=" not in line or not key.strip():
        raise SettingError(f"{flag('set')} {line}: {like}")
    try:
        return parsed_toml(f"{key} = {value}")
    except (ValueError, RecursionError) as error:  # a bare word
        if key.count(".") > LIMITS.toml_key_parts:
            raise SettingError(f"{flag('set')} {key[:40]}…: {error}; {like}") from error
        setting: Any = value.strip()
        for part in reversed(key.split(".")):
            setting = {part.strip(): setting}
        return dict(setting)


def _over(profile: Profile | None, options: Mapping[str, Any]) -> Profile | None:
    """The profile with options over it, one after another."""
    for name, value in options.items():
        settings = {name: value}
        if name in CHANNELS_OF:
            settings = {channel: {"unit": value} for channel in CHANNELS_OF[name]}
        elif name == "joints" and value is not None:
            settings = {name: two_names(name, value)}
        typed = "set" if isinstance(value, Mapping) or name == "velocity" else name
        profile = with_settings(profile or Profile(), settings, flag(typed).partition(" ")[0])
    return profile
