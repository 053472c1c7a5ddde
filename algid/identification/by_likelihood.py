"""The estimators that give a fit, on logs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from algid.base.names import within
from algid.base.runtime import Worker
from algid.base.significance import LEVEL
from algid.estimators import robust, weak
from algid.estimators.body import averaged_over_bodies, with_body
from algid.estimators.combine import Prior, joined, without
from algid.estimators.diagnostics import constrained
from algid.estimators.doubt import doubted_without_motor
from algid.estimators.elastic import with_rotors
from algid.estimators.fit import Fit, Misfit
from algid.estimators.hold import Hold
from algid.estimators.prediction import PredictionSums
from algid.estimators.terms import Selection, TermTrial, has_need, plausible
from algid.identification.passes import Pass, long_enough, passes, weak_settings
from algid.identification.recordings import Recording, Recordings
from algid.methods import estimator_of
from algid.model import DELAYS, FIRST_TERMS, TERMS, Model
from algid.notices import Notice
from algid.physics.effort import absent
from algid.settings import Settings
from algid.signals.segments import Segment

Predictions = Mapping[Recording, PredictionSums]
"""What scores a prediction of a log by any coefficients."""


def run_fit(
    survey: Recordings, settings: Settings, chosen: Selection, prior: Prior | None
) -> tuple[Fit, Predictions, Selection]:
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

    Returns
    -------
    The fit, the sums that score its prediction of each log, where a pass of the estimator could
    gather them, and the model that it has in the end.

    Raises
    ------
    LogError
        If no log is long enough.
    ValueError
        If the settings' estimator gives time series.
    """
    estimator = estimator_of(settings.estimator)
    if estimator.fit is None:
        raise ValueError(f"{estimator.name} gives time series, not a fit")
    estimate = estimator.fit
    sums: dict[Recording, PredictionSums] = {}
    ours = weak_settings(settings, chosen)
    watched = None
    if chosen.model.linear and not chosen.delay and chosen.model.lag_name is None:
        watched = partial(_scored, chosen.model, settings, sums)  # which depends on no estimate
    unloaded, loaded = passes(survey, settings, watched)
    nothing = absent(settings.effort, chosen.model.names)
    with long_enough(survey):
        known = without(prior, nothing)
        if chosen.undetermined is not None and chosen.delay:
            known = joined(known, chosen.undetermined.prior)

        def fitted(selection: Selection) -> Fit:
            windows = weak_settings(settings, selection)
            before = with_rotors(known, selection.model)
            return estimate(unloaded, loaded, windows, settings.lengths, before, survey.progress)

        # why no term is chosen but every one shrunk, if so
        notes: tuple[Notice, ...] | None = None
        picked = chosen
        if chosen.refuted and settings.chooses and estimator.name == "refined":
            notes = (Notice("REFUTED", numbers={"case": "noise", "kept": "weak"}),)
        else:
            fit = fitted(chosen)
            if fit.misfit is not None and settings.chooses:
                fit, chosen = completed(fit, chosen, fitted)
                ours = weak_settings(settings, chosen)
                sums.clear()
            picked = chosen
            if fit.refuted and settings.chooses:
                notes = fit.notes
        if notes is not None:
            fit, chosen = _shrunk(notes, unloaded, loaded, ours, settings, chosen, prior)
            sums.clear()
        if not chosen.shrunk and fit.shared.model != chosen.model:
            # the fit has estimated the width of friction's step
            chosen = replace(chosen, model=fit.shared.model)
            sums.clear()
        better = _of_motorless(fit, survey, settings, picked, prior)
        if better is not None:
            fit, chosen = better
            ours = weak_settings(settings, chosen)
            sums.clear()
        if fit.estimator == "instruments" and not chosen.shrunk:
            fit = robust.with_feedback_noted(fit, unloaded, loaded, ours)
    return finished(fit, settings), sums, chosen


def finished(fit: Fit, settings: Settings) -> Fit:
    """The fit with the payload's body, within physics' bounds where the settings ask for it."""
    fit = averaged_over_bodies(with_body(fit))
    if settings.constrain:
        fit = constrained(fit)
    return fit


OVERLOOKED = 2
"""Terms at most that the likelihood adds."""
_BY_LIKELIHOOD = "kept: what the likelihood leaves of the torque depends on it"


