"""The torque's model, and whether the torque is held between samples: given, or chosen by logs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from algid.base.names import within
from algid.estimators.fit import Fit
from algid.estimators.hold import Hold
from algid.estimators.terms import CHOICE, Selection, TermTrial, needs_shape, price, select
from algid.identification.known import model_of
from algid.identification.passes import long_enough, problem_of
from algid.identification.recordings import Recordings
from algid.model import CHOICES, COLUMN_NAMES, DELAYS, EVERY_TERM, Model, without_delay
from algid.physics.effort import absent, without_terms
from algid.results import Result
from algid.settings import Settings


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
    asked, hold_by = settings.torque_hold, _BY_SETTINGS
    if asked == "auto" and earlier is not None:
        asked, hold_by = Settings.of(earlier.settings).torque_hold, "parameters"
    hold: Hold = "zoh" if asked == "zoh" else "foh"
    if settings.chooses and earlier is not None:
        terms = model_of(earlier).terms + within(DELAYS, earlier.parameters)
        chosen = replace(_given(model_of(earlier), terms), chosen_by="parameters")
        return replace(chosen, hold=hold, hold_by=hold_by)
    by_logs = settings.torque_hold == "auto" and earlier is None and settings.delay == 0
    by_logs &= not any(EVERY_TERM[term].timing for term in settings.terms)
    if not (settings.chooses or by_logs or needs_shape(settings.terms)):
        plain = Model(gravity=settings.gravity)
        return replace(_given(plain, settings.terms), hold=hold, hold_by=hold_by)
    with long_enough(survey):
        chosen = _by_first_pass(survey, settings, hold)
        if by_logs and chosen.model.lag_name is None and not (chosen.refuted and settings.chooses):
            return _with_hold(survey, settings, chosen)
        return replace(chosen, hold_by=hold_by)


_BY_SETTINGS: Literal["settings", "parameters"] = "settings"
_OF_HOLD = "kept: the logs leave open whether the torque is held, half a sample late"
_OF_CONTROLLER = "kept: the logs leave open how late a controller that is faster than they are acts"


def _with_hold(survey: Recordings, settings: Settings, chosen: Selection) -> Selection:
    """The model and the hold that the logs show."""
    late = chosen.late
    if late is None:
        return chosen
    if late.hold == "zoh":
        chosen = _by_first_pass(survey, settings, "zoh")
    elif not late.determined and not chosen.delay:
        why = _OF_CONTROLLER if late.faster else _OF_HOLD
        trials = [trial for trial in chosen.trials if trial.term not in DELAYS]
        trials += [TermTrial(term, True, np.nan, why) for term in DELAYS]
        chosen = replace(chosen, delay=True, trials=tuple(trials))
    return replace(chosen, hold=late.hold, hold_by="logs", late=late)


def _by_first_pass(survey: Recordings, settings: Settings, hold: Hold) -> Selection:
    """The model asked for with the shape of friction, or the one that logs choose, of that hold."""
    candidates: tuple[str, ...] = ()
    if settings.chooses and settings.delay == 0:
        candidates = CHOICE
    elif settings.chooses:
        candidates = without_delay(CHOICE)
    plain = replace(_given(Model(gravity=settings.gravity), ()), hold=hold)
    chosen = select(
        problem_of(survey, settings, plain),
        without_terms(settings.effort, candidates),
        settings.terms,
        absent(settings.effort, COLUMN_NAMES),
    )
    return replace(chosen, hold=hold)


def _given(model: Model, terms: Sequence[str]) -> Selection:
    """The model with `terms`, of which a delay is estimated beside it."""
    own = without_delay(terms)
    return Selection(replace(model, terms=own), len(own) < len(terms))


def without_insignificant(chosen: Selection, fit: Fit, settings: Settings) -> Selection:
    """The selection without the terms that the logs chose and the fit finds not worth their price.

    The first pass weighs by noise levels that the fit improves, and linearises elsewhere.
    """
    if chosen.chosen_by != "logs" or chosen.shrunk:
        return chosen
    nothing = _insignificant(chosen, fit).difference(settings.terms)
    why = "left out: the fit finds it to be zero within its error"
    return chosen.changed(nothing, why, kept=False)


def _insignificant(chosen: Selection, fit: Fit) -> set[str]:
    """Terms of the fit none of whose coefficients has t² > ln N + 2 ln T, N samples, T terms."""
    least = np.sqrt(price(1, max(2, fit.freedom), len(CHOICE)))
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
        if any(EVERY_TERM[other].needs == name for other in chosen.model.terms):
            continue
        if max(size.get(parameter, 0.0) for parameter in term.names) < least:
            terms.add(name)
    return terms
