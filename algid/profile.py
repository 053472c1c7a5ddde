"""Profiles: what a log's names, units and signs mean, in a file `algid.toml` beside the logs.

Everything is optional; what a profile leaves out is taken from the log. A key that is not known is
refused.
"""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PrivateAttr, ValidationError

from algid.base.errors import SettingError
from algid.base.files import misfit, read_toml
from algid.base.limits import PHYSICAL, PRIOR_ERROR
from algid.base.units import names_of, unit_of
from algid.options import EVERYDAY, Option, flag


def _usual(unit: object) -> object:
    """A unit in algid's writing: ``Nm`` means ``N m``."""
    return (unit_of(unit) or unit) if isinstance(unit, str) else unit


if TYPE_CHECKING:  # a type checker cannot read a registry
    AngleUnit: TypeAlias = str
    VelocityUnit: TypeAlias = str
    TorqueUnit: TypeAlias = str
    TimeUnit: TypeAlias = str
else:
    AngleUnit = Annotated[Literal[names_of("angle")], BeforeValidator(_usual)]
    VelocityUnit = Annotated[Literal[names_of("velocity")], BeforeValidator(_usual)]
    TorqueUnit = Annotated[Literal[names_of("torque", "current")], BeforeValidator(_usual)]
    TimeUnit = Annotated[Literal[names_of("time")], BeforeValidator(_usual)]
Effort = Literal[
    "raw", "gravity-compensated", "friction-compensated", "external", "command", "current"
]
"""As `algid.physics.effort.Effort`, of which a profile knows the words alone."""
Check = Literal[
    "EFFORT_ZERO",
    "WRAPPED_ANGLE",
    "DEGREES",
    "LOST_SAMPLES",
    "WRONG_CONVENTION",
    "NOT_FINITE",
    "CLIPPED_TORQUE",
    "OTHER_JOINTS",
    "WRONG_ZERO",
    "BROKEN_BOUND",
]
"""Checks of a log that refuse it, its result or some samples, unless they are accepted."""


ALL_CHANNELS = (
    "theta1", "theta2", "tau1", "tau2", "omega1", "omega2", "q_des1", "q_des2",
)  # fmt: skip


CHANNELS_OF: Mapping[str, tuple[str, ...]] = {
    "angle_unit": ("theta1", "theta2", "omega1", "omega2"),
    "torque_unit": ("tau1", "tau2"),
}
"""Settings that are the unit of each of several channels."""
NO_BOUNDS = (None, None)
OF_ONE_LOG = ("torque_file", "segment")
"""Settings that no other log shares."""


def field(
    default: Any, text: str, panel: str = "", bounds: tuple[float | None, float | None] = NO_BOUNDS
) -> Any:
    """A field with its help, its panel and its least and largest value."""
    low, high = bounds
    return Field(default, ge=low, le=high, description=text, json_schema_extra={"panel": panel})


def _parts(text: object) -> object:
    """The parts of ``one,two``."""
    if not isinstance(text, str):
        return text
    return [part.strip() for part in text.split(",")]


def _two_names(given: object) -> object:
    """Two names, out of ``NAME,NAME`` too."""
    parts = _parts(given)
    pair = isinstance(parts, list | tuple) and len(parts) == 2 and all(parts)
    if given is not None and not pair:
        raise ValueError("expected two names like shoulder,elbow")
    return parts


def _plain(path: object) -> object:
    """A path as text."""
    if isinstance(path, Path):
        return str(path)
    return path


def _number(text: object) -> object:
    """The number that a flag's text is."""
    if isinstance(text, str) and text.isdecimal():
        return int(text)
    return text


PathText = Annotated[str | None, Field(min_length=1), BeforeValidator(_plain), Option(kind=Path)]
Model = TypeVar("Model", bound=BaseModel)


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Channel(_Strict):
    """The source of one channel: a column, or a topic and a field's path in its messages."""

    topic: str | None = None
    source: str | None = None
    sign: Literal[1, -1] = 1
    offset: float = 0.0

    @property
    def column(self) -> str | None:
        """The column or field that it is read from, where the user names it."""
        return self.source


class Angle(Channel):
    """An angle: `offset` in rad is added after unit and sign.

    `counts` are encoder counts in one turn.

    `gear_ratio` is how often the encoder turns while the joint turns once: 1 for one at the joint.
    """

    unit: AngleUnit | None = None
    counts: float | None = Field(default=None, gt=0)
    gear_ratio: float = Field(default=1.0, gt=0)
    unwrap: bool = False


class Velocity(Channel):
    """A velocity: its unit a second (rpm: turns a minute), `gear_ratio` as of an angle."""

    unit: VelocityUnit | None = None
    counts: float | None = Field(default=None, gt=0)
    gear_ratio: float = Field(default=1.0, gt=0)


