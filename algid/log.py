"""A recorded log in SI units, and where it came from.

=========  ==============================  ========  =======
name       meaning                         shape     unit
=========  ==============================  ========  =======
stamp_ns   time stamps                     (N,)      ns, int64
theta      joint angles θ1, θ2             (2, N)    rad
tau        joint torques τ1, τ2            (2, N)    N m
omega      joint velocities, if recorded   (2, N)    rad/s
reference  angles asked of the controller  (2, N)    rad
=========  ==============================  ========  =======

Time runs along the last axis, here and everywhere in algid.

What travels with a synthetic log: the true arm and payload, and sums that betray changed values.

Written as one JSON object named "algid": an MCAP metadata record, a Parquet key, or a file
``LOG.truth.json`` beside a CSV log.
"""

from __future__ import annotations

import itertools
import json
import math
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from algid.arm import Arm, FloatArray
from algid.base.errors import LogError
from algid.base.quantiles import median
from algid.notices import Notice

IntArray = NDArray[np.int64]

CANONICAL_COLUMNS = ("t", "theta1", "theta2", "tau1", "tau2")
ARRAYS = "arrays"
"""The format of a log that is made of arrays."""
SIGNALS = ("theta", "tau", "omega", "reference")
"""Fields of a log (2, N)."""


@dataclass(frozen=True)
class Truth:
    """The arm and the payload (kg) behind a synthetic log, and the case they are taken from.

    `schedule` holds pairs of time in s and payload from then on, where the payload changes during
    the log.
    """

    arm: Arm
    payload: float
    case: str | None = None
    schedule: tuple[tuple[float, float], ...] = ()


ZEROS = {"horizontal": 0.0, "hanging": -math.pi / 2, "upright": math.pi / 2}
"""rad: where θ1 is zero, as the angle from the horizontal."""
SLOWEST = 0.2
"""s: a longer median step is no recording of an arm in motion, which has 5 Hz at least."""
_LARGEST, _LONGEST = 1e30, 9.2e9
"""What no signal, and no time in s, reaches: a mark for a missing value, ticks for seconds."""
STRICT = {"extra": "forbid"}
"""For pydantic, which reads readings from results: a field of another name is refused."""
Teller = Literal["flag", "profile", "names", "order"]


@dataclass(frozen=True)
class ChannelReading:
    """How one channel was read: algid's value is `factor` times the recorded one, plus `offset`.

    `unit` is that of the recorded values, and `told` its source: a flag or a profile, the channel's
    own name, or none ("assumed"). `offset` is in rad, N m or rad/s.
    """

    __pydantic_config__: ClassVar = STRICT

    source: str
    unit: str
    told: Literal["flag", "profile", "names", "assumed"] = "assumed"
    factor: float = 1.0
    offset: float = 0.0

    @property
    def sign(self) -> int:
        """Whether the recorded values count the other way round (-1)."""
        if self.factor < 0:
            return -1
        return 1


