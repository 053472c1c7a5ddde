"""Everything that decides an identification, as one value that travels into its result.

Each field holds its type, default, bounds, help and panel: the command line, Python's keywords and
the guide read them off it.
"""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError

from algid.base.errors import SettingError
from algid.base.files import misfit
from algid.base.limits import PHYSICAL, PRIOR_ERROR
from algid.methods import ESTIMATORS, NAMES, Estimator, estimator_of
from algid.options import EVERYDAY, Option, flag
from algid.profile import Effort, PathText, documented, field

if TYPE_CHECKING:  # a type checker cannot read a registry
    from algid.signals.shift import TorqueShift

    EstimatorName = str
else:
    EstimatorName = Literal[NAMES]


OF_BOTH = ("gravity", "effort")
"""Settings that a profile has too: there they are of its log's driver and arm."""
OF_PRIOR = ("prior", "prior_error")
"""The same of its arm alone: they do not say how a log is read."""
EXTERNAL_GRAVITY = (
    f"{flag('effort')} external: such a torque has nothing of the arm's weight; leave "
    f"{flag('gravity')} out, or say {flag('effort')} gravity-compensated"
)


def refuse_contradictions(given: Mapping[str, Any]) -> None:
    """Refuse settings, by name as they were given, that cannot both be meant.

    Raises
    ------
    SettingError
        If gravity is given for a torque that has nothing of the arm's weight.
    """
    if given.get("effort") == "external" and given.get("gravity") is not None:
        raise SettingError(EXTERNAL_GRAVITY)


def _poles(given: object) -> object:
    """Six poles out of text or a list; complex ones like -80+20j."""
    if given is None or (
        isinstance(given, tuple) and all(isinstance(one, complex) for one in given)
    ):
        return given
    from algid.signals.observers import observer_gain

    like = "give six like -80,-390,-391,-392,-393,-394"
    if isinstance(given, list | tuple):
        given = ",".join(map(str, given[:7]))
    if not isinstance(given, str):
        raise SettingError(f"{flag('poles')}: expected six numbers, found {reprlib.repr(given)}")
    try:
        poles = tuple(complex(part.strip()) for part in given.split(","))
    except ValueError:
        raise SettingError(
            f"{flag('poles')} {given:.200}: expected numbers between commas; {like}"
        ) from None
    low, high = PHYSICAL.pole
    try:
        if not all(low <= abs(pole) <= high for pole in poles):
            raise ValueError(f"each must be from {low:g} to {high:g} rad/s in size")
        observer_gain(poles)
    except ValueError as error:
        raise SettingError(f"{flag('poles')} {given:.200}: {error}; {like}") from None
    return poles


def _terms() -> list[str]:
    from algid.model import CHOICES

    return ["auto", "plain", *CHOICES]


