"""The estimators that give a fit, on logs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np

from algid.errors import LogError
from algid.estimators import exogeneity, instruments, load_scatter, motorless, shrunk, weak
from algid.estimators.body import averaged_over_bodies, with_body
from algid.estimators.combine import Prior, without
from algid.estimators.diagnostics import FAR_BEYOND, broken_bounds, constrained
from algid.estimators.doubt import doubted, doubted_without_motor
from algid.estimators.fit import Fit, Misfit
from algid.estimators.hold import Hold
from algid.estimators.innovations import ResidualSums, pooled
from algid.estimators.prediction import PredictionScore, PredictionSums, score
from algid.estimators.selection import (
    CHOICE,
    FIRST_TERMS,
    Selection,
    TermTrial,
    has_need,
    lateness,
    needs_shape,
    plausible,
    select,
)
from algid.estimators.shrinkage import joined
from algid.estimators.too_short import TooShortError
from algid.estimators.window_scatter import scattered
from algid.identification.known import model_of
from algid.identification.predicted import prediction
from algid.identification.remarks import exchanged
from algid.identification.series import torque_coefficients, torque_shift
from algid.identification.source import LogSource
from algid.identification.survey import Survey
from algid.identification.velocities import with_velocities
from algid.methods import estimator_of
from algid.model import (
    CHOICES,
    COLUMN_NAMES,
    DELAYS,
    EVERY_TERM,
    RIGID,
    TERMS,
    Model,
    without_delay,
)
from algid.names import outside, within
from algid.notices import Notice
from algid.physics.effort import absent, without_terms
from algid.results import Result
from algid.runtime import Worker
from algid.settings import Settings
from algid.signals.segments import Segment
from algid.signals.shift import TorqueShift
from algid.significance import LEVEL

NOTHING = 2.0
"""Standard deviations: a coefficient nearer to zero is not distinguished from it."""
MOST = 0.5
"""R² below which most of a torque is not the model's."""
Pass = Callable[[], Iterable[Segment]]
Predictions = Mapping[LogSource, PredictionSums]
"""What scores a prediction of a log by any coefficients."""


def choose_model(survey: Survey, settings: Settings, earlier: Result | None = None) -> Selection:
    """The torque's model: set by the user, taken from an earlier result, or chosen by the logs.

    The same with whether the torque is held between samples. Where logs are to tell that and do
    not, the delay is estimated.

    Raises
    ------
    LogError
        If no log is long enough.
    """
    try:
        if earlier is not None or settings.torque_hold != "auto":
            return _with_model(survey, settings, earlier)
        return _with_hold(survey, settings)
    except TooShortError as error:
        raise LogError(
            f"{', '.join(log.name for log in survey.logs)}: {error}; record longer"
        ) from error


def _with_model(survey: Survey, settings: Settings, earlier: Result | None) -> Selection:
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


def _with_hold(survey: Survey, settings: Settings) -> Selection:
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


def _modelled(survey: Survey, settings: Settings, hold: Hold) -> Selection:
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


