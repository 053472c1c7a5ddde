"""The torque's model, and whether the torque is held between samples: given, or chosen by logs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from algid.base.names import outside, within
from algid.estimators.fit import Fit
from algid.estimators.hold import Hold
from algid.estimators.selection import CHOICE, Selection, TermTrial, lateness, needs_shape, select
from algid.identification.known import model_of
from algid.identification.passes import long_enough, passes, weak_settings
from algid.identification.recordings import Recordings
from algid.model import CHOICES, COLUMN_NAMES, DELAYS, EVERY_TERM, Model, without_delay
from algid.physics.effort import absent, without_terms
from algid.results import Result
from algid.settings import Settings

NOTHING = 2.0
"""Standard deviations: a coefficient nearer to zero is not distinguished from it."""


def choose_model(
    survey: Recordings, settings: Settings, earlier: Result | None = None
) -> Selection:
    """The torque's model: set by the user, taken from an earlier result, or chosen by the logs.

    The same with whether the torque is held between samples. Where logs are to tell that and do
    not, the delay is estimated.

    Raises
    ------
    LogError
        If no log is long enough.
    """
    with long_enough(survey):
        if earlier is not None or settings.torque_hold != "auto":
            return _with_model(survey, settings, earlier)
        return _with_hold(survey, settings)


def _with_model(survey: Recordings, settings: Settings, earlier: Result | None) -> Selection:
    """The model where the hold is given, by the settings or by the earlier result."""
    asked = settings.torque_hold
    hold_by: Literal["settings", "parameters"] = "settings"
    if asked == "auto" and earlier is not None:
        asked, hold_by = Settings.of(earlier.settings).torque_hold, "parameters"
    hold: Hold = "foh"
    if asked == "zoh":
        hold = "zoh"
    if settings.chooses and earlier is not None:
        terms = within(DELAYS, earlier.parameters)
        chosen = replace(_given(model_of(earlier), terms), chosen_by="parameters")
    else:
        chosen = _modelled(survey, settings, hold)
    return replace(chosen, hold=hold, hold_by=hold_by)


_OF_HOLD = "kept: the logs leave open whether the torque is held, half a sample late"
_OF_CONTROLLER = "kept: the logs leave open how late a controller that is faster than they are acts"


def _with_hold(survey: Recordings, settings: Settings) -> Selection:
    """The model and the hold that the logs show: not held where a delay is set or asked for."""
    chosen = _modelled(survey, settings, "foh")
    lagged = chosen.model.lag_name is not None
    if settings.delay != 0 or set(DELAYS) & set(settings.terms) or lagged:
        return chosen
    late = chosen.late
    if late is None:
        unloaded, loaded = passes(survey, settings)
        late = lateness(unloaded, loaded, weak_settings(settings, chosen))
    if late.hold == "zoh":
        chosen = _modelled(survey, settings, "zoh")
    elif not late.determined and not chosen.delay:
        why = _OF_CONTROLLER if late.faster else _OF_HOLD
        trials = [trial for trial in chosen.trials if trial.term not in DELAYS]
        trials += [TermTrial(term, True, np.nan, np.nan, why) for term in DELAYS]
        chosen = replace(chosen, delay=True, trials=tuple(trials))
    return replace(chosen, hold=late.hold, hold_by="logs", late=late)


def _modelled(survey: Recordings, settings: Settings, hold: Hold) -> Selection:
    """The model that the settings ask for, or that the logs choose, of a torque with that hold."""
    plain = Model(gravity=settings.gravity)
    if not settings.chooses and not needs_shape(settings.terms):
        return replace(_given(plain, settings.terms), hold=hold)
    candidates: tuple[str, ...] = ()
    if settings.chooses and settings.delay == 0:
        candidates = CHOICE
    elif settings.chooses:
        candidates = without_delay(CHOICE)
    unloaded, loaded = passes(survey, settings)
    chosen = select(
        unloaded,
        loaded,
        weak_settings(settings, replace(_given(plain, ()), hold=hold)),
        without_terms(settings.effort, candidates),
        settings.terms,
        absent(settings.effort, COLUMN_NAMES),
    )
    return replace(chosen, hold=hold)


def with_hold_of_fit(fit: Fit, chosen: Selection) -> Selection:
    """The selection with the hold that the fit determines, if the logs did not; else unchanged."""
    late = chosen.undetermined
    if late is None or late.faster or chosen.shrunk:
        return chosen
    if not fit.converged or not set(DELAYS) <= set(fit.names):
        return chosen
    place = fit.names.index(DELAYS[0])
    late = late.after(float(fit.values[place]), float(fit.std[place]))
    if not late.decided:
        return replace(chosen, late=replace(late, effect=np.inf))
    if late.another:
        return replace(chosen, late=late)
    chosen = chosen.left_out(DELAYS, "left out: the fit shows whether the torque is held")
    return replace(chosen, hold=late.hold, late=late, delay=False)


def _given(model: Model, terms: Sequence[str]) -> Selection:
    """The model with more terms, of which a delay is estimated beside it."""
    own = without_delay(terms)
    return Selection(replace(model, terms=model.terms + own), len(own) < len(terms))


def without_nothing(chosen: Selection, fit: Fit, settings: Settings) -> Selection:
    """Drop the terms that the logs chose and whose coefficients are not significant in the fit.

    A term may earn its place before the weak estimator by what differentiation leaves behind; the
    efficient fit then finds each of its coefficients within `NOTHING` standard deviations of zero.
    """
    if chosen.chosen_by != "logs" or chosen.shrunk:
        return chosen
    nothing = _insignificant(chosen, fit).difference(settings.terms)
    if not nothing:
        return chosen
    chosen = chosen.left_out(nothing, "the fit finds it to be zero within its error")
    terms = outside(chosen.model.terms, nothing)
    delay = chosen.delay and nothing == set(without_delay(nothing))
    return replace(chosen, model=replace(chosen.model, terms=terms), delay=delay)


def _insignificant(chosen: Selection, fit: Fit) -> set[str]:
    """Terms of the fit whose coefficients are all within `NOTHING` deviations of zero."""
    size = dict(zip(fit.names, np.abs(fit.values) / np.maximum(fit.std, 1e-300), strict=True))
    terms = set()
    for name in CHOICES:
        term = EVERY_TERM[name]
        if name not in chosen.model.terms and set(term.names).isdisjoint(fit.names):
            continue
        if name in DELAYS and chosen.undetermined is not None:
            continue
        if term.sines and "y_p" in fit.shared.body:  # the payload's offset shows in them
            continue
        if max(size.get(parameter, 0.0) for parameter in term.names) < NOTHING:
            terms.add(name)
    return terms