@dataclass(frozen=True)
class Reading:
    """What a reader decided, or was given, about a log: how to read it the same way again.

    Parameters
    ----------
    channels : by canonical name how each channel was read
    joints : names of joint 1 and joint 2 in the log, where it has names
    joints_told : 'flag', 'profile', 'names' or 'order'
        Who said which joint is the first: the user, the joints' own names, or only their order in
        the log.
    topics : topics that were read, the one that sets the time first
    clock : 'header', 'log' (the recorder's times) or 'column'
        'header' stands for the messages' own stamps, unless they turn out to stand still.
    time_unit : unit of the times, None where it is known from the values only
    zero, second_angle, drive, passive, signs, offsets : as in a profile
        Signs and offsets are in those of the channels too.
    unwrap : whether each joint's jumps by a turn were made continuous
    start, end : float, s
        Where the log was cut, in time since its first sample.
    torque_file : the file that the torques are from, where it is another
    segment : the run that was read alone, of a log whose clock starts again
    accepted : codes of the checks that may not refuse the log
    """

    __pydantic_config__: ClassVar = STRICT

    channels: Mapping[str, ChannelReading] = field(default_factory=dict)
    joints: tuple[str, str] | None = None
    joints_told: Teller | None = None
    topics: tuple[str, ...] = ()
    clock: str | None = None
    time_unit: str | None = None
    zero: str = "horizontal"
    second_angle: str = "relative"
    drive: str = "joint"
    passive: int | None = None
    signs: tuple[int, int] = (1, 1)
    offsets: tuple[float, float] = (0.0, 0.0)
    unwrap: tuple[bool, bool] = (False, False)
    start: float | None = None
    end: float | None = None
    torque_file: str | None = None
    segment: int | None = None
    accepted: tuple[str, ...] = ()

    def stated_unit(self, name: str) -> str | None:
        """The unit of angles or velocities `name`, where nobody guessed it.

        Arrays have that of a `Log`.
        """
        if name not in self.channels:
            return "rad" if name.startswith("theta") else "rad/s"
        channel = self.channels[name]
        return channel.unit if channel.told in ("flag", "profile") else None

    def differences(self, other: Reading) -> Iterator[str]:
        """What decides the estimates and is read otherwise here than in `other`, in clauses."""
        mine, others = self._decisive(), other._decisive()
        for name in mine.keys() & others.keys():
            if mine[name] != others[name]:
                yield f"{name} {mine[name]} instead of {others[name]}"

    def _decisive(self) -> dict[str, str]:
        """What decides the estimates, by name, in words."""
        found = {"zero": self.zero, "second_angle": self.second_angle, "drive": self.drive}
        found["passive"] = f"{self.passive or 'none'}"
        if self.joints is not None:
            found["joints"] = ",".join(self.joints)
        for name, one in self.channels.items():
            # offsets written in different units differ by rounding
            offset = f"{round(one.offset, 9) + 0.0:.6g}"
            found |= {f"{name}.unit": one.unit, f"{name}.sign": f"{one.sign}"}
            # by the unit, which has a factor of its own
            found |= {f"{name}.offset": offset, f"{name} per {one.unit}": f"{abs(one.factor):.6g}"}
        return found


@dataclass(frozen=True)
class Origin:
    """A log's origin: its file, format, each channel's source, and a synthetic log's truth."""

    path: str
    format: str
    mapping: dict[str, str]
    truth: Truth | None = None
    reading: Reading = Reading()


