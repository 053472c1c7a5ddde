"""Which terms the torque's model needs, by the likelihood of its first pass and of a fit.

One pass of the likelihood over pieces of the logs is linearised with the columns of every term, at
the weak form's estimate with the most common ones. Whitened by the noise levels that neighbouring
samples show, its normal equations hold every model without some of the terms: each is linear
algebra. From no term on, the one whose evidence outweighs its price most is added,

    W / s² > χ²_n(1 - α / T)

with W what its n coefficients explain of the squares, s² the mean square that all terms leave (1 at
least), T the terms to choose from and α the level at which the likelihood is refuted, so that what
refutes it is chosen where it is a term; then those are dropped that are not worth it beside the
others. A rotor is an exception, as every geared motor has one and k1, k3 and k5 take it up: it
stays from W / s² > 3.84 on if they would move by more than two of the deviations that they had
without it.

======  ==================================================================  ====================
symbol  name                                                                shape
======  ==================================================================  ====================
p       coefficients of all columns, the delay, the loaded arm's k1 … k5    (P,)
G       products of a log's whitened columns by joint, the torque last      (2, P + 1, P + 1)
======  ==================================================================  ====================

Loaded logs share every coefficient with unloaded ones save k1 … k5, so that friction is one where
both kinds determine it and no payload need be guessed.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Literal

import numpy as np

from algid.base.compiled import chi2_exceeded
from algid.base.names import evenly_spread, outside, vector, within
from algid.base.significance import level
from algid.estimators import weak
from algid.estimators.combine import of_kind
from algid.estimators.hold import SURE, Hold, Lateness
from algid.estimators.log_likelihood import opened
from algid.estimators.misfit import At, Products, misfit
from algid.estimators.modulating_functions import row_weights
from algid.estimators.problem import OF_A_WINDOW, Problem, Source, TooShortError
from algid.model import (
    CHOICES,
    DELAYS,
    EVERY_TERM,
    FIRST_TERMS,
    LARGEST_PHASE,
    PARAMETERS,
    RIGID,
    SINES,
    TERMS,
    Model,
    without_delay,
)
from algid.physics.effort import ELASTIC
from algid.physics.signals import TRIED
from algid.signals.segments import pieces, spread_pieces

CHOICE = tuple(name for name, term in EVERY_TERM.items() if name in CHOICES and not term.lags)
"""Terms that the logs choose from; one column serves lag and delay, equal to first order."""
_LAG = tuple(name for name, term in EVERY_TERM.items() if term.lags)
_MOST_LOGS = 8
"""Logs of a kind, evenly spread, that are looked at: terms are those of the arm, not of a log."""
_PIECES, _PIECE_SAMPLES = 4, 16384
_ROUNDS = 3
_SUSPECTED = 3.84
"""W of a rotor, 5 %, from which it is not left out where that would move the arm's constants."""
_MOVES = 2.0
"""Standard deviations that k1 … k5 have without it: the least of such moves."""


@dataclass(frozen=True)
class TermTrial:
    """What became of one term, beside those that were kept.

    Parameters
    ----------
    term : str
    kept : bool
    evidence : float
        What it explains of the squares less what chance does; negative where it is not worth it.
    reason : str
        Why it was kept or left out, in words.
    """

    term: str
    kept: bool
    evidence: float
    reason: str


@dataclass(frozen=True)
class Selection:
    """The model chosen, whether a delay is estimated beside it, and who chose.

    `trials` are those of the terms; where the terms were given there are none. `shapes` is the
    model whose friction has the shape that windows give it before any term is chosen; `refuted`
    says that the first pass with every term leaves more than a sensor's noise. `hold` is the
    torque's between samples, and `late` how late the logs say it acts where it is not held.
    """

    model: Model
    delay: bool
    chosen_by: Literal["logs", "settings", "parameters"] = "settings"
    trials: tuple[TermTrial, ...] = ()
    shapes: Model | None = None
    refuted: bool = False
    hold: Hold = "foh"
    hold_by: Literal["logs", "settings", "parameters"] = "settings"
    late: Lateness | None = None

    def without(self, terms: Collection[str], reason: str) -> Selection:
        """The same without `terms`, whose trials end so for this `reason`."""
        trials = [
            replace(trial, kept=False, reason=reason) if trial.term in terms else trial
            for trial in self.trials
        ]
        model = replace(self.model, terms=outside(self.model.terms, terms))
        delay = self.delay and set(DELAYS).isdisjoint(terms)
        return replace(self, model=model, delay=delay, trials=tuple(trials))

    @property
    def undetermined(self) -> Lateness | None:
        """The torque's lateness, if the logs were to choose its hold and leave it open."""
        if self.hold_by != "logs" or self.late is None or self.late.determined:
            return None
        return self.late


