"""Everything that decides an identification, as one value that travels into its result.

What each setting is called, its range and its help stand in `algid.options`, its type and its
default here.
"""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields
from functools import cache
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin, get_type_hints

from algid.errors import SettingError
from algid.limits import PHYSICAL, Range
from algid.methods import ESTIMATORS, NAMES, Estimator, estimator_of
from algid.options import BY_TAKER, PROFILE, SETTINGS, flag, names_taken
from algid.physics.effort import Effort, without_terms
from algid.signals.shift import TorqueShift

if TYPE_CHECKING:  # a type checker cannot read a registry
    EstimatorName = str
else:
    EstimatorName = Literal[NAMES]


EXTERNAL_GRAVITY = (
    f"{flag('effort')} external: such a torque has nothing of the arm's weight; leave "
    f"{flag('gravity')} out, or say {flag('effort')} gravity-compensated"
)


OF_BOTH = names_taken(SETTINGS, PROFILE)
"""Settings that a profile has too: there they are of its log's driver and arm."""


def refuse_contradictions(given: Mapping[str, Any]) -> None:
    """Refuse settings, by name as they were given, that cannot both be meant.

    Raises
    ------
    SettingError
        If gravity is given for a torque that has nothing of the arm's weight.
    """
    if given.get("effort") == "external" and given.get("gravity") is not None:
        raise SettingError(EXTERNAL_GRAVITY)


def _poles(text: str) -> tuple[complex, ...]:
    """Six poles out of text; complex ones like -80+20j."""
    from algid.signals.observers import observer_gain

    like = "give six like -80,-390,-391,-392,-393,-394"
    try:
        poles = tuple(complex(part.strip()) for part in text.split(","))
    except ValueError:
        raise SettingError(
            f"{flag('poles')} {text}: expected numbers between commas; {like}"
        ) from None
    low, high = PHYSICAL.pole
    try:
        if not all(low <= abs(pole) <= high for pole in poles):
            raise ValueError(f"each must be from {low:g} to {high:g} rad/s in size")
        observer_gain(poles)
    except ValueError as error:
        raise SettingError(f"{flag('poles')} {text:.200}: {error}; {like}") from None
    return tuple(_as_real(pole) for pole in poles)


def _as_real(pole: complex) -> complex:
    """A pole as a float if it is real, so that it is written as one."""
    if pole.imag == 0:
        return pole.real
    return pole


@cache
def _kinds() -> dict[str, Any]:
    """The types of the fields, by name."""
    return get_type_hints(Settings)


def _expected(bounds: Range | None, kind: Any, value: object) -> str | None:
    """What a setting has to be, where its value is not that."""
    if bounds is not None:
        low, high = bounds
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if number and low <= value <= high:  # type: ignore[operator]
            return None
        return f"a number from {low:g} to {high:g}"
    for part in (kind,) + get_args(kind):
        if get_origin(part) is Literal:
            words = get_args(part)
            if value in words:
                return None
            return f"one of {', '.join(words)}"
    if kind is bool and not isinstance(value, bool):
        return "true or false"
    if kind is str and not isinstance(value, str):
        return "text"
    return None


PARSERS: Mapping[str, Callable[[str], Any]] = {"poles": _poles}
"""Of the settings that a command line gives as text which no annotation reads."""