@dataclass(frozen=True, eq=False)
class Log:
    """Samples of one log, or of a stretch of it.

    Parameters
    ----------
    stamp_ns : (N,) int64, ns, strictly increasing
    theta : (2, N) float64, rad
        Joint angles: θ1 from the horizontal, θ2 from link 1.
    tau : (2, N) float64, N m
        Joint torques.
    origin : Origin
        Where the samples came from, and how they were read.
    omega : (2, N) float64, rad/s
        Joint velocities; None where they were not recorded.
    notices : tuple of Notice
        What a reader saw that its user should know.
    reference : (2, N) float64, rad
        Angles that a controller was to follow, as `theta`; None where they were not recorded, NaN
        where there were none.

    Raises
    ------
    ValueError
        If a channel has another shape.
    """

    stamp_ns: IntArray
    theta: FloatArray
    tau: FloatArray
    origin: Origin
    omega: FloatArray | None = None
    notices: tuple[Notice, ...] = ()
    reference: FloatArray | None = None

    def __post_init__(self) -> None:
        rows = self.stamp_ns.size
        for name in SIGNALS:
            channel = getattr(self, name)
            if channel is not None and channel.shape != (2, rows):
                raise ValueError(f"{name} must have shape (2, {rows}), got {channel.shape}")

    def __repr__(self) -> str:
        """Where it came from, how many samples it has, and how long it is, without its numbers."""
        seconds = 0.0
        if len(self):
            seconds = self.duration
        return f"Log({self.origin.path!r}, N = {len(self):,}, {seconds:g} s)"

    @classmethod
    def from_arrays(
        cls,
        t: ArrayLike,
        theta: ArrayLike,
        tau: ArrayLike,
        omega: ArrayLike | None = None,
        reference: ArrayLike | None = None,
        *,
        name: str = "log",
    ) -> Log:
        """A log of samples in memory.

        Parameters
        ----------
        t : (N,), s
            Strictly increasing.
        theta : (2, N) or (N, 2), rad
            Joint angles: θ1 from the horizontal, θ2 from link 1.
        tau : like `theta`, N m
        omega : like `theta`, rad/s
            Velocities, where they were recorded.
        reference : like `theta`, rad
            Angles that a controller was to follow, where they were recorded.
        name : what the result calls it

        Raises
        ------
        LogError
            If a shape does not fit, values are no plain numbers or not finite, or the times do not
            increase.

        Examples
        --------
        >>> import algid
        >>> t = [0.0, 0.01, 0.02]
        >>> len(algid.Log.from_arrays(t, theta=[t, t], tau=[t, t]))
        3
        """
        times = _numbers(name, "t", t)
        if times.ndim != 1 or times.size < 2:
            raise LogError(
                f"{name}: t: expected two samples or more, (N,), found the shape {times.shape}"
            )
        if not (np.all(np.diff(times) > 0) and np.abs(times).max() < _LONGEST):
            raise LogError(
                f"{name}: t: expected finite times in s that increase, below {_LONGEST:g}"
            )
        notices: tuple[Notice, ...] = ()
        step = median(np.diff(times))
        if step > SLOWEST:
            numbers = {"column": "t", "unit": "s", "rate": 1 / step}
            notices = (Notice("OTHER_UNIT", numbers={"case": "slow time"} | numbers),)
        given = {"theta": theta, "tau": tau, "omega": omega, "reference": reference}
        signals: dict[str, Any] = {
            signal: _two_rows(name, signal, values, times.size)
            for signal, values in given.items()
            if values is not None
        }
        stamp_ns = np.round(times * 1e9).astype(np.int64)
        return cls(stamp_ns, origin=Origin(name, ARRAYS, {}), notices=notices, **signals)

    def __len__(self) -> int:
        return self.stamp_ns.size

    @property
    def t(self) -> FloatArray:
        """Time (N,) in s since the first sample."""
        return (self.stamp_ns - self.stamp_ns[0]) * 1e-9

    @property
    def duration(self) -> float:
        """Time from the first to the last sample in s."""
        return float(self.stamp_ns[-1] - self.stamp_ns[0]) * 1e-9

    @cached_property
    def period(self) -> float:
        """Usual time between samples in s: see `usual_period`."""
        return usual_period(self.stamp_ns)

    def part(self, first: int, last: int) -> Log:
        """Samples `first` to `last` - 1 of this log, as views."""
        cut = signals_of(self, lambda signal: signal[:, first:last])
        return replace(self, stamp_ns=self.stamp_ns[first:last], **cut)


