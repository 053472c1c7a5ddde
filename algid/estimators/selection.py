"""Which terms the torque's model needs, by prediction of held-out data and by evidence.

The normal equations of the weak form are gathered with the columns of every term, and every model
without some of them is solved from the same Gram matrices. Moments over smooth windows are a
residual filtered after the model, so that the held-out ones measure how well a model predicts.

Terms are taken in where they lower the squared moments of folds (logs, or blocks of a log) that
were left out of the fit by more than a hundredth of a period in the stamps would make, since a log
without noise has the errors of its sampling all the same, and where the evidence outweighs its
price,

    W > n (log N + 2 log T)

with W their Wald statistic, n their coefficients, N the independent stretches of log (Schwarz
1978) and T the terms to choose from (Chen & Chen 2008, γ = 1). What makes a column, the width of
friction and where a term that is not linear is linearised, is improved between the rounds.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import combinations
from typing import Literal

import numpy as np

from algid.arm import FloatArray
from algid.base.names import evenly_spread, outside
from algid.estimators.hold import Hold, Lateness
from algid.estimators.term_grams import CHANGE, Coefficients, Grams, Training
from algid.estimators.weak import Source, WeakSettings
from algid.model import (
    CHOICES,
    EVERY_TERM,
    LARGEST_PHASE,
    PARAMETERS,
    SINES,
    TERMS,
    Model,
    names_of,
    terms_named,
    without_delay,
)
from algid.physics.motion import Widths

CHOICE = tuple(name for name, term in EVERY_TERM.items() if name in CHOICES and not term.lags)
"""Terms that the logs choose from; one column serves lag and delay, equal to first order."""
_DELAY = tuple(name for name, term in EVERY_TERM.items() if term.delays)
_LAG = tuple(name for name, term in EVERY_TERM.items() if term.lags)
# Where a joint has no motor, its gain is nothing and makes its equation vanish.
_OF_BOTH_TORQUES = tuple(name for name in CHOICE if EVERY_TERM[name].gains)
FIRST_TERMS = tuple(name for name, term in TERMS.items() if term.usual)
_WIDTHS = np.array([0.01, 0.02, 0.04, 0.08, 0.16, 0.32])  # rad/s
_FADES = np.array([0.1, 0.3, 0.9])  # rad/s
_NEAR = np.array([0.7, 0.84, 1.0, 1.2, 1.44])  # of a shape found before


def _terms_of(shape: str) -> set[str]:
    """Names of the terms whose columns depend on a shape of friction."""
    return {name for name, term in TERMS.items() if shape in term.shapes}


_SHAPED = {shape.name: _terms_of(shape.name) for shape in fields(Widths)}
_RELINEARISED = {name for name in CHOICE if not EVERY_TERM[name].linear or EVERY_TERM[name].timing}
MOST_LOGS = 100
"""Logs of a kind, evenly spread, that are looked at."""
_ROUNDS = 4
_TOGETHER = 2  # terms that are tried at once


@dataclass(frozen=True)
class TermTrial:
    """What became of one term, beside those that were kept.

    Parameters
    ----------
    term : str
    kept : bool
    prediction : float
        Share by which the held-out squared moments fall with it; negative where they grow.
    evidence : float
        Its Wald statistic less its price; negative where it is not worth it.
    reason : str
        Why it was kept or left out, in words.
    """

    term: str
    kept: bool
    prediction: float
    evidence: float
    reason: str


@dataclass(frozen=True)
class Selection:
    """The model chosen, whether a delay is estimated beside it, and who chose.

    `trials` are those of the terms, and `held_out` is what was left out of the fit in turn; where
    the terms were given there are none. `shapes` is the model of the most common terms, whose
    friction has the shape that logs give it before any is chosen; `shrunk` says that none was
    chosen in the end, but every term shrunk. `hold` is the torque's between samples, and `late` how
    late the logs say it acts where it is not held.
    """

    model: Model
    delay: bool
    chosen_by: Literal["logs", "settings", "parameters"] = "settings"
    trials: tuple[TermTrial, ...] = ()
    held_out: Literal["logs", "blocks"] | None = None
    shapes: Model | None = None
    shrunk: bool = False
    hold: Hold = "foh"
    hold_by: Literal["logs", "settings", "parameters"] = "settings"
    late: Lateness | None = None

    def left_out(self, terms: Collection[str], reason: str) -> Selection:
        """The same with the trials of `terms` ending in their being left out for this `reason`."""
        return replace(self, trials=_ended(self.trials, terms, kept=False, reason=reason))

    def with_term(self, term: str, reason: str) -> Selection:
        """The same with one more term, whose trial ends in its being kept for this `reason`."""
        model = replace(self.model, terms=self.model.terms + without_delay((term,)))
        delay = self.delay or EVERY_TERM[term].delays
        trials = _ended(self.trials, (term,), kept=True, reason=reason)
        return replace(self, model=model, delay=delay, trials=trials)

    @property
    def undetermined(self) -> Lateness | None:
        """The torque's lateness, if the logs were to choose its hold and leave it open."""
        if self.hold_by != "logs" or self.late is None or self.late.determined:
            return None
        return self.late


