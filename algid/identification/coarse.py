"""Logs whose arm turns far from sample to sample: hold and terms are left to the likelihood.

Of such a motion neither a window's integral nor a differentiator is right: what they show of the
torque's terms, and of whether it is held, is their own error. The likelihood that integrates from
sample to sample is exact there: the hold with the larger one is taken, and what it leaves of the
torque shows the terms, from the rigid arm with viscous friction on.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice

from algid.estimators import refined
from algid.estimators.coarse_likelihood import turns_far
from algid.estimators.combine import Prior, without
from algid.estimators.fit import Fit
from algid.estimators.hold import Hold, Lateness
from algid.estimators.selection import FIRST_TERMS, Selection
from algid.estimators.too_short import TooShortError
from algid.identification.by_likelihood import completed, finished
from algid.identification.model_choice import without_nothing
from algid.identification.passes import passes, weak_settings
from algid.identification.survey import Survey
from algid.model import CHOICES, without_delay
from algid.names import within
from algid.physics.effort import absent
from algid.settings import Settings

_LOOKED_AT = 4  # segments at the start of a log
_HOLDS: tuple[Hold, ...] = ("foh", "zoh")
_TERMS = 4  # at most that the likelihood adds
_CERTAIN = 1e6  # log of the odds where only one of the two holds stands
_MOST_COMMON = "kept: the likelihood does not hold without it"
_NOT_EVIDENT = "left out: what the likelihood leaves of the torque does not depend on it"


@dataclass(frozen=True, eq=False)
class _Attempt:
    chosen: Selection
    fit: Fit

    @property
    def stands(self) -> bool:
        return self.fit.converged and self.fit.deviance is not None


def fit_coarse(
    survey: Survey, settings: Settings, chosen: Selection, prior: Prior | None
) -> tuple[Fit, Selection] | None:
    """The fit to logs of which some are coarse, and its model.

    None where none is, or where that likelihood does not hold either.

    Parameters
    ----------
    survey : Survey
        Of the logs.
    settings : Settings
    chosen : Selection
        What the weak form chose, or was given: terms and hold that are given stay.
    prior : Prior
        What is known of the arm beforehand.
    """
    passive = any(log.origin.reading.passive for log in survey.logs)
    lagged = chosen.model.lag_name is not None and chosen.chosen_by != "logs"
    if settings.estimator != "refined" or passive or lagged or not _any_coarse(survey):
        return None
    try:
        for start in _starts(chosen, settings):
            found = _by_hold(survey, settings, start, prior)
            if found is not None:
                return _with_terms(survey, settings, found, prior)
    except TooShortError:
        pass
    return None


def _any_coarse(survey: Survey) -> bool:
    return any(turns_far(list(islice(survey.segments(log), _LOOKED_AT))) for log in survey.logs)


def _starts(chosen: Selection, settings: Settings) -> Iterator[Selection]:
    """The model that was given; else a rigid arm's, the most common, and what the weak form chose.

    Each but the first is for logs that refute the one before.
    """
    if chosen.chosen_by != "logs":
        yield chosen
        return
    shaped = chosen.shapes or chosen.model
    for terms in ((), FIRST_TERMS):
        own = within(CHOICES, terms + settings.terms)
        if not {trial.term for trial in chosen.trials}.issuperset(terms):
            continue
        model = replace(shaped, terms=without_delay(own))
        trials = []
        for trial in chosen.trials:
            kept = trial.term in own
            trials.append(replace(trial, kept=kept, reason=_MOST_COMMON if kept else _NOT_EVIDENT))
        delay = len(model.terms) < len(own)
        yield replace(chosen, model=model, delay=delay, trials=tuple(trials))
    yield chosen


def _by_hold(
    survey: Survey, settings: Settings, chosen: Selection, prior: Prior | None
) -> _Attempt | None:
    """The attempt with the likelier hold; None where neither stands, or none is likelier by far."""
    if chosen.hold_by != "logs" or chosen.late is None:
        only = _attempt(survey, settings, chosen, prior)
        return only if only.stands else None
    plain = replace(chosen, delay=False)
    even, held = (_attempt(survey, settings, replace(plain, hold=hold), prior) for hold in _HOLDS)
    if not (even.stands or held.stands):
        return None
    odds = _CERTAIN if held.stands else -_CERTAIN
    if even.fit.deviance is not None and held.fit.deviance is not None:
        odds = 0.5 * (even.fit.deviance - held.fit.deviance)
    late = Lateness.by_odds(odds, chosen.late.half)
    likelier = held if odds > 0 else even
    if not late.decided or not likelier.stands:
        return None
    return replace(likelier, chosen=replace(likelier.chosen, late=late))


def _attempt(
    survey: Survey, settings: Settings, chosen: Selection, prior: Prior | None
) -> _Attempt:
    unloaded, loaded = passes(survey, settings)
    known = without(prior, absent(settings.effort, chosen.model.names))
    ours = weak_settings(settings, chosen)
    fit = refined.fit(unloaded, loaded, ours, settings.lengths, known, survey.progress, coarse=True)
    return _Attempt(chosen, fit)


def _with_terms(
    survey: Survey, settings: Settings, found: _Attempt, prior: Prior | None
) -> tuple[Fit, Selection] | None:
    """With the terms that the likelihood shows; None where it does not hold with them."""

    def refit(chosen: Selection) -> Fit:
        return _attempt(survey, settings, chosen, prior).fit

    fit, chosen = found.fit, found.chosen
    if fit.misfit is not None and settings.chooses:
        fit, chosen = completed(fit, chosen, refit, _TERMS)
    if fit.refuted or not fit.converged:
        return None
    # friction's step has the width that the fit has estimated
    chosen = replace(chosen, model=fit.shared.model)
    plainer = without_nothing(chosen, fit, settings)
    if (plainer.model, plainer.delay) != (chosen.model, chosen.delay):
        again = refit(plainer)
        if again.converged and not again.refuted:
            fit, chosen = again, replace(plainer, model=again.shared.model)
    return finished(fit, settings), chosen
