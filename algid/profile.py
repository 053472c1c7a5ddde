"""Profiles: what a log's names, units and signs mean, in a file `algid.toml` beside the logs.

Everything is optional; what a profile leaves out is taken from the log. A key that is not known is
refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PrivateAttr, ValidationError

from algid.base.errors import SettingError
from algid.base.files import misfit, read_toml
from algid.base.limits import PHYSICAL, PRIOR_ERROR, within
from algid.base.units import names_of, unit_of
from algid.options import Option, flag


def _usual(unit: object) -> object:
    """A unit in algid's writing: ``Nm`` means ``N m``."""
    return (unit_of(unit) or unit) if isinstance(unit, str) else unit


def _unit(*quantities: str) -> Any:
    """One of the units of these quantities, by any of its names."""
    return Annotated[Literal[names_of(*quantities)], BeforeValidator(_usual)]


if TYPE_CHECKING:  # a type checker cannot read a registry
    AngleUnit = str
    VelocityUnit = str
    TorqueUnit = str
    TimeUnit = str
    Pair = tuple[str, str]
else:
    AngleUnit = _unit("angle")
    VelocityUnit = _unit("velocity")
    TorqueUnit = _unit("torque", "current")
    TimeUnit = _unit("time")
    Name = Annotated[str, Field(min_length=1)]
    Pair = Annotated[tuple[Name, ...], Field(min_length=2, max_length=2)]
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
OF_ONE_LOG = ("torque_file", "segment", "start", "end")
"""Settings that no other log shares."""


def parts_of(given: Any) -> Any:
    """The parts of ``one,two``, or what comes in parts already."""
    return [part.strip() for part in given.split(",")] if isinstance(given, str) else given


def _plain(path: object) -> object:
    """A path as text."""
    if isinstance(path, Path):
        return str(path)
    return path


