"""What every estimator is given: logs, how they are looked at, and what is known beforehand."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from algid.base.progress import Progress
from algid.estimators.combine import Prior
from algid.estimators.parametrisation import Shared
from algid.model import Model
from algid.signals.differences import AT_ONCE, TorqueShift
from algid.signals.segments import Segment

Source = Callable[[], Iterable[Segment]]
"""A log: gives its uniform segments in time order, afresh each time."""
OF_A_WINDOW = "log is long enough: expected more than a second of samples without a gap"
"""What an estimator by windows says where none is, behind which log it means."""


class TooShortError(ValueError):
    """No log has a stretch without a gap that is long enough: the log's fault, not a defect."""


@dataclass(frozen=True)
class WeakSettings:
    """How windows look at logs.

    Parameters
    ----------
    model : Model
    window : float, s
        Length of a window; a log without a piece of four windows gets shorter ones, unless it has
        been `shortened`.
    bandwidth : float, Hz, or None for the log's own velocities
        Of the zero-phase differentiator behind k1's column.
    shift : TorqueShift
        After how long a logged torque acts; its delay is where the estimate of it starts with
        `estimate_delay`.
    estimate_delay : bool
    rest : (2,) float, rad/s
        Speeds of the joints, RMS over a window, below which a joint stands: dry friction holds it
        then, and its window is left out. None looks at every window.
    """

    model: Model = field(default_factory=Model)
    window: float = 0.4
    bandwidth: float | None = 40.0
    shift: TorqueShift = AT_ONCE
    estimate_delay: bool = False
    rest: tuple[float, float] | None = None
    shortened: bool = False

    def delayed(self, delay: float) -> WeakSettings:
        """The same with a delay of the torque, s."""
        return replace(self, shift=replace(self.shift, delay=delay))


@dataclass(frozen=True, eq=False)
class Problem:
    """Logs of one arm, from which its parameters are to be estimated.

    Parameters
    ----------
    unloaded, loaded : sequences of callables
        The logs without and with the payload; an estimator goes over each several times.
    settings : WeakSettings
    lengths : mapping of "l1", "l2" to m, where known
    prior : Prior
        What an earlier result knows of the arm; unloaded logs are not needed then.
    progress : callable
        Called with each step and how many samples of how many it has gone over.
    """

    unloaded: Sequence[Source] = ()
    loaded: Sequence[Source] = ()
    settings: WeakSettings = field(default_factory=WeakSettings)
    lengths: Mapping[str, float] = field(default_factory=dict)
    prior: Prior | None = None
    progress: Progress | None = None

    @property
    def shared(self) -> Shared:
        """The parameters that are estimated."""
        settings = self.settings
        return Shared(
            settings.model, settings.estimate_delay, bool(self.loaded), dict(self.lengths)
        )

    @property
    def logs(self) -> list[Source]:
        """All logs, unloaded ones first."""
        return [*self.unloaded, *self.loaded]

    def kinds(self) -> Iterator[tuple[bool, Sequence[Source]]]:
        """Whether they are loaded, and the logs, of each kind of which there are some."""
        for loaded, sources in ((False, self.unloaded), (True, self.loaded)):
            if sources:
                yield loaded, sources

    def at(self, model: Model, delay: float | None, *, estimate_delay: bool = False) -> Problem:
        """The same logs by the `model` and the `delay` in s, where there is one, of a fit."""
        settings = self.settings if delay is None else self.settings.delayed(delay)
        return replace(self, settings=replace(settings, model=model, estimate_delay=estimate_delay))
