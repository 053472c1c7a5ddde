"""Everything that decides an identification, as one value that travels into its result.

Each field holds its type, default and bounds, the docstring its help: the command line, Python's
keywords and the guide read them off it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError

from algid.base.errors import SettingError
from algid.base.files import misfit
from algid.base.limits import PHYSICAL, PRIOR_ERROR, within
from algid.methods import ESTIMATORS, NAMES, estimator_of
from algid.options import Option, flag
from algid.profile import Effort, PathText, parts_of

if TYPE_CHECKING:
    from algid.signals.differences import TorqueShift

    EstimatorName = str
else:  # a type checker cannot read a registry
    EstimatorName = Literal[NAMES]
OF_BOTH = ("gravity", "effort", "velocity")
"""Settings that a profile has too: there they are of its log's driver and arm."""
OF_PRIOR = ("prior", "prior_error")
"""The same of its arm alone: they do not say how a log is read."""


def _poles(given: Any) -> object:
    """Six poles out of text or numbers, complex ones like -80+20j."""
    if not isinstance(given, Iterable):
        return given
    from algid.signals.observers import observer_gain

    poles, (low, high) = tuple(complex(str(one)) for one in parts_of(given)), PHYSICAL.pole
    if not all(low <= abs(pole) <= high for pole in poles):
        raise ValueError(f"expected each from {low:g} to {high:g} rad/s in size")
    observer_gain(poles)
    return poles


def _terms() -> list[str]:
    from algid.model import CHOICES  # numpy

    return ["auto", "plain", *CHOICES]


class Settings(BaseModel):
    """How to identify.

    Parameters
    ----------
    estimator : str
    velocity : str
        Joint velocities: observer, or measured (the log's).
    observer : str
        luenberger (the paper's) or zero-phase; by default the estimator's.
    poles : six complex, rad/s
        Six poles of the paper's observer, rad/s, three a joint.
    window : float, s
        s: the paper's integrals restart after it (2 s); the weak form's windows (0.4 s).
    bandwidth : float, Hz
        Bandwidth of the zero-phase differentiator, Hz.
    gravity : float, m/s²
        m/s²; 0 for an arm in a horizontal plane [9.81].
    effort : str
        Logged torque: raw, current, external, command, ….
    model : str
        Torque terms: auto, plain, or coulomb,rotor,….
    torque_hold : str
        Torque between samples: auto, foh (linear), zoh.
    delay : float, s
        From torque to angle, s; the term delay estimates it.
    l1 : float, m
        Length of link 1, m, where known.
    l2 : float, m
        Length of link 2, m, where known.
    payload_mass : float, kg
        Known payload, kg: gives the torques' gain.
    prior : path
        URDF file or result that says what k1 … k5 are.
    prior_error : float
        Per cent that a URDF's masses, centres and inertias err by (1 σ); 20.
    constrain : bool
        Solve within the physical bounds.
    cross_validate : bool
        Predict each log from the others.

    Raises
    ------
    SettingError
        If a value is none that its field takes, or the paper's method lacks what is set.
    """

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)

    estimator: EstimatorName = NAMES[0]
    velocity: Literal["observer", "measured"] = "observer"
    observer: Literal["luenberger", "zero-phase"] | None = None
    poles: Annotated[tuple[complex, ...] | None, BeforeValidator(_poles)] = None
    window: float | None = within(PHYSICAL.window, None)
    bandwidth: float = within(PHYSICAL.bandwidth, 60.0)
    gravity: float = within(PHYSICAL.gravity, 9.81)
    effort: Effort | None = None
    model: Annotated[str, Option(suggested=_terms)] = "auto"
    torque_hold: Literal["auto", "foh", "zoh"] = "auto"
    delay: float = within(PHYSICAL.delay, 0.0)
    l1: float | None = within(PHYSICAL.length, None)
    l2: float | None = within(PHYSICAL.length, None)
    payload_mass: float | None = within(PHYSICAL.mass, None)
    prior: PathText = None
    prior_error: float | None = within(PRIOR_ERROR, None)
    constrain: bool = False
    cross_validate: bool = False

    if not TYPE_CHECKING:

        def __init__(self, **given: Any) -> None:
            try:
                super().__init__(**given)
            except ValidationError as error:
                place, why = misfit(error)
                raise SettingError(f"{flag(place.partition('.')[0])}: {why}") from None

    def model_post_init(self, _context: Any, /) -> None:
        """Refuse what no single field shows."""
        if self.effort == "external" and self.gravity != DEFAULTS["gravity"]:
            raise SettingError(
                f"{flag('effort')} external: such a torque has nothing of the arm's weight; leave "
                f"{flag('gravity')} out, or say {flag('effort')} gravity-compensated"
            )
        self._check_terms()
        estimator = estimator_of(self.estimator)
        for name in estimator.lacks:
            value = getattr(self, name)
            # of gravity that is zero: without it there is no payload
            if value == 0 if name == "gravity" else value not in (DEFAULTS[name], "plain"):
                others = [one.name for one in ESTIMATORS if name not in one.lacks]
                raise SettingError(
                    f"{flag(name)} {value}: {estimator.title} cannot take that; use "
                    f"{flag('estimator')} {' or '.join(others[:2])}"
                )

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
        return tuple(dict.fromkeys(parts_of(self.model)))

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
        return {name: length for name in ("l1", "l2") if (length := getattr(self, name))}

    def torque_shift(self, delay: float | None = None) -> TorqueShift:
        """After how long a logged torque acts: its hold, and the `delay` in s, or the one set."""
        from algid.signals.differences import TorqueShift

        return TorqueShift(self.torque_hold == "zoh", self.delay if delay is None else delay)

    def as_json(self) -> dict[str, Any]:
        """For `result.json`; complex poles as text, the paper's where none are set."""
        from algid.signals.observers import PAPER_POLES

        poles = map(complex, self.poles or PAPER_POLES)
        return dict(self) | {"poles": [str(one) if one.imag else one.real for one in poles]}

    def _check_terms(self) -> None:
        if not self.terms:
            return
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
        gone = set(self.terms).difference(without_terms(self.effort, self.terms))
        if gone:
            raise SettingError(
                f"{flag('model')}: torque that is {self.effort} has no {min(gone)}; leave it out, "
                f"or {flag('effort')}"
            )
        if sum(EVERY_TERM[term].timing is not None for term in self.terms) > 1:
            raise SettingError(
                f"{flag('model')}: no log separates a delay from a lag; leave one of them out"
            )


DEFAULTS: Mapping[str, Any] = {name: field.default for name, field in Settings.model_fields.items()}
"""Of each setting."""