def has_need(term: str, terms: Collection[str]) -> bool:
    """Whether the term without which `term` has no meaning, if there is one, is among `terms`."""
    needed = EVERY_TERM[term].needs
    return needed is None or needed in terms


def _using(shape: str) -> tuple[str, ...]:
    """Terms that a width of friction shapes."""
    return tuple(name for name, term in TERMS.items() if shape in term.shapes)


def _spread(sources: Sequence[Source]) -> list[Source]:
    """Pieces of one pass over each of the logs of one kind, or of some, evenly spread."""
    logs: list[Source] = []
    for source in evenly_spread(sources, _MOST_LOGS):
        every = pieces(source(), _PIECE_SAMPLES)
        logs.append(partial(tuple, spread_pieces(every, _PIECES, _PIECE_SAMPLES)[0]))
    return logs


def _start(problem: Problem, memory: weak.Memory, elastic: At) -> tuple[Model, At]:
    """Widths of friction, and coefficients of the first terms, by windows; loaded logs' apart.

    Those of elastic joints are among the first where coefficients of such are known.

    Raises
    ------
    TooShortError
        If no log is long enough for a window.
    """
    settings = problem.settings
    model = settings.model
    firsts = FIRST_TERMS + (ELASTIC if elastic else ())

    def solved(model: Model) -> tuple[float, At]:
        cost, at = 0.0, {}
        # beside a delay, which looks like friction where joints turn back
        beside_delay = replace(settings, model=model, estimate_delay=True)
        first = {kind: vector(model.names, c, otherwise=0.0) for kind, c in elastic.items()}
        every = weak.normals_of(replace(problem, settings=beside_delay), first, memory=memory)
        for loaded in (False, True):
            normals = of_kind(every, loaded)
            if normals:
                c, _ = weak.solve(normals)
                for normal in normals:
                    weights = row_weights(normal.total, np.append(-c, 1.0), normal.rows)
                    cost -= float(normal.rows @ np.log(weights))
                at[loaded] = dict(zip(model.names, c.tolist(), strict=False))
                at[loaded][DELAYS[0]] = settings.shift.delay
        if not at:
            raise TooShortError(f"no {OF_A_WINDOW}")
        return cost, at

    for shape, values in TRIED.items():
        using = _using(shape)
        if not using:
            continue
        terms = firsts if set(using) & set(firsts) else firsts + using[:1]
        costs = []
        for value in values:
            trial = replace(model, **{shape: value})  # type: ignore[arg-type]
            costs.append(solved(replace(trial, terms=terms))[0])
        least, offset = int(np.argmin(costs)), 0.0
        if 0 < least < len(costs) - 1:
            below, here, above = costs[least - 1 : least + 2]  # a parabola's bottom
            offset = 0.5 * (below - above) / max(below - 2 * here + above, 1e-300)
        best = float(values[least] * (values[1] / values[0]) ** offset)
        model = replace(model, **{shape: best})  # type: ignore[arg-type]
    model = replace(model, terms=firsts)
    return model, solved(model)[1]