@dataclass(frozen=True)
class Settings:
    """How to identify.

    Parameters
    ----------
    estimator : name in `algid.methods.ESTIMATORS`
        'refined' (maximum likelihood, the default), 'weak' (least squares on windows),
        'instruments' (for arms whose unmodelled torque drives the motion) or 'paper'.
    velocity : 'observer' or 'measured'
        Where joint velocities come from. The refined estimator needs none.
    observer : 'luenberger' (eq. 6), 'zero-phase', or None
        None takes the paper's observer for the paper's method and the zero-phase differentiator
        otherwise.
    poles : six complex, rad/s, three a joint, or None
        Of the paper's observer; None takes the paper's.
    window : float, s, or None
        After how long the paper's integrals restart (2 s), or the length of the weak form's
        windows (0.4 s).
    bandwidth : float, Hz, of the zero-phase differentiator
    gravity : float, m/s^2, 0 for an arm that moves in a horizontal plane
    effort : str or None
        What the logged torque is: 'raw', 'gravity-compensated', 'friction-compensated',
        'external', 'command' or 'current'. None is raw, unless the logs show that gravity is
        compensated; with `gravity` 0 a payload's weight is compensated too.
    model : 'auto', 'plain', or terms of the torque between commas
        Names in `algid.model.TERMS`, and delay; 'auto' lets the logs choose.
    torque_hold : 'auto', 'foh' or 'zoh'
        Whether the torque moves evenly from sample to sample or is held from each to the next;
        'auto' lets the logs choose.
    delay : float, s, between torque and angle, where it is known; the term `delay` estimates it
    l1, l2 : float, m, link lengths where known
    payload_mass : float, kg, the payload's where it is known
        Then the gain of the torques follows: what the log's torques have to be multiplied by.
    constrain : bool, solve within the physical bounds
    cross_validate : bool, leave each log out in turn

    Raises
    ------
    SettingError
        If a number has no meaning, or the paper's method lacks what is set.
    """

    estimator: EstimatorName = NAMES[0]
    velocity: Literal["observer", "measured"] = "observer"
    observer: Literal["luenberger", "zero-phase"] | None = None
    poles: tuple[complex, ...] | None = None
    window: float | None = None
    bandwidth: float = 60.0
    gravity: float = 9.81
    effort: Effort | None = None
    model: str = "auto"
    torque_hold: Literal["auto", "foh", "zoh"] = "auto"
    delay: float = 0.0
    l1: float | None = None
    l2: float | None = None
    payload_mass: float | None = None
    constrain: bool = False
    cross_validate: bool = False

    def __post_init__(self) -> None:
        for one in fields(self):
            value = getattr(self, one.name)
            if value is None and one.default is None:
                continue
            expected = _expected(BY_TAKER[SETTINGS, one.name].range, _kinds()[one.name], value)
            if expected:
                raise SettingError(
                    f"{flag(one.name)}: expected {expected}, found {reprlib.repr(value)}"
                )
        if self.effort == "external" and self.gravity != type(self).gravity:
            raise SettingError(EXTERNAL_GRAVITY)
        if self.model not in ("auto", "plain"):
            self._check_terms()
        self._refuse_what_it_lacks(estimator_of(self.estimator))

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> Settings:
        """The settings in a result's `settings`, which hold more than these.

        Defaults where it lacks one.

        Raises
        ------
        SettingError
            As for a new one.
        """
        content = _without_short_forms(content)
        known = {f.name: content[f.name] for f in fields(cls) if f.name in content}
        poles = known.get("poles")
        if poles is not None:
            if not isinstance(poles, list | tuple):
                raise SettingError(
                    f"{flag('poles')}: expected six numbers, found {reprlib.repr(poles)}"
                )
            known["poles"] = _poles(",".join(map(str, poles[:7])))
        return cls(**known)

    @property
    def terms(self) -> tuple[str, ...]:
        """Terms asked for, by name; "delay" where it is to be estimated."""
        if self.model in ("auto", "plain"):
            return ()
        return tuple(dict.fromkeys(name.strip() for name in self.model.split(",")))

    @property
    def chooses(self) -> bool:
        """Whether the logs choose the terms."""
        return self.model == "auto"

    @property
    def luenberger(self) -> bool:
        """Whether velocities come from the paper's observer."""
        return (self.observer or estimator_of(self.estimator).observer) == "luenberger"

    @property
    def lengths(self) -> dict[str, float]:
        """The link lengths that are known, in m."""
        lengths = {}
        if self.l1 is not None:
            lengths["l1"] = self.l1
        if self.l2 is not None:
            lengths["l2"] = self.l2
        return lengths

    def torque_shift(self, delay: float | None = None) -> TorqueShift:
        """After how long a logged torque acts: its hold, and the `delay` in s, or the one set."""
        if delay is None:
            delay = self.delay
        return TorqueShift(self.torque_hold == "zoh", delay)

    def as_json(self) -> dict[str, Any]:
        """For `result.json`; complex poles as text, the paper's where none are set."""
        from algid.signals.observers import PAPER_POLES

        poles: list[float | str] = []
        for pole in self.poles or PAPER_POLES:
            if pole.imag == 0:
                poles.append(float(pole.real))
            else:
                poles.append(str(complex(pole)))
        return asdict(self) | {"poles": poles}

    def _check_terms(self) -> None:
        from algid.model import CHOICES, EVERY_TERM

        for term in self.terms:
            if term not in CHOICES:
                raise SettingError(
                    f"{flag('model')}: expected auto, plain or some of {', '.join(CHOICES)}; found "
                    f"{term!r}"
                )
            needed = EVERY_TERM[term].needs
            if needed is not None and needed not in self.terms:
                raise SettingError(
                    f"{flag('model')}: {term} has no meaning without {needed}; add {needed} to the "
                    "list"
                )
        gone = set(self.terms) - set(without_terms(self.effort, self.terms))
        if gone:
            raise SettingError(
                f"{flag('model')}: torque that is {self.effort} has no {min(gone)}; leave it out, "
                f"or {flag('effort')}"
            )
        if sum(EVERY_TERM[term].timing is not None for term in self.terms) > 1:
            raise SettingError(
                f"{flag('model')}: no log separates a delay from a lag; leave one of them out"
            )

    def _refuse_what_it_lacks(self, estimator: Estimator) -> None:
        default = {f.name: f.default for f in fields(self)}
        for name in estimator.lacks:
            value = getattr(self, name)
            others = [one.name for one in ESTIMATORS if name not in one.lacks]
            use = f"use {flag('estimator')} {' or '.join(others[:2])}"
            if name == "model" and value not in ("auto", "plain"):
                what = f"{flag('model')} {value}: {estimator.title} has no such terms"
            elif name == "gravity" and value == 0:
                what = f"{flag('gravity')} 0: without gravity {estimator.title} has no payload"
            elif name not in ("model", "gravity") and value != default[name]:
                what = f"{flag(name)}: {estimator.title} has no such term"
            else:
                continue
            raise SettingError(f"{what}; {use}")


_SHORT_FORMS = {
    ("friction", "coulomb"): "coulomb",
    ("torque_offset", True): "offset",
    ("rotor_inertia", True): "rotor",
    ("delay", "estimate"): "delay",
}
"""Settings of results before schema 3 that stood for a term of the model."""


def _without_short_forms(content: Mapping[str, Any]) -> dict[str, Any]:
    """The settings of a result, where `model` alone names the terms."""
    short = [term for (name, value), term in _SHORT_FORMS.items() if content.get(name) == value]
    if not short:
        return dict(content)
    model, delay = content.get("model", "auto"), content.get("delay", 0.0)
    terms = []
    if model not in ("auto", "plain"):
        terms = [name.strip() for name in str(model).split(",")]
    if delay == "estimate":
        delay = 0.0
    return dict(content) | {"model": ",".join(dict.fromkeys(terms + short)), "delay": delay}
