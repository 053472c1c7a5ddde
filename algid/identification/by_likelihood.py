"""The estimators that give a fit, on logs."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from algid.base.names import outside, within
from algid.estimators import robust
from algid.estimators.body import averaged_over_bodies, with_body
from algid.estimators.combine import Prior
from algid.estimators.diagnostics import constrained
from algid.estimators.excitation import undriven
from algid.estimators.fit import Fit
from algid.estimators.terms import Selection, TermTrial
from algid.identification.model_choice import revised
from algid.identification.passes import long_enough, problem_of
from algid.identification.recordings import Recordings
from algid.methods import estimator_of
from algid.model import DELAYS, FIRST_TERMS, TERMS, Model
from algid.notices import Notice
from algid.physics.effort import ELASTIC
from algid.settings import Settings


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


def run_fit(
    survey: Recordings, settings: Settings, chosen: Selection, prior: Prior | None
) -> Fitted:
    """Fit the settings' estimator to logs.

    Where its likelihood is refuted, every term shrunk: see `robust`.

    Parameters
    ----------
    survey : Recordings
        Of the logs; its `progress` is called with the refined estimator's steps too.
    settings : Settings
    chosen : Selection
        The torque's model, and whether a delay is estimated.
    prior : Prior
        What is known of the arm beforehand.

    Raises
    ------
    LogError
        If no log is long enough.
    ValueError
        If the settings' estimator gives time series.
    """
    estimator = estimator_of(settings.estimator)
    if estimator.settles:
        raise ValueError(f"{estimator.name} gives time series, not a fit")
    estimate = estimator.fit

    def fitted(selection: Selection) -> Fit:
        return estimate(problem_of(survey, settings, selection, prior))

    with long_enough(survey):
        # why no term is chosen but every one shrunk, if so
        notes: tuple[Notice, ...] = ()
        if chosen.refuted and settings.chooses and estimator.name == "refined":
            notes = (Notice("REFUTED", numbers={"case": "noise", "kept": "weak"}),)
        else:
            fit = fitted(chosen)
            fit, chosen = revised(fit, chosen, settings, fitted)
            if fit.refuted and settings.chooses:
                notes = fit.notes
        picked = chosen
        if notes:
            fit, chosen = _shrunk(notes, survey, settings, chosen, prior)
        elif fit.shared.model != chosen.model:
            # the fit has estimated the width of friction's step
            chosen = replace(chosen, model=fit.shared.model)
        fit, chosen = _of_motorless(fit, chosen, survey, settings, picked, prior)
        if fit.estimator == "instruments" and not chosen.shrunk:
            fit = robust.with_feedback_noted(fit, problem_of(survey, settings, chosen))
    return Fitted(finished(fit, settings), survey, settings, chosen)


def finished(fit: Fit, settings: Settings) -> Fit:
    """The fit with the payload's body, within physics' bounds where the settings ask for it."""
    fit = averaged_over_bodies(with_body(fit))
    if settings.constrain:
        fit = constrained(fit)
    return fit


_BY_NOTHING = "left out: it was judged beside constants near nothing"


def _of_motorless(
    fit: Fit,
    chosen: Selection,
    survey: Recordings,
    settings: Settings,
    picked: Selection,
    prior: Prior | None,
) -> tuple[Fit, Selection]:
    """The fit by instruments, where least squares leaves open what a joint without a motor does.

    It has the most common of the terms that were `picked`: the others, and the hold, were judged
    beside constants near nothing. Unchanged where least squares determines them, or instruments do
    not either.
    """
    passive = any(log.origin.reading.passive for log in survey.logs)
    if settings.estimator != "refined" or survey.loaded or not passive:
        return fit, chosen
    if undriven(fit, problem_of(survey, settings, picked)) is None:
        return fit, chosen
    terms = picked.model.terms
    if picked.chosen_by == "logs":
        terms = within(terms, FIRST_TERMS)
    dropped = {trial.term for trial in picked.trials if trial.kept}.difference(terms)
    plainer = replace(picked.changed(dropped, _BY_NOTHING, kept=False), delay=False, late=None)
    if plainer.hold_by == "logs":
        plainer = replace(plainer, hold="foh")
    better = robust.of_passive_joint(problem_of(survey, settings, plainer, prior))
    if better is None:
        return fit, chosen

    def refit(one: Selection) -> Fit:
        return robust.of_passive_joint(problem_of(survey, settings, one, prior)) or better

    return revised(better, plainer, settings, refit)


_SHRUNK = "kept and shrunk: where the likelihood is refuted no term is chosen"


def _shrunk(
    notes: tuple[Notice, ...],
    survey: Recordings,
    settings: Settings,
    chosen: Selection,
    prior: Prior | None,
) -> tuple[Fit, Selection]:
    """The fit with every term shrunk, and its model; `notes` say why no other stands."""
    # where the first pass is refuted more than elastic joints is amiss, which they would take up
    firm = chosen.refuted or set(ELASTIC).isdisjoint(chosen.model.terms)
    shrinking = tuple(name for name, term in TERMS.items() if term.spread)
    every = outside(shrinking, ELASTIC if firm else ())
    model = replace(chosen.shapes or chosen.model, terms=every)
    shrunken = replace(chosen, model=model, shrunk=True, late=None)
    if chosen.hold_by == "logs":
        # else by a likelihood that does not hold: a term takes up the delay
        shrunken = replace(shrunken, hold="foh")
    fit = robust.fit(problem_of(survey, settings, shrunken, prior))
    terms = fit.shared.model.terms
    if fit.shared.delay:
        terms += DELAYS
    shrunken = replace(
        shrunken,
        model=fit.shared.model,
        delay=fit.shared.delay,
        trials=tuple(TermTrial(term, True, np.nan, _SHRUNK) for term in terms),
    )
    return replace(fit, notes=notes + fit.notes), shrunken