def run_fit(
    survey: Survey, settings: Settings, chosen: Selection, prior: Prior | None
) -> tuple[Fit, Predictions, Selection]:
    """Fit the settings' estimator to logs.

    Where its likelihood is refuted, every term shrunk: see `shrunk`.

    Parameters
    ----------
    survey : Survey
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
    sums: dict[LogSource, PredictionSums] = {}
    ours = weak_settings(settings, chosen)
    watched = None
    if chosen.model.linear and not chosen.delay and chosen.model.lag_name is None:
        watched = partial(_scored, chosen.model, settings, sums)  # which depends on no estimate
    unloaded, loaded = passes(survey, settings, watched)
    nothing = absent(settings.effort, chosen.model.names)
    try:
        known = without(prior, nothing)
        if chosen.undetermined is not None and chosen.delay:
            known = joined(known, chosen.undetermined.prior)

        def fitted(selection: Selection) -> Fit:
            windows = weak_settings(settings, selection)
            return estimate(unloaded, loaded, windows, settings.lengths, known, survey.progress)

        fit = fitted(chosen)
        if fit.misfit is not None and settings.chooses:
            fit, chosen = completed(fit, chosen, fitted)
            ours = weak_settings(settings, chosen)
            sums.clear()
        picked = chosen
        if fit.refuted and settings.chooses:
            fit, chosen = _shrunk(fit, unloaded, loaded, ours, settings, chosen, prior)
            sums.clear()
        else:
            fit = _unsure_of_load(fit, unloaded, loaded, ours, settings, known)
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
            fit = exogeneity.watched(fit, unloaded, loaded, ours)
    except TooShortError as error:
        raise LogError(
            f"{', '.join(log.name for log in survey.logs)}: {error}; record longer"
        ) from error
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


def _unsure_of_load(
    fit: Fit,
    unloaded: Sequence[Pass],
    loaded: Sequence[Pass],
    ours: weak.WeakSettings,
    settings: Settings,
    known: Prior | None,
) -> Fit:
    """The fit, where its model does not hold, with what friction by load leaves open."""
    holds = fit.whiteness is None or fit.whiteness.white
    if holds and fit.misfit is None:
        return fit

    def refit(model: Model) -> Fit:
        return weak.fit(unloaded, loaded, replace(ours, model=model), settings.lengths, known)

    return load_scatter.widened(fit, refit)


_BY_NOTHING = "left out: it was judged beside constants near nothing"


def _of_motorless(
    fit: Fit, survey: Survey, settings: Settings, chosen: Selection, prior: Prior | None
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
    model = replace(chosen.model, terms=terms)
    plainer = replace(chosen.left_out(dropped, _BY_NOTHING), model=model, delay=False, late=None)
    if plainer.hold_by == "logs":
        plainer = replace(plainer, hold="foh")
    ours = weak_settings(settings, plainer)
    known = without(prior, absent(settings.effort, model.names))
    better = motorless.by_instruments(unloaded, ours, settings.lengths, known)
    if better is None:
        return None
    return better, plainer


_SHRUNK = "kept and shrunk: where the likelihood is refuted no term is chosen"


def _shrunk(
    refuted: Fit,
    unloaded: Sequence[Pass],
    loaded: Sequence[Pass],
    ours: weak.WeakSettings,
    settings: Settings,
    chosen: Selection,
    prior: Prior | None,
) -> tuple[Fit, Selection]:
    """The fit with every term shrunk in place of the `refuted` one's, and its model."""
    hold: Hold = chosen.hold
    if chosen.hold_by == "logs":
        hold = "foh"  # else by a likelihood that does not hold: a term takes up the delay
    shift = replace(ours.shift, held=hold == "zoh")
    shaped = replace(ours, model=chosen.shapes or chosen.model, shift=shift)
    every = replace(shaped.model, terms=tuple(name for name, term in TERMS.items() if term.spread))
    nothing = absent(settings.effort, every.names)
    known = without(prior, nothing)
    least = shrunk.fit(unloaded, loaded, shaped, settings.lengths, known)
    fit = exogeneity.settled(least, unloaded, loaded, shaped)
    fit = scattered(fit, least, unloaded, loaded, shaped, settings.lengths, known)

    def refit(model: Model) -> Fit:
        # every term is offered anew: of a model its shapes and its friction by load count
        return shrunk.fit(unloaded, loaded, replace(shaped, model=model), settings.lengths, known)

    fit = load_scatter.widened(fit, refit, least)
    notes = refuted.notes + (Notice("SHRUNK_TERMS", note=True),) + fit.notes
    fit = replace(fit, notes=notes)
    terms = fit.shared.model.terms
    if fit.shared.delay:
        terms += DELAYS
    trials = tuple(TermTrial(term, True, np.nan, np.nan, _SHRUNK) for term in terms)
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


def residual_of(
    survey: Survey, settings: Settings, chosen: Selection, fit: Fit
) -> ResidualSums | None:
    """Residual sums of the estimator behind the fit: of its innovations, or of its windows.

    None where no log is long enough.
    """
    if fit.residual:
        return pooled(fit.residual)
    windows = weak_settings(settings, chosen)
    if fit.delay is not None:
        windows = replace(windows.delayed(fit.delay), estimate_delay=False)
    unloaded, loaded = passes(survey, settings)
    sums = []
    for role, of_role in (("unloaded", unloaded), ("loaded", loaded)):
        for moving in of_role:
            c = torque_coefficients(fit, role)
            of_log = weak.residuals(moving, windows, c)
            if of_log is not None:
                sums.append(of_log)
    return pooled(sums)