class Torque(Channel):
    """A torque: `offset` in N m. Amperes need `torque_constant` in N m/A at the motor.

    `gear_ratio` is how often the motor turns while the joint turns once: 1 for a torque at the
    joint. Where none is logged, a PD law makes it: `kp` in N m/rad and `kd` in N m s/rad of the
    desired angle in the column `q_des`, recorded as the angle is.
    """

    unit: TorqueUnit | None = None
    torque_constant: float | None = Field(default=None, gt=0)
    gear_ratio: float = Field(default=1.0, gt=0)
    kp: float | None = Field(default=None, gt=0)
    kd: float | None = Field(default=None, ge=0)
    q_des: str | None = None

    @property
    def column(self) -> str | None:
        """The column that it is read from: a torque, or a desired angle."""
        return self.q_des or self.source


def documented(model: type[Model]) -> type[Model]:
    """The model, whose docstring tells of each field what its description says."""
    told = ["Parameters", "----------"]
    for name, one in model.model_fields.items():
        told += [name, f"    {one.description}"]
    head, raises, rest = inspect.cleandoc(model.__doc__ or "").partition("Raises\n")
    model.__doc__ = "\n".join((head + told[0], *told[1:], "", raises + rest))
    return model


@documented
class Profile(_Strict):
    """What a log's names, units and signs mean: each field's description says what it is.

    Angles become θ1 from the horizontal, θ2 from link 1. Of each channel, ``theta1`` to ``q_des2``,
    a dict holds its `source`, `unit`, `sign`, `offset`, `gear_ratio` and what else its kind has.
    The reference that a controller follows, q_des, is recorded as its angle is, where nothing else
    is said.

    Raises
    ------
    pydantic.ValidationError
        If a setting or its value is not known.
    """

    topic: str | None = field(None, "Topic with the joint states.")
    angle_unit: AngleUnit | None = field(None, f"{', '.join(names_of('angle'))}.", EVERYDAY)
    torque_unit: TorqueUnit | None = field(None, "N m, mN m, A, mA, lbf in, ….", EVERYDAY)
    joints: Annotated[tuple[str, str] | None, BeforeValidator(_two_names)] = field(
        None, "The two joints, as NAME,NAME.", EVERYDAY
    )
    clock: Literal["header", "log"] | None = field(
        None, "Stamps of the messages' own header, or of the log (the recorder)."
    )
    time: str | None = field(None, "The column of the time.")
    time_unit: TimeUnit | None = field(None, "Its unit: s, ms, us or ns.")
    rate: float | None = field(
        None, "Samples a second, Hz, of a table without time.", bounds=PHYSICAL.rate
    )
    columns: Annotated[tuple[str, ...] | None, BeforeValidator(_parts)] = field(
        None, "Names of the columns of a CSV without a header, as t,theta1,…."
    )
    zero: Literal["horizontal", "hanging", "upright"] = field(
        "horizontal", "Where θ1 is zero: horizontal, hanging or upright.", EVERYDAY
    )
    second_angle: Literal["relative", "absolute"] = field(
        "relative", "θ2 is relative (to link 1) or absolute."
    )
    drive: Literal["joint", "base"] = field(
        "joint",
        "Where the second motor stands: in its joint, or at the base, where a belt or a "
        "parallelogram takes its torque to θ1 + θ2; torques become τ1 + τ2 and τ2.",
    )
    passive: Annotated[Literal[1, 2] | None, BeforeValidator(_number)] = field(
        None, "The joint without a motor, 1 or 2: its torque is zero, whatever the log says."
    )
    gravity: float = field(9.81, "m/s².", bounds=(0, None))
    effort: Effort | None = field(None, "What the driver logs as torque.")
    velocity: bool = field(True, "Whether recorded velocities are read.")
    signs: tuple[Literal[1, -1], Literal[1, -1]] = field((1, 1), "Of the joints.")
    offsets: tuple[float, float] = field((0.0, 0.0), "Of the joints, rad.")
    start: float | None = field(
        None, "Leave out what is before, s from the first sample.", bounds=(0, None)
    )
    end: Annotated[float | None, Field(gt=0)] = field(
        None, "Leave out what is after, s from the first sample."
    )
    torque_file: PathText = field(None, "File with the torques, joined on the stamps.")
    prior: PathText = field(None, "URDF file or result that says what k1 … k5 are.")
    prior_error: float | None = field(None, "Per cent that it errs by.", bounds=PRIOR_ERROR)
    segment: Annotated[int | None, BeforeValidator(_number)] = field(
        None,
        "One run alone, 1 for the first, where the log's clock starts again.",
        bounds=(1, None),
    )
    accept: Annotated[tuple[Check, ...], BeforeValidator(_parts)] = field(
        (), "Checks that warn but do not refuse: CODE,CODE."
    )
    theta1: Angle = field(Angle(), "θ1: its source, unit, sign, ….")
    theta2: Angle = field(Angle(), "θ2: its source, unit, sign, ….")
    tau1: Torque = field(Torque(), "τ1: its source, unit, sign, ….")
    tau2: Torque = field(Torque(), "τ2: its source, unit, sign, ….")
    omega1: Velocity = field(Velocity(), "ω1: its source, unit, sign, ….")
    omega2: Velocity = field(Velocity(), "ω2: its source, unit, sign, ….")
    q_des1: Angle = field(Angle(), "The reference of θ1: its source, unit, sign, ….")
    q_des2: Angle = field(Angle(), "The reference of θ2: its source, unit, sign, ….")

    _flags: frozenset[str] = PrivateAttr(frozenset())
    _channels: tuple[str, ...] = PrivateAttr(ALL_CHANNELS)

    @property
    def channels(self) -> tuple[str, ...]:
        """The canonical channels that are read from the one file: all, or those of its half."""
        return self._channels

    @property
    def needed(self) -> tuple[str, ...]:
        """Those of them without which there is no log."""
        return tuple(name for name in self._channels if name.startswith(("theta", "tau")))

    def half(self, *quantities: str) -> Profile:
        """The same for a file that holds only these quantities, as ``"tau"``, and is read whole."""
        half = self.model_copy(update=dict.fromkeys(("torque_file", "start", "end", "segment")))
        half._channels = tuple(name for name in ALL_CHANNELS if name[:-1] in quantities)
        return half

    def told_by(self, setting: str) -> Literal["flag", "profile"]:
        """Who set `setting`, such as ``joints`` or ``tau1.unit``: a flag beats the file."""
        if setting in self._flags:
            return "flag"
        return "profile"

    def place(self, name: str) -> tuple[str | None, str | None]:
        """Topic and field of the canonical channel `name`.

        A source may be both, ``/joint_states: effort[elbow]``.
        """
        channel = self.channel(name)
        topic, colon, field = (channel.column or "").partition(": ")
        if colon and topic.startswith("/"):
            return topic, field
        return channel.topic or self.topic, channel.column

    def channel(self, name: str) -> Angle | Velocity | Torque:
        """The profile of the canonical channel `name`, its unit that of all such channels."""
        channel: Angle | Velocity | Torque = getattr(self, name)
        for several, channels in CHANNELS_OF.items():
            unit = getattr(self, several)
            if name in channels and channel.unit is None and unit is not None:
                return channel.model_copy(update={"unit": unit})
        return channel