@dataclass(frozen=True, eq=False)
class _Search:
    """Forward from the fixed terms by the most evident one, then backward."""

    first: Products
    offered: tuple[str, ...]
    fixed: tuple[str, ...]
    absent: Collection[str]
    suspects: Collection[str]

    @cached_property
    def scale(self) -> float:
        """Mean square of what all terms leave."""
        return self.first.mean_square(self.first.columns(self.offered))

    @cached_property
    def candidates(self) -> tuple[str, ...]:
        """Terms to choose from."""
        return outside(self.offered, self.fixed)

    def evidence(self, term: str, beside: Sequence[str]) -> float:
        """What `term` explains of the squares, less what chance explains once in a level's logs."""
        alone = level("REFUTED") / max(1, len(self.candidates))
        by_chance = chi2_exceeded(len(self.first.own(term)), alone)
        return self.explained(term, beside) / self.scale - float(by_chance)

    def explained(self, term: str, beside: Sequence[str]) -> float:
        """By how much `term` lowers the squares."""
        columns = self.first.columns
        return self.first.explained(columns([*beside, term]), columns(beside))

    def beyond_sampling(self, term: str, beside: Sequence[str]) -> bool:
        """Whether the squares fall by more than what the stamps of a log without noise leave open.

        A simulator's log has none, and what its integration and sampling leave is no term.
        """
        return self.first.noisy or self.explained(term, beside) > self.first.open_squares

    def plausible(self, term: str, beside: Sequence[str]) -> bool:
        """Whether the coefficients of `term` beside those terms are plausible."""
        p, _, _ = self.first.solve(self.first.columns([*beside, term]))
        value = self.first.coefficients(p)[False]
        for name in set(EVERY_TERM[term].names).difference(self.absent).intersection(value):
            low, high = PARAMETERS[name].plausible
            if not low <= value[name] <= high:
                return False
            if name in SINES and np.arctan2(abs(value[name]), value[SINES[name]]) > LARGEST_PHASE:
                return False
        return True

    def is_needed(self, term: str, beside: Sequence[str]) -> bool:
        """Whether `term` is a rotor that the log suspects, and without which k1 … k5 move.

        Every geared motor has one: the price of a term that few arms have is not its own.
        """
        suspected = self.explained(term, beside) > _SUSPECTED * self.scale
        rotor = EVERY_TERM[term].rotor and term in self.suspects
        if not (rotor and suspected and self.first.noisy):
            return False
        first, rest = self.first, self.first.columns(beside)
        (place,) = first.own(term)
        p, _, _ = first.solve(np.append(rest, place))
        moves = np.abs(p[place]) * first.effect(place, rest, self.scale)
        arm = np.flatnonzero(np.isin(first.names, RIGID))
        return bool(np.any(moves[np.isin(rest, arm)] > _MOVES))

    def supported(self, term: str, beside: Sequence[str]) -> bool:
        """Whether `term` is plausible, and needed or evident beyond sampling."""
        evident = self.evidence(term, beside) > 0 and self.beyond_sampling(term, beside)
        return (evident or self.is_needed(term, beside)) and self.plausible(term, beside)

    def run(self) -> list[str]:
        """The terms that stay."""
        kept = list(self.fixed)
        while True:
            left = [term for term in self.candidates if term not in kept and has_need(term, kept)]
            better = [
                (self.evidence(term, kept), term) for term in left if self.supported(term, kept)
            ]
            if not better:
                break
            kept.append(max(better)[1])
        while True:
            needed = {EVERY_TERM[term].needs for term in kept}
            poor = []
            for term in outside(kept, self.fixed):
                if term in needed:
                    continue
                others = outside(kept, (term,))
                if not self.supported(term, others):
                    poor.append((self.evidence(term, others), term))
            if not poor:
                return kept
            kept.remove(min(poor)[1])

    def into(self, chosen: Selection, kept: Sequence[str]) -> Selection:
        """A selection with the terms that were kept, and what became of each."""
        own = without_delay(kept)
        trials = tuple(self._trial(term, kept) for term in self.offered)
        model, delay = replace(chosen.model, terms=own), len(own) < len(kept)
        return replace(chosen, model=model, delay=delay, trials=trials)

    def _trial(self, term: str, kept: Sequence[str]) -> TermTrial:
        beside = [other for other in kept if other != term and EVERY_TERM[other].needs != term]
        asked = term in self.fixed
        if not asked and not has_need(term, beside):
            reason = f"left out: no meaning without {EVERY_TERM[term].needs}"
            return TermTrial(term, False, 0.0, reason)
        evidence = self.evidence(term, beside)
        if asked:
            reason = "asked for"
        elif term in kept and evidence > 0:
            reason = "kept: evident in the likelihood"
        elif term in kept:
            reason = "kept: hardly significant, but k1 … k5 would move without it"
        elif evidence <= 0:
            reason = "left out: not significant"
        elif not self.beyond_sampling(term, beside):
            reason = "left out: explains less than sampling leaves open"
        elif not self.plausible(term, beside):
            reason = "left out: its value would contradict physics"
        else:
            reason = "left out: other terms explain the same"
        return TermTrial(term, asked or term in kept, evidence, reason)


def select(
    problem: Problem,
    candidates: Sequence[str] = CHOICE,
    kept: Sequence[str] = (),
    absent: Collection[str] = (),
) -> Selection:
    """Choose the terms of the torque's model.

    Parameters
    ----------
    problem : Problem
        Each of its logs is gone over once. Of more than `_MOST_LOGS` some, evenly spread. Its
        model's gravity counts, not its terms.
    candidates : names in `CHOICE`
        A delay that turns out negative is a lag where that explains more.
    kept : names in `CHOICES`
        Terms that stay whatever the data say; only their shapes are found.
    absent : names of parameters
        That the unloaded arm's torque does not hold: what is found for them is noise.

    Raises
    ------
    TooShortError
        If no log is long enough for a window, or for the likelihood.
    """
    unloaded, loaded = _spread(problem.unloaded), _spread(problem.loaded)
    some, memory = replace(problem, unloaded=unloaded, loaded=loaded), weak.Memory()
    chosen, elastic = _selected(some, memory, candidates, kept, absent, {})
    if elastic:  # what rigid joints have for friction's width is not theirs
        again, _ = _selected(some, memory, candidates, kept, absent, elastic)
        if not again.refuted:
            return again
    return chosen