def with_doubt(fit: Fit, survey: Survey, settings: Settings, chosen: Selection) -> Fit:
    """The fit; where its likelihood is refuted, with what makes k1 … k5 doubtful: see `doubted`.

    Of an arm with a joint that has no motor, whether its equation determines them: see
    `doubted_without_motor`. One that physics contradicts stays as sure as it is, so that the
    contradiction is reported, as logs in each other's place are.
    """
    if any(log.origin.reading.passive for log in survey.logs):
        unloaded, loaded = passes(survey, settings)
        fit = doubted_without_motor(fit, unloaded, loaded, weak_settings(settings, chosen))
    if not (fit.refuted and settings.chooses) or exchanged(fit):
        return fit
    far = []
    for broken in broken_bounds(fit):
        if broken.distance is not None and broken.distance > FAR_BEYOND:
            far.append(broken.bound)
    if far:
        lawful = constrained(fit)
        if not lawful.converged or _explains_little(lawful, survey, settings):
            return fit
        doubt = Notice("BOUNDS_DOUBTED", numbers={"bounds": far})
        return fit.marked("WEAK_EXCITATION", RIGID).noted(doubt)
    unloaded, loaded = passes(survey, settings)
    common = replace(chosen, model=replace(chosen.model, terms=FIRST_TERMS))
    return doubted(fit, unloaded, loaded, weak_settings(settings, common))


def _explains_little(fit: Fit, survey: Survey, settings: Settings) -> bool:
    """Whether most of a joint's torque is not what the fit makes it."""
    total = PredictionScore()
    for log in survey.logs:
        c, shift = torque_coefficients(fit, log.role), torque_shift(settings, fit)
        total += score(fit.shared.model, c, survey.segments(log), shift)
    predicted = prediction(total)
    return predicted is not None and bool(predicted.unexplained(MOST))


def with_endogeneity(fit: Fit, survey: Survey, settings: Settings, chosen: Selection) -> Fit:
    """The fit with the distance of instruments from least squares on its logs, if not yet known."""
    if fit.endogeneity is not None:
        return fit
    unloaded, loaded = passes(survey, settings)
    ours = weak_settings(settings, chosen)
    return replace(fit, endogeneity=instruments.endogeneity(unloaded, loaded, ours, fit))


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


def weak_settings(settings: Settings, chosen: Selection) -> weak.WeakSettings:
    """The settings of estimators for the chosen model."""
    ours = weak.WeakSettings(
        model=chosen.model,
        bandwidth=settings.bandwidth,
        shift=TorqueShift(chosen.hold == "zoh", settings.delay),
        estimate_delay=chosen.delay,
    )
    if settings.velocity == "measured" or settings.luenberger:
        ours = replace(ours, bandwidth=None)
    if settings.window is not None:
        ours = replace(ours, window=settings.window)
    return ours


def passes(
    survey: Survey,
    settings: Settings,
    watched: Callable[[LogSource, Pass], Iterator[Segment]] | None = None,
) -> tuple[list[Pass], list[Pass]]:
    """Callables, one per log, that give a fresh pass; unloaded and loaded logs apart.

    Each pass goes through `watched`, if given.

    Segments have velocities only where they are not observed on the way.
    """
    own = settings.velocity == "measured" or settings.luenberger

    def passed(log: LogSource) -> Pass:
        moving: Pass = partial(survey.segments, log)
        if own:
            moving = partial(with_velocities, survey, log, settings, luenberger=settings.luenberger)
        if watched is None:
            return moving
        return partial(watched, log, moving)

    return [passed(log) for log in survey.unloaded], [passed(log) for log in survey.loaded]


def _scored(
    model: Model,
    settings: Settings,
    sums: dict[LogSource, PredictionSums],
    log: LogSource,
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