@documented
class Settings(BaseModel):
    """How to identify: each field's description says what it is.

    Raises
    ------
    SettingError
        If a value is none that its field takes, or the paper's method lacks what is set.
    """

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)

    estimator: EstimatorName = field(NAMES[0], f"{', '.join(NAMES[:-1])} or {NAMES[-1]}.")
    velocity: Literal["observer", "measured"] = field(
        "observer", "Joint velocities: observer, or measured (the log's)."
    )
    observer: Literal["luenberger", "zero-phase"] | None = field(
        None, "luenberger (eq. 6 of the paper) or zero-phase; by default the estimator's."
    )
    poles: Annotated[tuple[complex, ...] | None, BeforeValidator(_poles)] = field(
        None, "Six poles of the paper's observer, rad/s, three a joint."
    )
    window: float | None = field(
        None,
        "s: the paper's integrals restart after it (2 s); the weak form's windows (0.4 s).",
        bounds=PHYSICAL.window,
    )
    bandwidth: float = field(
        60.0, "Bandwidth of the zero-phase differentiator, Hz.", bounds=PHYSICAL.bandwidth
    )
    gravity: float = field(
        9.81, "m/s²; 0 for an arm in a horizontal plane [9.81].", bounds=PHYSICAL.gravity
    )
    effort: Effort | None = field(None, "Logged torque: raw, current, external, command, ….")
    model: Annotated[str, Option(words=_terms)] = field(
        "auto", "Torque terms: auto, plain, or coulomb,rotor,…."
    )
    torque_hold: Literal["auto", "foh", "zoh"] = field(
        "auto", "Torque between samples: auto, foh (linear), zoh."
    )
    delay: float = field(
        0.0, "From torque to angle, s; the term delay estimates it.", bounds=PHYSICAL.delay
    )
    l1: float | None = field(None, "Length of link 1, m, where known.", bounds=PHYSICAL.length)
    l2: float | None = field(None, "Length of link 2, m, where known.", bounds=PHYSICAL.length)
    payload_mass: float | None = field(
        None, "Known payload, kg: gives the torques' gain.", bounds=PHYSICAL.mass
    )
    prior: PathText = field(None, "URDF file or result that says what k1 … k5 are.")
    prior_error: float | None = field(
        None,
        "Per cent that a URDF's masses, centres and inertias err by (1 σ); 20.",
        bounds=PRIOR_ERROR,
    )
    constrain: bool = field(False, "Solve within the physical bounds.")
    cross_validate: bool = field(False, "Predict each log from the others.", panel=EVERYDAY)

    if not TYPE_CHECKING:

        def __init__(self, **given: Any) -> None:
            try:
                super().__init__(**given)
            except ValidationError as error:
                raise _refusal(error) from None

    def model_post_init(self, _context: Any, /) -> None:
        """Refuse what no single field shows."""
        if self.effort == "external" and self.gravity != DEFAULTS["gravity"]:
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
        return cls(**{name: content[name] for name in cls.model_fields if name in content})

    def but(self, **changes: Any) -> Settings:
        """The same with other values."""
        return Settings(**dict(self) | changes)

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
        from algid.signals.shift import TorqueShift

        if delay is None:
            delay = self.delay
        return TorqueShift(self.torque_hold == "zoh", delay)

    def as_json(self) -> dict[str, Any]:
        """For `result.json`; complex poles as text, the paper's where none are set."""
        from algid.signals.observers import PAPER_POLES

        poles: list[float | str] = []
        for pole in self.poles or PAPER_POLES:
            poles.append(float(pole.real) if pole.imag == 0 else str(complex(pole)))
        return dict(self) | {"poles": poles}

    def _check_terms(self) -> None:
        from algid.model import CHOICES, EVERY_TERM
        from algid.physics.effort import without_terms

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
        for name in estimator.lacks:
            value = getattr(self, name)
            others = [one.name for one in ESTIMATORS if name not in one.lacks]
            use = f"use {flag('estimator')} {' or '.join(others[:2])}"
            if name == "model" and value not in ("auto", "plain"):
                what = f"{flag('model')} {value}: {estimator.title} has no such terms"
            elif name == "gravity" and value == 0:
                what = f"{flag('gravity')} 0: without gravity {estimator.title} has no payload"
            elif name not in ("model", "gravity") and value != DEFAULTS[name]:
                what = f"{flag(name)}: {estimator.title} has no such term"
            else:
                continue
            raise SettingError(f"{what}; {use}")


DEFAULTS: Mapping[str, Any] = {name: field.default for name, field in Settings.model_fields.items()}
"""Of each setting."""


def _refusal(error: ValidationError) -> SettingError:
    """The first misfit in one line: a number's is told with both of its bounds."""
    place, why = misfit(error)
    name = place.partition(".")[0]
    ends: dict[str, float] = {}
    if name in Settings.model_fields:
        for bound in Settings.model_fields[name].metadata:
            ends |= {end: getattr(bound, end) for end in ("ge", "le") if hasattr(bound, end)}
    if len(ends) == 2:
        found = reprlib.repr(error.errors()[0]["input"])
        why = f"expected a number from {ends['ge']:g} to {ends['le']:g}, found {found}"
    return SettingError(f"{flag(name)}: {why}")