def revised(
    chosen: Selection, products: Products, kept: Sequence[str], absent: Collection[str]
) -> Selection:
    """The same choice by the likelihood at a fit's estimates, widths and noise levels."""
    fixed = tuple(kept)
    if chosen.delay and chosen.undetermined is not None:
        fixed += DELAYS
    tried = tuple(trial.term for trial in chosen.trials)
    # a rotor that the first pass did not suspect is none for being hardly significant now
    search = _Search(products, tried, fixed, absent, chosen.model.terms)
    return search.into(chosen, search.run())


def _selected(
    problem: Problem,
    memory: weak.Memory,
    candidates: Sequence[str],
    kept: Sequence[str],
    absent: Collection[str],
    elastic: At,
) -> tuple[Selection, At]:
    """The terms that `select` chooses, and the coefficients if elastic joints are among them."""
    model, at = _start(problem, memory, elastic)
    shapes = model
    logs = [log for log in opened(problem) if log.loaded in at]
    fixed = tuple(kept)
    everything = tuple(dict.fromkeys(tuple(candidates) + fixed))
    base = problem.settings.shift.delay
    # Read from the torque, the load of joints would carry the torque's noise into its column, and
    # where angles are precise every joint would look elastic: the motion tells whether one is.
    for log in logs:
        log.by_motion = not elastic
    first = Products(logs, model, at, base)
    soft = within(candidates, ELASTIC)
    if soft and not elastic:
        search = _Search(first, everything, fixed, absent, candidates)
        if search.evidence(soft[0], outside(everything, soft)) > 0:
            for log in logs:
                log.by_motion = False
            first = Products(logs, model, at, base)
    before: list[str] | None = None
    for left in reversed(range(_ROUNDS)):
        left_by_all = first.levels(logs, first.columns(everything))
        refuted = misfit(logs, left_by_all) < level("REFUTED")
        search = _Search(first, everything, fixed, absent, candidates)
        terms = search.run()
        after = first.coefficients(first.solve(first.columns(terms))[0])
        # a delay of samples that explains most is far from linear in its column
        late = (after[False][DELAYS[0]] - at[logs[0].loaded][DELAYS[0]]) / first.dt
        far = abs(late) > 1 and terms[len(fixed) : len(fixed) + 1] == [*DELAYS]
        linear = all(EVERY_TERM[term].linear and not EVERY_TERM[term].timing for term in terms)
        # joints that give much are far from linear in what they give
        far |= not set(ELASTIC).isdisjoint(terms)
        if (refuted and not far) or linear or terms == before:
            break
        at, before = after, terms
        first = Products(logs, model, at, base)
        if left and far and late < -1:  # what is found has another round
            (lag,) = EVERY_TERM[_LAG[0]].names
            early = {
                kind: {**c, lag: base - c[DELAYS[0]], DELAYS[0]: base} for kind, c in at.items()
            }
            lagging = replace(model, terms=model.terms + _LAG)
            other = Products(logs, lagging, early, base)
            others = outside(terms, DELAYS)
            plain, column = first.columns(terms), other.columns([*others, *_LAG])
            scale = other.mean_square(column)
            less = (first.solve(plain)[1] - other.solve(column)[1]) / scale
            # the noise of a torque whose low-pass is undone is larger
            if less + first.determinant - other.determinant > 2 * SURE:
                first, model = other, lagging
                at = first.coefficients(first.solve(column)[0])
                candidates = outside(candidates, DELAYS) + _LAG
                everything = tuple(dict.fromkeys((*candidates, *fixed)))
    lateness = first.lateness(terms)
    if refuted:  # of what a model that does not hold leaves, no part is the delay's
        lateness = replace(lateness, std=np.inf)
    chosen = Selection(shapes, False, "logs", shapes=shapes, refuted=refuted, late=lateness)
    chosen = search.into(chosen, terms)
    if not candidates:
        chosen = replace(chosen, chosen_by="settings", trials=())
    return chosen, {} if set(ELASTIC).isdisjoint(terms) else after