def _ended(
    trials: Sequence[TermTrial], terms: Collection[str], *, kept: bool, reason: str
) -> tuple[TermTrial, ...]:
    """The trials, those of `terms` with another end."""
    ended = []
    for trial in trials:
        if trial.term in terms:
            trial = replace(trial, kept=kept, reason=reason)
        ended.append(trial)
    return tuple(ended)


@dataclass(frozen=True, eq=False)
class _Look:
    """Point of the columns: settings, shapes, coefficients by name of unloaded and loaded logs."""

    logs: tuple[Training, ...]
    settings: WeakSettings
    at: Mapping[bool, Coefficients]

    def grams(self, terms: Sequence[str], **shape: float) -> Grams:
        """Normal equations with the columns of `terms`."""
        plain = replace(self.settings.model, terms=without_delay(terms))
        model = replace(plain, **shape)  # type: ignore[arg-type]
        return Grams(self.logs, replace(self.settings, model=model), self.at)

    def shaped(self, shape: str, values: FloatArray, terms: Sequence[str]) -> _Look:
        """With the value of a shape at which the model with `terms` fits best."""
        halves = replace(self, logs=tuple(log.half for log in self.logs))
        costs = [halves.grams(terms, **{shape: float(value)}).cost for value in values]
        best = float(np.exp(_lowest(np.log(values), costs)))
        model = replace(self.settings.model, **{shape: best})  # type: ignore[arg-type]
        return replace(self, settings=replace(self.settings, model=model))

    def moved(self, grams: Grams, terms: Sequence[str]) -> _Look:
        """At what the sub-model with `terms` gives."""
        at = grams.coefficients(terms)
        delay = self.settings.shift.delay + at[False][CHANGE]
        moved = replace(self, settings=self.settings.delayed(delay), at=at)
        for shape, shaped in _SHAPED.items():
            if not shaped.isdisjoint(terms):
                now = getattr(self.settings.model, shape)
                moved = moved.shaped(shape, now * _NEAR, terms)
        return moved


def needs_shape(terms: Sequence[str]) -> bool:
    """Whether some of `terms` have a width or a speed that is to be found."""
    return any(not shaped.isdisjoint(terms) for shaped in _SHAPED.values())


def select(
    unloaded: Sequence[Source],
    loaded: Sequence[Source],
    settings: WeakSettings,
    candidates: Sequence[str] = CHOICE,
    kept: Sequence[str] = (),
    absent: Collection[str] = (),
) -> Selection:
    """Choose the terms of the torque's model.

    Parameters
    ----------
    unloaded, loaded : sequences of callables
        Each gives a fresh iterable of `Segment`; it is called once. Of more than `MOST_LOGS` some,
        evenly spread.
    settings : WeakSettings
        Its model's gravity, its window, bandwidth, hold and delay.
    candidates : names in `CHOICE`
        A delay that turns out negative is a lag where that explains more.
    kept : names in `CHOICES`
        Terms that stay whatever the data say; only their shapes are found.
    absent : names of parameters
        That the unloaded arm's torque does not hold: what is found for them is noise.

    Raises
    ------
    ValueError
        If no log is long enough for a window.
    """
    logs = _training(unloaded, loaded)
    if not all(log.driven for log in logs):
        candidates = [term for term in candidates if term not in _OF_BOTH_TORQUES]
    start = _start(logs, settings)
    look, fixed, before = start, tuple(kept), None
    everything = tuple(dict.fromkeys(tuple(candidates) + fixed))
    searches: list[_Search] = []
    for _ in range(_ROUNDS):
        grams = look.grams(everything)
        free = outside(candidates, fixed)
        searches.append(_Search(grams, free, fixed, absent))
        terms = searches[-1].run()
        if terms == before or not (_RELINEARISED | _SHAPED["coulomb_speed"]) & set(terms):
            break
        look, before = look.moved(grams, terms), terms
        for term in _DELAY:
            if term in terms and term not in fixed:
                fixed += (term,)
    model = replace(look.settings.model, terms=without_delay(terms))
    delayed = len(model.terms) < len(terms)
    shapes = start.settings.model
    late = grams.lateness(terms)
    if not candidates:
        return Selection(model, delayed, shapes=shapes, late=late)
    trials = []
    for term in everything:
        search = searches[-1]
        if term in _DELAY:
            search = searches[0]
        trials.append(search.trial(term, terms, kept))
    chosen = Selection(model, delayed, "logs", tuple(trials), grams.held_out, shapes, late=late)
    return _as_lag(start, look, terms, chosen)


