"""The torque's model, given or chosen by logs, and the estimators that give its fit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal

import numpy as np

from algid.base.names import outside, within
from algid.base.significance import SURE
from algid.estimators import robust
from algid.estimators.body import averaged_over_bodies, with_body
from algid.estimators.combine import Prior, joined, without
from algid.estimators.diagnostics import constrained, undriven
from algid.estimators.elastic import with_rotors
from algid.estimators.fit import Fit, solved_anew
from algid.estimators.hold import Hold
from algid.estimators.misfit import TERM_OF
from algid.estimators.problem import Problem, Source, WeakSettings
from algid.estimators.terms import (
    CHOICE,
    Selection,
    TermTrial,
    revised,
    select,
)
from algid.identification.known import model_of, prior_of
from algid.identification.recordings import Recording, Recordings
from algid.methods import estimator_of
from algid.model import (
    COLUMN_NAMES,
    DELAYS,
    EVERY_TERM,
    FIRST_TERMS,
    TERMS,
    Model,
    widths_in,
    without_delay,
)
from algid.notices import Notice
from algid.physics.effort import ELASTIC, absent, without_terms
from algid.results import Result
from algid.settings import Settings
from algid.signals.differences import TorqueShift


@dataclass(frozen=True, eq=False)
class Fitted:
    """A fit of recordings, and how it came about.

    Parameters
    ----------
    fit : Fit
    survey : Recordings
    settings : Settings
    chosen : the model that it has in the end
    """

    fit: Fit
    survey: Recordings = field(default_factory=lambda: Recordings(()))
    settings: Settings = field(default_factory=Settings)
    chosen: Selection = field(default_factory=lambda: Selection(Model(), False))

    @property
    def problem(self) -> Problem:
        """What the estimator was given but for what is known beforehand."""
        return problem_of(self.survey, self.settings, self.chosen)


def problem_of(
    survey: Recordings,
    settings: Settings,
    chosen: Selection,
    prior: Prior | None = None,
) -> Problem:
    """What an estimator is given to fit the chosen model, beside what is known beforehand.

    Segments have velocities only where they are not observed on the way.
    """
    own = settings.velocity == "measured" or settings.luenberger
    windows = WeakSettings(
        model=chosen.model,
        bandwidth=None if own else settings.bandwidth,
        shift=TorqueShift(chosen.hold == "zoh", settings.delay),
        estimate_delay=chosen.delay,
    )
    if settings.window is not None:
        windows = replace(windows, window=settings.window)

    def passed(log: Recording) -> Source:
        if own:
            return partial(survey.with_velocities, log, settings)
        return partial(survey.segments, log)

    known = without(prior, absent(settings.effort, chosen.model.names))
    known = with_rotors(known, chosen.model)
    if chosen.undetermined is not None and chosen.delay:
        known = joined(known, chosen.undetermined.prior)
    return Problem(
        list(map(passed, survey.unloaded)),
        list(map(passed, survey.loaded)),
        windows,
        settings.lengths,
        known,
        survey.progress,
    )


def choose_model(
    survey: Recordings, settings: Settings, earlier: Result | None = None
) -> Selection:
    """The torque's model: set by the user, taken from an earlier result, or chosen by the logs.

    The same with whether the torque is held between samples. Where logs are to tell that and do
    not, the delay is estimated.

    Raises
    ------
    TooShortError
        If no log is long enough.
    """
    asked = settings.torque_hold
    hold_by: Literal["logs", "settings", "parameters"] = "settings"
    by_logs = asked == "auto" and earlier is None and settings.delay == 0
    by_logs &= not any(EVERY_TERM[term].timing for term in settings.terms)
    if asked == "auto" and earlier is not None:
        asked, hold_by = Settings.of(earlier.settings).torque_hold, "parameters"
    hold: Hold = "zoh" if asked == "zoh" else "foh"
    if settings.chooses and earlier is not None:
        model = replace(model_of(earlier), gravity=settings.gravity)
        chosen = _given(model, model.terms + within(DELAYS, earlier.parameters))
        chosen = replace(chosen, chosen_by="parameters")
    elif not (settings.chooses or by_logs or widths_in(settings.terms)):
        chosen = _given(Model(gravity=settings.gravity), settings.terms)
    else:
        chosen = _by_first_pass(survey, settings, hold)
        late = chosen.late
        by_logs &= not (chosen.refuted and settings.chooses)
        if by_logs and late is not None:
            hold, hold_by = late.hold, "logs"
            if hold == "zoh":
                chosen = replace(_by_first_pass(survey, settings, hold), late=late)
            elif not late.determined and not chosen.delay:
                why = _OF_CONTROLLER if late.faster else _OF_HOLD
                trials = [trial for trial in chosen.trials if trial.term not in DELAYS]
                trials += [TermTrial(term, True, np.nan, why) for term in DELAYS]
                chosen = replace(chosen, delay=True, trials=tuple(trials))
    return replace(chosen, hold=hold, hold_by=hold_by)


Given = Callable[[Selection], Problem]
"""What an estimator is given to fit a model."""
_OF_HOLD = "kept: the logs leave open whether the torque is held, half a sample late"
_OF_CONTROLLER = "kept: the logs leave open how late a controller that is faster than they are acts"


def _by_first_pass(survey: Recordings, settings: Settings, hold: Hold) -> Selection:
    """The model asked for with the shape of friction, or the one that logs choose, of that hold."""
    candidates = CHOICE if settings.chooses else ()
    if settings.delay != 0:
        candidates = without_delay(candidates)
    plain = replace(_given(Model(gravity=settings.gravity), ()), hold=hold)
    return select(
        problem_of(survey, settings, plain),
        without_terms(settings.effort, candidates),
        settings.terms,
        absent(settings.effort, COLUMN_NAMES),
    )


def _given(model: Model, terms: Sequence[str]) -> Selection:
    """The model with `terms`, of which a delay is estimated beside it."""
    own = without_delay(terms)
    return Selection(replace(model, terms=own), len(own) < len(terms))


def run_fit(
    survey: Recordings,
    settings: Settings,
    earlier: Result | None = None,
    file: str | None = None,
) -> Fitted:
    """Fit the settings' estimator to logs, with the terms that they choose.

    Where its likelihood is refuted, every term shrunk: see `robust`.

    Parameters
    ----------
    survey : Recordings
        Of the logs; its `progress` is called with the refined estimator's steps too.
    settings : Settings
    earlier : Result
        What is known of the arm beforehand; where it is wrong, its `file` is named.

    Raises
    ------
    TooShortError
        If no log is long enough.
    """
    survey.begin("choosing terms")
    chosen = choose_model(survey, settings, earlier)
    prior = None if earlier is None else prior_of(earlier, chosen.model, file)
    survey.begin("fitting")
    problem = partial(problem_of, survey, settings, prior=prior)
    estimate = estimator_of(settings.estimator).fit

    def most_likely(chosen: Selection, given: Given) -> tuple[Fit, Selection]:
        """The fit of the chosen terms, or of those that its own likelihood chooses."""
        fit = estimate(given(chosen))
        better, other = fit, chosen
        for _ in range(_REVISIONS):
            # its own likelihood has noise levels that the first pass lacked
            if chosen.chosen_by != "logs" or better.products is None:
                break
            nothing = absent(settings.effort, COLUMN_NAMES)
            again = revised(other, better.products, settings.terms, nothing)
            if (again.model.terms, again.delay) == (other.model.terms, other.delay):
                break
            other, better = again, estimate(given(again))
            if not better.refuted:
                fit, chosen = better, other
            elif not fit.refuted:
                break
        return fit, chosen

    # why no term is chosen but every one shrunk, if so
    notes: tuple[Notice, ...] = ()
    if chosen.refuted and settings.chooses and settings.estimator == "refined":
        notes = (Notice("REFUTED", numbers={"case": "noise", "kept": "weak"}),)
    else:
        fit, chosen = most_likely(chosen, problem)
        if fit.refuted and _is_doubtful(fit):
            # wrong lengths refute a likelihood that holds with any others: checks see them by
            # the one that holds
            unsaid = settings.but(l1=None, l2=None)
            free, other = most_likely(chosen, partial(problem_of, survey, unsaid, prior=prior))
            if not free.refuted:
                shared = replace(free.shared, lengths=settings.lengths, body=())
                fit, chosen = solved_anew(free, shared, free.prior, None), other
        if fit.refuted and settings.chooses:
            notes = fit.notes
    picked = chosen
    if notes:
        fit, chosen = _shrunk(notes, chosen, problem)
    else:  # the fit has estimated the width of friction's step
        chosen = replace(chosen, model=fit.shared.model)
    passive = any(log.origin.reading.passive for log in survey.logs)
    if settings.estimator == "refined" and passive and not survey.loaded:
        fit, chosen = _of_motorless(fit, chosen, picked, settings.terms, problem)
    if fit.estimator == "instruments" and fit.shrinkage is None:
        fit = robust.with_feedback_noted(fit, problem(chosen))
    fit = finished(fit, settings)
    return Fitted(fit, survey, settings.but(torque_hold=chosen.hold), chosen)


_REVISIONS = 3
"""Fits at most after the first one."""


def _is_doubtful(fit: Fit) -> bool:
    """Whether a given length is outside the interval that the same likelihoods have for it."""
    free, given = fit.with_free_lengths, fit.shared.lengths
    for name in within(given, free.names):
        length, std = free.by_name[name]
        if abs(given[name] - length) > free.quantile * std:
            return True
    return False


def finished(fit: Fit, settings: Settings) -> Fit:
    """The fit with the payload's body, within physics' bounds where the settings ask for it."""
    fit = averaged_over_bodies(with_body(fit))
    if settings.constrain:
        fit = constrained(fit)
    return fit


_BY_NOTHING = "left out: it was judged beside constants near nothing"
_ZERO = "left out: the fit finds it to be zero within its error"


def _of_motorless(
    fit: Fit,
    chosen: Selection,
    picked: Selection,
    asked: Sequence[str],
    problem: Given,
) -> tuple[Fit, Selection]:
    """The fit by instruments, where least squares leaves open what a joint without a motor does.

    It has the most common of the terms that were `picked`, and those that were `asked` for: the
    others, and the hold, were judged beside constants near nothing. Unchanged where least squares
    determines them, or instruments do not either.
    """
    if undriven(fit, problem(picked)) is None:
        return fit, chosen
    terms = picked.model.terms
    if picked.chosen_by == "logs":
        terms = within(terms, FIRST_TERMS)
    dropped = {trial.term for trial in picked.trials if trial.kept}.difference(terms)
    plainer = replace(picked.without(dropped, _BY_NOTHING), delay=False, late=None)
    if plainer.hold_by == "logs":
        plainer = replace(plainer, hold="foh")
    better = robust.of_passive_joint(problem(plainer))
    if better is None:
        return fit, chosen
    if plainer.chosen_by != "logs":
        return better, plainer
    sizes = np.abs(better.values) / np.maximum(better.std, 1e-300)
    evident = {
        TERM_OF[name] for name, size in zip(better.names, sizes, strict=True) if size >= SURE
    }
    nothing = outside(plainer.model.terms, evident.union(asked))
    if nothing:
        poorer = plainer.without(nothing, _ZERO)
        without = robust.of_passive_joint(problem(poorer))
        if without is not None:
            return without, poorer
    return better, plainer


_SHRUNK = "kept and shrunk: where the likelihood is refuted no term is chosen"


def _shrunk(notes: tuple[Notice, ...], chosen: Selection, problem: Given) -> tuple[Fit, Selection]:
    """The fit with every term shrunk, and its model; `notes` say why no other stands."""
    # where the first pass is refuted more than elastic joints is amiss, which they would take up
    firm = chosen.refuted or set(ELASTIC).isdisjoint(chosen.model.terms)
    shrinking = tuple(name for name, term in TERMS.items() if term.spread)
    every = outside(shrinking, ELASTIC if firm else ())
    model = replace(chosen.shapes or chosen.model, terms=every)
    shrunken = replace(chosen, model=model, late=None)
    if chosen.hold_by == "logs":
        # else by a likelihood that does not hold: a term takes up the delay
        shrunken = replace(shrunken, hold="foh")
    fit = robust.fit(problem(shrunken))
    terms = fit.shared.model.terms + (DELAYS if fit.shared.delay else ())
    trials = tuple(TermTrial(term, True, np.nan, _SHRUNK) for term in terms)
    shrunken = replace(shrunken, model=fit.shared.model, delay=fit.shared.delay, trials=trials)
    return replace(fit, notes=notes + fit.notes), shrunken