def completed(
    fit: Fit, chosen: Selection, refit: Callable[[Selection], Fit], most: int = OVERLOOKED
) -> tuple[Fit, Selection]:
    """The fit with `most` more terms at most, where the likelihood holds with them.

    They are those that the weak form's noise hid. Unchanged where it does not: what the arm has is
    no term then, or several.
    """
    richer, better = chosen, fit
    for _ in range(most):
        added = _most_evident(better.misfit, richer)
        if added is None:
            break
        richer = richer.with_term(added, _BY_LIKELIHOOD)
        better = refit(richer)
        if better.converged and not better.refuted:
            return better, richer
    return fit, chosen


def _most_evident(misfit: Misfit | None, chosen: Selection) -> str | None:
    """The left-out term that the likelihood's residual shows most, if its value is plausible."""
    if misfit is None:
        return None
    left = {trial.term for trial in chosen.trials if not trial.kept}
    level = LEVEL / max(1, len(misfit.overlooked))
    seen = []
    for one in misfit.overlooked:
        possible = one.term in left and has_need(one.term, chosen.model.terms)
        if possible and one.p_value < level and plausible(one.values):
            seen.append((one.p_value, one.term))
    if not seen:
        return None
    return min(seen)[1]


_BY_NOTHING = "left out: it was judged beside constants near nothing"


def _of_motorless(
    fit: Fit, survey: Recordings, settings: Settings, chosen: Selection, prior: Prior | None
) -> tuple[Fit, Selection] | None:
    """The fit by instruments, where least squares leaves open what a joint without a motor does.

    It has the most common of the chosen terms: the others, and the hold, were judged beside
    constants near nothing. None where least squares determines them, or instruments do not either.
    """
    unloaded, loaded = passes(survey, settings)
    passive = any(log.origin.reading.passive for log in survey.logs)
    if settings.estimator != "refined" or loaded or not passive:
        return None
    if doubted_without_motor(fit, unloaded, loaded, weak_settings(settings, chosen)) is fit:
        return None
    terms = chosen.model.terms
    if chosen.chosen_by == "logs":
        terms = within(terms, FIRST_TERMS)
    dropped = {trial.term for trial in chosen.trials if trial.kept}.difference(terms)
    plainer = replace(chosen.left_out(dropped, _BY_NOTHING), delay=False, late=None)
    model = plainer.model
    if plainer.hold_by == "logs":
        plainer = replace(plainer, hold="foh")
    ours = weak_settings(settings, plainer)
    known = without(prior, absent(settings.effort, model.names))
    better = robust.of_passive_joint(unloaded, ours, settings.lengths, known)
    if better is None:
        return None
    return better, plainer


_SHRUNK = "kept and shrunk: where the likelihood is refuted no term is chosen"


def _shrunk(
    notes: tuple[Notice, ...],
    unloaded: Sequence[Pass],
    loaded: Sequence[Pass],
    ours: weak.WeakSettings,
    settings: Settings,
    chosen: Selection,
    prior: Prior | None,
) -> tuple[Fit, Selection]:
    """The fit with every term shrunk, and its model; `notes` say why no other stands."""
    hold: Hold = chosen.hold
    if chosen.hold_by == "logs":
        hold = "foh"  # else by a likelihood that does not hold: a term takes up the delay
    shift = replace(ours.shift, held=hold == "zoh")
    shaped = replace(ours, model=chosen.shapes or chosen.model, shift=shift)
    every = replace(shaped.model, terms=tuple(name for name, term in TERMS.items() if term.spread))
    nothing = absent(settings.effort, every.names)
    known = with_rotors(without(prior, nothing), chosen.model)
    fit = robust.fit(unloaded, loaded, shaped, settings.lengths, known)
    fit = replace(fit, notes=notes + fit.notes)
    terms = fit.shared.model.terms
    if fit.shared.delay:
        terms += DELAYS
    trials = tuple(TermTrial(term, True, np.nan, _SHRUNK) for term in terms)
    shrunken = Selection(
        fit.shared.model,
        fit.shared.delay,
        chosen.chosen_by,
        trials,
        shrunk=True,
        hold=hold,
        hold_by=chosen.hold_by,
    )
    return fit, shrunken


def _scored(
    model: Model,
    settings: Settings,
    sums: dict[Recording, PredictionSums],
    log: Recording,
    moving: Pass,
) -> Iterator[Segment]:
    """A pass that also gathers, once, what the prediction will be scored by."""
    if log in sums:
        yield from moving()
        return
    gathered = PredictionSums(model, settings.torque_shift())
    with Worker(gathered.push) as worker:
        for piece in moving():
            worker.push(piece)
            yield piece
    gathered.finish()
    sums[log] = gathered