def _start(logs: Sequence[Training], settings: WeakSettings) -> _Look:
    """Constants and shapes of friction that a model of the most common terms gives."""
    look = _Look(tuple(logs), settings, {False: {}, True: {}}).shaped(
        "coulomb_speed", _WIDTHS, FIRST_TERMS
    )
    at = look.grams(FIRST_TERMS).coefficients(FIRST_TERMS + _DELAY)
    for values in at.values():
        del values[CHANGE]
    start = replace(look, at=at)
    fading = tuple(_SHAPED["stribeck_speed"])
    if fading:
        start = start.shaped("stribeck_speed", _FADES, FIRST_TERMS + fading)
    return start


def lateness(
    unloaded: Sequence[Source], loaded: Sequence[Source], settings: WeakSettings
) -> Lateness:
    """How late the torque of logs acts beside the model of the settings.

    Parameters
    ----------
    unloaded, loaded : sequences of callables
        Each gives a fresh iterable of `Segment`; it is called once.
    settings : WeakSettings
        Its hold is that of a torque that is not held.

    Raises
    ------
    TooShortError
        If no log is long enough for a window.
    """
    logs = _training(unloaded, loaded)
    return Grams(logs, settings, {False: {}, True: {}}).lateness(settings.model.terms)


def _training(unloaded: Sequence[Source], loaded: Sequence[Source]) -> list[Training]:
    """Some logs of each kind, at most `MOST_LOGS` and evenly spread, ready for the choice."""
    logs = []
    for is_loaded, sources in ((False, unloaded), (True, loaded)):
        for source in evenly_spread(sources, MOST_LOGS):
            logs.append(Training.of(source, is_loaded))
    return logs


def _lowest(x: FloatArray, y: Sequence[float]) -> float:
    """Where the parabola through the least value and its neighbours has its bottom.

    At an end, the end itself.
    """
    least = int(np.argmin(y))
    if least in (0, len(x) - 1):
        return float(x[least])
    a, b, _ = np.polyfit(x[least - 1 : least + 2] - x[least], y[least - 1 : least + 2], 2)
    return float(x[least] - b / (2 * a))


def _as_lag(start: _Look, look: _Look, terms: Sequence[str], chosen: Selection) -> Selection:
    """The selection with a lag in place of a negative delay where that fits better."""
    if not (chosen.delay and _LAG) or look.settings.shift.delay >= start.settings.shift.delay:
        return chosen
    timely = replace(look, settings=look.settings.delayed(start.settings.shift.delay))
    others = without_delay(terms)
    # both with the torque's slope, the one shifted before
    if timely.grams(others).cost >= look.grams(others).cost:
        return chosen
    trials = []
    for trial in chosen.trials:
        if trial.term in _DELAY:
            trial = replace(trial, term=_LAG[0])
        trials.append(trial)
    model = replace(chosen.model, terms=chosen.model.terms + _LAG)
    return replace(chosen, model=model, delay=False, trials=tuple(trials))


def plausible(values: Mapping[str, float]) -> bool:
    """Whether coefficients, by name, are of a plausible size and sign."""
    for name, value in values.items():
        low, high = PARAMETERS[name].plausible
        if not low <= value <= high:
            return False
    return True