PathText = Annotated[str | None, Field(min_length=1), BeforeValidator(_plain), Option(kind=Path)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Channel(_Strict):
    """The source of one channel: a column, or a topic and a field's path in its messages.

    `gear_ratio` is how often the encoder, or the motor, turns while the joint turns once: 1 for one
    at the joint.
    """

    topic: str | None = None
    source: str | None = None
    sign: Literal[1, -1] = 1
    offset: float = 0.0
    gear_ratio: float = Field(default=1.0, gt=0)

    @property
    def column(self) -> str | None:
        """The column or field that it is read from, where the user names it; a desired angle's."""
        return getattr(self, "q_des", None) or self.source


class Angle(Channel):
    """An angle: `offset` in rad is added after unit and sign.

    `counts` are encoder counts in one turn.
    """

    unit: AngleUnit | None = None
    counts: float | None = Field(default=None, gt=0)
    unwrap: bool = False


class Velocity(Channel):
    """A velocity: its unit a second (rpm: turns a minute)."""

    unit: VelocityUnit | None = None
    counts: float | None = Field(default=None, gt=0)


class Torque(Channel):
    """A torque: `offset` in N m. Amperes need `torque_constant` in N m/A at the motor.

    Where none is logged, a PD law makes it: `kp` in N m/rad and `kd` in N m s/rad of the desired
    angle in the column `q_des`, recorded as the angle is.
    """

    unit: TorqueUnit | None = None
    torque_constant: float | None = Field(default=None, gt=0)
    kp: float | None = Field(default=None, gt=0)
    kd: float | None = Field(default=None, ge=0)
    q_des: str | None = None


class Profile(_Strict):
    """What a log's names, units and signs mean: each entry of it that is set beats the log.

    Angles become θ1 from the horizontal, θ2 from link 1. Of each channel, ``theta1`` to ``q_des2``,
    a dict holds its `source`, `unit`, `sign`, `offset`, `gear_ratio` and what else its kind has.
    The reference that a controller follows, q_des, is recorded as its angle is, where nothing else
    is said.

    Parameters
    ----------
    topic : str
        Topic with the joint states.
    angle_unit : str
    torque_unit : str
        N m, mN m, A, mA, lbf in, ….
    joints : two str
        The two joints, as NAME,NAME.
    clock : str
        Stamps of the messages' own header, or of the log (the recorder).
    time : str
        The column of the time.
    time_unit : str
        Its unit: s, ms, us or ns.
    rate : float, Hz
        Samples a second, Hz, of a table without time.
    columns : str
        Names of the columns of a CSV without a header, as t,theta1,….
    zero : str
        Where θ1 is zero: horizontal, hanging or upright.
    second_angle : str
        θ2 is relative (to link 1) or absolute.
    drive : str
        Where the second motor stands: in its joint, or at the base, where a belt or a parallelogram
        takes its torque to θ1 + θ2; torques become τ1 + τ2 and τ2.
    passive : 1 or 2
        The joint without a motor, 1 or 2: its torque is zero, whatever the log says.
    gravity : float, m/s²
        m/s².
    effort : str
        What the driver logs as torque.
    velocity : str
        Joint velocities: observer (a log's are not read), or measured.
    signs : two of 1 and -1
        Of the joints.
    offsets : two float, rad
        Of the joints, rad.
    start : float, s
        Leave out what is before, s from the first sample.
    end : float, s
        Leave out what is after, s from the first sample.
    torque_file : path
        File with the torques, joined on the stamps.
    prior : path
        URDF file or result that says what k1 … k5 are.
    prior_error : float
        Per cent that it errs by.
    segment : int
        One run alone, 1 for the first, where the log's clock starts again.
    accept : codes
        Checks that warn but do not refuse: CODE,CODE.
    theta1, theta2 : dict
        Of that angle its source, unit, sign, ….
    tau1, tau2 : dict
        Of that torque its source, unit, sign, ….
    omega1, omega2 : dict
        Of that velocity its source, unit, sign, ….
    q_des1, q_des2 : dict
        Of that joint's reference its source, unit, sign, ….

    Raises
    ------
    pydantic.ValidationError
        If a setting or its value is not known.
    """

    topic: str | None = None
    angle_unit: AngleUnit | None = None
    torque_unit: TorqueUnit | None = None
    joints: Annotated[Pair | None, BeforeValidator(parts_of)] = None
    clock: Literal["header", "log"] | None = None
    time: str | None = None
    time_unit: TimeUnit | None = None
    rate: float | None = within(PHYSICAL.rate, None)
    columns: Annotated[tuple[str, ...] | None, BeforeValidator(parts_of)] = None
    zero: Literal["horizontal", "hanging", "upright"] = "horizontal"
    second_angle: Literal["relative", "absolute"] = "relative"
    drive: Literal["joint", "base"] = "joint"
    passive: Literal[1, 2] | None = None
    gravity: float = within(PHYSICAL.gravity, 9.81)
    effort: Effort | None = None
    velocity: Literal["observer", "measured"] | None = None
    signs: tuple[Literal[1, -1], Literal[1, -1]] = (1, 1)
    offsets: tuple[float, float] = (0.0, 0.0)
    start: float | None = Field(default=None, ge=0)
    end: float | None = Field(default=None, gt=0)
    torque_file: PathText = None
    prior: PathText = None
    prior_error: float | None = within(PRIOR_ERROR, None)
    segment: int | None = Field(default=None, ge=1)
    accept: Annotated[tuple[Check, ...], BeforeValidator(parts_of)] = ()
    theta1: Angle = Angle()
    theta2: Angle = Angle()
    tau1: Torque = Torque()
    tau2: Torque = Torque()
    omega1: Velocity = Velocity()
    omega2: Velocity = Velocity()
    q_des1: Angle = Angle()
    q_des2: Angle = Angle()

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
        """The same for a file that holds only these quantities, as ``"tau"``."""
        half = self.model_copy()
        half._channels = tuple(name for name in ALL_CHANNELS if name[:-1] in quantities)
        return half

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


def with_settings(profile: Profile, settings: Mapping[str, Any]) -> Profile:
    """The profile with settings over it, channel by channel; ``tau1.sign`` is a name too.

    Raises
    ------
    SettingError
        If a setting or its value is not known.
    """
    merged = profile.model_dump(exclude_unset=True)
    for given, value in settings.items():
        name, dot, key = given.partition(".")
        if dot:
            value = {key: value}
        if isinstance(value, Mapping):  # settings of one channel
            value = merged.get(name, {}) | dict(value)
        for channel in CHANNELS_OF.get(name, ()):
            merged.get(channel, {}).pop("unit", None)
        merged[name] = value
    try:
        return Profile.model_validate(merged)
    except ValidationError as error:
        place, why = misfit(error)
        name = place.partition(".")[0]
        raise SettingError(f"{flag(place if name in ALL_CHANNELS else name)}: {why}") from error


def lasting(stated: Mapping[str, Any]) -> dict[str, Any]:
    """What was stated of a result's logs and holds of later ones, by name."""
    return {name: one for name, one in stated.items() if name not in OF_ONE_LOG}


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
    own = {} if profile is None else profile.model_dump(exclude_unset=True)
    return with_settings(with_settings(Profile(), earlier), own)


def load_profile(path: Path) -> Profile:
    """Read `algid.toml`.

    Raises
    ------
    SettingError
        If the file is missing, is not TOML, or holds a key or a value that is not known.
    """
    return read_toml(path, Profile)
