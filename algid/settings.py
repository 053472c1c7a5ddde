"""Everything that decides an identification, as one value that travels into its result."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, fields
from typing import Any, Literal

from algid.errors import SettingError
from algid.signals.observers import PAPER_POLES

Estimator = Literal["refined", "weak", "paper"]


@dataclass(frozen=True)
class Settings:
    """How to identify.

    Parameters
    ----------
    estimator : 'refined' (maximum likelihood, the default), 'weak' (least squares on windows) or 'paper'
    velocity : 'observer' or 'measured'
        Where joint velocities come from. The refined estimator needs none.
    observer : 'luenberger' (eq. 6), 'zero-phase', or None
        None takes the paper's observer for the paper's method and the zero-phase differentiator otherwise.
    poles : six complex, rad/s, three a joint
    window : float, s, or None
        After how long the paper's integrals restart (2 s), or the length of the weak form's windows (0.4 s).
    bandwidth : float, Hz, of the zero-phase differentiator
    gravity : float, m/s^2, 0 for an arm that moves in a horizontal plane
    friction : 'viscous' or 'coulomb' (viscous and Coulomb)
    torque_offset, rotor_inertia : bool, further columns of the model
    torque_hold : 'foh' or 'zoh'
    delay : float, s, between torque and angle, or 'estimate'
    l1, l2 : float, m, link lengths where known
    constrain : bool, solve within the physical bounds
    cross_validate : bool, leave each log out in turn
    """

    estimator: Estimator = "refined"
    velocity: Literal["observer", "measured"] = "observer"
    observer: Literal["luenberger", "zero-phase"] | None = None
    poles: tuple[complex, ...] = PAPER_POLES
    window: float | None = None
    bandwidth: float = 60.0
    gravity: float = 9.81
    friction: Literal["viscous", "coulomb"] = "viscous"
    torque_offset: bool = False
    rotor_inertia: bool = False
    torque_hold: Literal["foh", "zoh"] = "foh"
    delay: float | Literal["estimate"] = 0.0
    l1: float | None = None
    l2: float | None = None
    constrain: bool = False
    cross_validate: bool = False

    def __post_init__(self) -> None:
        for name, low in (("window", 0.0), ("bandwidth", 0.0), ("l1", 0.0), ("l2", 0.0)):
            value = getattr(self, name)
            if value is not None and not low < value < math.inf:
                raise SettingError(f"{name}: expected a number above {low:g}, found {value:g}")
        if not 0.0 <= self.gravity < math.inf:
            raise SettingError(f"gravity: expected a number of 0 or more, found {self.gravity:g}")
        if self.delay != "estimate" and not math.isfinite(self.delay):
            raise SettingError(f"delay: expected seconds or 'estimate', found {self.delay:g}")
        if self.estimator == "paper":
            self._refuse_what_the_paper_lacks()

    @property
    def luenberger(self) -> bool:
        """Whether velocities come from the paper's observer."""
        return (self.observer or ("luenberger" if self.estimator == "paper" else "zero-phase")) == "luenberger"

    @property
    def lengths(self) -> dict[str, float]:
        """The link lengths that are known, in m."""
        return {name: value for name, value in (("l1", self.l1), ("l2", self.l2)) if value is not None}

    def torque_shift(self, dt: float, found_delay: float | None = None) -> float:
        """Time in s after which a logged torque acts: half a sample of hold, and the delay, found or set."""
        hold = 0.5 * dt if self.torque_hold == "zoh" else 0.0
        if found_delay is not None:
            return hold + found_delay
        return hold + (0.0 if self.delay == "estimate" else self.delay)

    def as_json(self) -> dict[str, Any]:
        """For `result.json`; complex poles as text."""
        content = asdict(self)
        content["poles"] = [pole.real if complex(pole).imag == 0 else str(pole) for pole in map(complex, self.poles)]
        return content

    def _refuse_what_the_paper_lacks(self) -> None:
        ours = {f.name: f.default for f in fields(self)}
        for name in ("friction", "torque_offset", "rotor_inertia", "delay", "l1", "l2", "constrain", "cross_validate"):
            if getattr(self, name) != ours[name]:
                flag = "--" + name.replace("_", "-")
                raise SettingError(f"{flag}: the paper's method has no such term; use --estimator refined or weak")
        if self.gravity == 0:
            raise SettingError("--gravity 0: the paper's payload needs gravity; use --estimator refined or weak")