@dataclass(frozen=True, eq=False)
class _Search:
    """Forward by single terms, then by pairs, then backward."""

    grams: Grams
    candidates: tuple[str, ...]
    fixed: tuple[str, ...]
    absent: Collection[str] = ()

    def evidence(self, terms: Sequence[str], beside: Sequence[str]) -> float:
        """Evidence of `terms` less its price."""
        wald, count, stretches = self.grams.wald(terms, list(beside) + list(terms))
        price = count * (np.log(stretches) + 2 * np.log(max(2, len(self.candidates))))
        # The noise is estimated too, from as many stretches.
        return float(stretches * np.log1p(max(wald, 0.0) / stretches) - price)

    def gain(self, terms: Sequence[str], beside: Sequence[str]) -> float:
        """The share by which the held-out squares fall."""
        without, with_terms = self._held_out(terms, beside)
        return 1 - with_terms / without

    def _held_out(self, terms: Sequence[str], beside: Sequence[str]) -> tuple[float, float]:
        """The held-out squares without `terms`, and with them."""
        together = list(beside) + list(terms)
        return self.grams.held_out_squares(beside), self.grams.held_out_squares(together)

    def beyond_sampling(self, terms: Sequence[str], beside: Sequence[str]) -> bool:
        """Whether the held-out squares fall by more than what the log's stamps leave open.

        A simulator's log has no noise, and what its integration and sampling leave is no term.
        """
        without, with_terms = self._held_out(terms, beside)
        return without - with_terms > self.grams.open_squares

    def agreed(self, terms: Sequence[str], beside: Sequence[str]) -> bool:
        """Whether what was left out, and physics, speak for `terms` too."""
        return self.beyond_sampling(terms, beside) and self.plausible(terms, beside)

    def plausible(self, terms: Sequence[str], among: Sequence[str]) -> bool:
        """Whether the coefficients of `terms` beside `among` are plausible."""
        value = self.grams.coefficients(list(among) + list(terms))[False]
        own = set(names_of(terms_named(terms))).difference(self.absent)
        for name in own.intersection(SINES, value):
            if np.arctan2(abs(value[name]), value[SINES[name]]) > LARGEST_PHASE:
                return False
        return plausible({name: value[name] for name in own.intersection(value)})

    def run(self) -> list[str]:
        """The terms that stay."""
        kept = list(self.fixed)
        while added := self._addition(kept):
            kept += added
        while (dropped := self._removal(kept)) is not None:
            kept.remove(dropped)
        return kept

    def _addition(self, kept: list[str]) -> list[str]:
        left = [term for term in self.candidates if term not in kept and has_need(term, kept)]
        for count in range(1, _TOGETHER + 1):
            better = []
            for terms in combinations(left, count):
                evidence = self.evidence(terms, kept)
                if evidence > 0 and self.agreed(terms, kept):
                    better.append((evidence, list(terms)))
            if better:
                return max(better)[1]
        return []

    def _removal(self, kept: list[str]) -> str | None:
        needed = {EVERY_TERM[term].needs for term in kept}
        poor = []
        for term in kept:
            if term in self.fixed or term in needed:
                continue
            others = [other for other in kept if other != term]
            evidence = self.evidence([term], others)
            if evidence <= 0 or not self.agreed([term], others):
                poor.append((evidence, term))
        if not poor:
            return None
        return min(poor)[1]

    def trial(self, term: str, kept: Sequence[str], asked: Sequence[str]) -> TermTrial:
        """What became of a term, beside those that were kept."""
        beside = [other for other in kept if other != term and EVERY_TERM[other].needs != term]
        if term not in asked and not has_need(term, beside):
            reason = f"left out: no meaning without {EVERY_TERM[term].needs}"
            return TermTrial(term, False, 0.0, 0.0, reason)
        gain, evidence = self.gain([term], beside), self.evidence([term], beside)
        if term in asked:
            reason = "asked for"
        elif term in kept:
            reason = "kept: predicts better what was left out, and is evident"
        elif evidence <= 0:
            reason = "left out: not significant"
        elif gain <= 0:
            reason = "left out: predicts no better what was left out"
        elif not self.beyond_sampling([term], beside):
            reason = "left out: explains less than sampling leaves open"
        elif not self.plausible([term], beside):
            reason = "left out: its value would contradict physics"
        else:
            reason = "left out: other terms explain the same"
        return TermTrial(term, term in kept or term in asked, gain, evidence, reason)


def has_need(term: str, terms: Collection[str]) -> bool:
    """Whether the term without which `term` has no meaning, if there is one, is among `terms`."""
    needed = EVERY_TERM[term].needs
    return needed is None or needed in terms