def with_settings(profile: Profile, settings: Mapping[str, Any], *, typed: bool = False) -> Profile:
    """The profile with settings over it, channel by channel.

    Raises
    ------
    SettingError
        If a setting or its value is not known; it names the flag where settings are `typed`.
    """
    merged = profile.model_dump(exclude_unset=True)
    flags = set(profile._flags)
    for name, value in settings.items():
        if isinstance(value, Mapping):  # settings of one channel
            merged[name] = merged.get(name, {}) | dict(value)
            flags |= {f"{name}.{inner}" for inner in value}
            continue
        for channel in CHANNELS_OF.get(name, ()):
            merged.get(channel, {}).pop("unit", None)
            flags.add(f"{channel}.unit")
        merged[name] = value
        flags.add(name)
    try:
        changed = Profile.model_validate(merged)
    except ValidationError as error:
        place, why = misfit(error)
        name, where = place.partition(".")[0], f"setting {place}"
        if typed:
            behind_set = isinstance(settings.get(name), Mapping) or name == "velocity"
            typed_as = flag("set" if behind_set else name).partition(" ")[0]
            where = f"{typed_as} (profile: {place})"
        raise SettingError(f"{where}: {why}") from error
    changed._flags = frozenset(flags)
    return changed


def over(profile: Profile | None, earlier: Mapping[str, Any]) -> Profile | None:
    """The profile of an earlier result, as that holds it, with what `profile` sets over it.

    None where neither is.

    Raises
    ------
    SettingError
        If the earlier one cannot be used.
    """
    if not earlier:
        return profile
    known = with_settings(Profile(), earlier)
    known._flags = frozenset()
    if profile is None:
        return known
    together = with_settings(known, profile.model_dump(exclude_unset=True))
    together._flags = profile._flags
    return together


def load_profile(path: Path) -> Profile:
    """Read `algid.toml`.

    Raises
    ------
    SettingError
        If the file is missing, is not TOML, or holds a key or a value that is not known.
    """
    return read_toml(path, Profile)