def _numbers(log: str, name: str, values: ArrayLike) -> FloatArray:
    """Plain numbers as float64: ticks of a date, a mask or an imaginary part would be lost."""
    unit = " in s" if name == "t" else ""
    try:
        array = np.asanyarray(values)
        if array.dtype.kind not in "iufO" or np.ma.is_masked(array):
            kind = "masked values" if np.ma.is_masked(array) else array.dtype
            raise LogError(f"{log}: {name}: expected plain numbers{unit}, found {kind}")
        return np.asarray(array, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise LogError(f"{log}: {name}: expected numbers of one shape ({error})") from error


def _two_rows(log: str, name: str, values: ArrayLike, count: int) -> FloatArray:
    """A signal of both joints (2, N), given so or as (N, 2)."""
    array = _numbers(log, name, values)
    if array.shape == (count, 2) and count != 2:
        array = array.T
    if array.shape != (2, count) or not np.all(np.abs(array) < _LARGEST):
        raise LogError(
            f"{log}: {name}: expected the shape (2, {count}) or ({count}, 2) and finite numbers "
            f"below {_LARGEST:g} in size, found the shape {array.shape}; leave other samples out"
        )
    return np.ascontiguousarray(array)


def usual_period(stamp_ns: IntArray) -> float:
    """Usual time between samples (N,) in s: the median step, or the mean step of bursts.

    A buffer that is emptied every ten samples leaves nine steps of microseconds for one of ten
    periods: the median step says nothing then. Steps over 64 samples do.
    """
    step = median(np.diff(stamp_ns))
    far = min(64, (stamp_ns.size - 1) // 4)
    if far > 1:
        paces = (stamp_ns[far:] - stamp_ns[:-far]) / far
        pace = median(paces)
        if step < 0.5 * pace:
            return float(np.mean(paces[np.abs(paces - pace) <= 0.2 * pace])) * 1e-9
    return step * 1e-9


def join(blocks: Iterable[Log]) -> Log:
    """One log out of the blocks of a reader, in their order; the notices add up.

    Raises
    ------
    ValueError
        If there is no block.
    """
    parts = list(blocks)
    if not parts:
        raise ValueError("a log needs at least one block, got none")
    if len(parts) == 1:
        return parts[0]
    stamps = np.concatenate([part.stamp_ns for part in parts])
    notices = sum((part.notices for part in parts), ())
    return replace(parts[0], stamp_ns=stamps, notices=notices, **joined(parts))


def joined(parts: Sequence[object]) -> dict[str, Any]:
    """By name each signal of logs, or of stretches of one; None where one of them lacks it."""
    signals = {}
    for name in SIGNALS:
        own = [getattr(part, name) for part in parts]
        lacking = any(signal is None for signal in own)
        signals[name] = None if lacking else np.concatenate(own, axis=1)
    return signals


def signals_of(log: object, change: Callable[[FloatArray], FloatArray]) -> dict[str, Any]:
    """By name each signal that a log, or a stretch of one, has, changed."""
    signals = {}
    for name in SIGNALS:
        signal = getattr(log, name)
        if signal is not None:
            signals[name] = change(signal)
    return signals


KEY = "algid"


@dataclass(frozen=True)
class Companion:
    """The JSON object: truth, and by column name the sum of its 64-bit words modulo 2^64."""

    truth: Truth | None
    sums: Mapping[str, int]

    def dumps(self) -> str:
        """As JSON text; sums as decimal text, since JSON numbers stop at 2^53."""
        content: dict[str, Any] = {"sums": {name: str(value) for name, value in self.sums.items()}}
        if self.truth is not None:
            content |= {
                "arm": asdict(self.truth.arm),
                "payload": self.truth.payload,
                "case": self.truth.case,
            }
            if self.truth.schedule:
                content["schedule"] = [list(change) for change in self.truth.schedule]
        return json.dumps(content | {"crc32": _checksum(content)})


def loads(text: str | bytes) -> Companion:
    """The companion that `Companion.dumps` wrote.

    Raises
    ------
    ValueError
        If the text is not such an object.
    """
    try:
        content = json.loads(text)
        if content.pop("crc32") != _checksum(content):
            raise ValueError("its checksum is wrong")
        sums = {str(name): int(value) for name, value in content["sums"].items()}
        if "arm" not in content:
            return Companion(None, sums)
        numbers = {**content["arm"], "payload": content["payload"]}
        changes = content.get("schedule", ())
        finite = {name: float(value) for name, value in numbers.items()}
        schedule = tuple((float(time), float(mass)) for time, mass in changes)
        if not np.all(np.isfinite([*finite.values(), *itertools.chain(*schedule)])):
            raise ValueError("a number is not finite")
        payload, case = finite.pop("payload"), content["case"]
        return Companion(Truth(Arm(**finite), payload, case and str(case), schedule), sums)
    except (KeyError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise ValueError(f"not the truth of a synthetic log: {error!r}") from error


def _checksum(content: dict[str, Any]) -> int:
    return zlib.crc32(json.dumps(content, sort_keys=True).encode())


def word_sum(values: NDArray[Any]) -> int:
    """Sum of the 64-bit words of `values` (N,), float64 or int64, modulo 2^64."""
    return int(np.ascontiguousarray(values).view(np.uint64).sum(dtype=np.uint64))


def add(one: int, other: int) -> int:
    """Two sums of words as one."""
    return (one + other) % (1 << 64)
