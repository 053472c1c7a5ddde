"""Identify an arm and its payload from logs, for the command line, batches and notebooks."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from algid.arm import CONSTANT_NAMES
from algid.base.errors import LogError, SettingError
from algid.base.files import refuse_misleading, result_folder, whole_folder
from algid.base.progress import Progress
from algid.base.runtime import one_blas_thread
from algid.estimators.paper import SHORTEST
from algid.estimators.problem import TooShortError
from algid.identification.by_paper import run_paper
from algid.identification.known import (
    contradictions,
    read_otherwise,
    reused,
    torque_constants,
)
from algid.identification.outcome import judged
from algid.identification.recordings import (
    LogLike,
    Recordings,
    open_sources,
)
from algid.identification.series import residual_of, write_fit_series
from algid.methods import estimator_of, settles
from algid.model import Model
from algid.notices import flat
from algid.options import flag
from algid.physics.effort import absent
from algid.profile import Profile
from algid.results import Result, read_result, write_result
from algid.settings import DEFAULTS, OF_BOTH, OF_PRIOR, Settings

if TYPE_CHECKING:
    from algid.notices import Notice

# the paper's convergence series is drawn beside other estimators up to this length of log
SERIES_SECONDS = 600.0


class Earlier(NamedTuple):
    """A result to start from, and what to call it where it is wrong: its file, or its log."""

    result: Result
    file: str

    @classmethod
    def of(cls, parameters: Result | str | Path | None) -> Earlier | None:
        """The result itself, or that of a file."""
        if parameters is None:
            return None
        if isinstance(parameters, Result):
            return cls(parameters, parameters.log.path)
        return cls(read_result(parameters), str(parameters))


def identify(
    unloaded: LogLike | Iterable[LogLike] | None,
    loaded: LogLike | Iterable[LogLike] | None = None,
    settings: Settings | None = None,
    *,
    parameters: Result | str | Path | None = None,
    profile: Profile | None = None,
    out: str | Path | None = None,
    name: str | None = None,
    force: bool = False,
    report: bool = True,
    export: bool = False,
    command: str | None = None,
    shared_library: bool = False,
    progress: Progress | None = None,
) -> Result:
    """Identify the constants k1 … k7 of an arm and, from loaded logs, its tip payload.

    Parameters
    ----------
    unloaded, loaded : path, `Log`, pandas or polars frame, or dict of arrays; or several
        Logs of the arm without and with the payload. The columns of frames and dicts are found by
        their names and by `profile`, as those of a file.
    settings : Settings
    parameters : Result or path of one
        An arm identified before; then no unloaded log is needed.
    profile : Profile
        What the logs' names, units and signs mean; where it is silent, what was said of the
        earlier result's logs.
    out : Path
        Folder to write into; None writes nothing.
    name : str
        Of the result folder, ``NAME.algid``; the stem of the first log by default.
    force : bool
        Replace a result that is there.
    report : bool
        Write time series and pages beside ``result.json``.
    export : bool
        Write ``estimates.mcap`` beside them: see `algid.report.export`.
    command : str
        The command line behind the call, for the result.
    shared_library : bool
        Put the pages' plotting library once beside the result folders instead of into each page.
    progress : callable
        Called with the stage and how many samples of how many it has gone over, as the work goes
        on.

    Returns
    -------
    Result
        Each estimate with standard deviation, 95 % interval, unit and status; what is not
        identifiable says so.

    Raises
    ------
    AlgidError
        If a log cannot be used, or nothing can be written.
    SettingError
        If a setting is not known or wrong, there is neither an unloaded log nor `parameters`, or
        logs are to be cross-validated of which there is one alone.
    """
    refuse_misleading(name)
    earlier = Earlier.of(parameters)
    meaning = profile or Profile()
    if earlier is not None:
        meaning = reused(profile, earlier.result, earlier.file)
    stated = meaning.model_dump(mode="json", exclude_unset=True)
    settings = _with_meaning(settings or Settings(), meaning, earlier)
    sources = open_sources(unloaded, loaded, meaning)
    survey = Recordings(sources, progress, settings.gravity, settings.effort)
    usable = survey.unloaded
    if settings.effort == "external":  # which has nothing of the arm
        usable = survey.loaded
    elif earlier is not None:
        usable = list(survey.logs)
    if not usable:
        alone = "none" if not survey.logs else f"{survey.logs[0].role} ones alone"
        raise SettingError(
            f"identify: expected an unloaded log, or a loaded one with {flag('parameters')} or "
            f"{flag('effort')} external, found {alone}"
        )
    survey.count_once()
    for logs in (survey.unloaded, survey.loaded):
        if settings.cross_validate and len(logs) == 1:
            raise SettingError(
                f"{flag('cross_validate')}: expected two {logs[0].role} logs or more, found one; "
                "give more, or leave it out"
            )
    if out is None:
        return _identified(survey, settings, earlier, stated)
    folder = result_folder(sources[0].name, Path(out), name)
    with whole_folder(folder, force) as temporary:
        result = _identified(survey, settings, earlier, stated, temporary, series=report)
        if command is not None:
            result = result.model_copy(update={"settings": result.settings | {"command": command}})
        write_result(result, temporary / "result.json")
        if report:
            from algid.report.page import write_pages

            if progress is not None:
                progress("report", 0, 0)
            write_pages(temporary, shared_library, progress)
        if export:
            from algid.report.export import export_mcap

            export_mcap(temporary, progress)
    return result


def _with_meaning(settings: Settings, meaning: Profile, earlier: Earlier | None) -> Settings:
    """The settings, completed from the profile or an earlier result where they are not set."""
    names = set(OF_BOTH) if earlier is not None else {*OF_BOTH, *OF_PRIOR}
    if earlier is not None and settings.prior is not None:
        raise SettingError(
            f"{flag('prior')}: the arm is known by {flag('parameters')}; leave one of them out"
        )
    changes = {}
    for name in names & meaning.model_fields_set:
        if getattr(settings, name) == DEFAULTS[name]:
            changes[name] = getattr(meaning, name)
    settings = settings.but(**changes)
    if settings.prior_error is not None and settings.prior is None:
        raise SettingError(
            f"{flag('prior_error')}: expected a prior that errs by as much, found none; give "
            f"{flag('prior')}"
        )
    return settings


def _identified(
    survey: Recordings,
    settings: Settings,
    earlier: Earlier | None,
    stated: dict[str, Any],
    folder: Path | None = None,
    *,
    series: bool = False,
) -> Result:
    """The result with what the user `stated`, and warnings of logs read differently now.

    Time series go into `folder`: the paper's always, those of a likelihood where `series` asks for
    them.

    Raises
    ------
    LogError
        If no log is long enough.
    """
    with one_blas_thread():
        if settles(settings.estimator):
            known = None
            if earlier is not None:
                known = torque_constants(earlier.result, Model(), "unloaded", earlier.file)
            result = run_paper(survey, settings, known, folder)
        else:
            try:
                result = _by_likelihood(
                    survey, settings, earlier, stated, folder if series else None
                )
            except TooShortError as error:
                names = ", ".join(log.name for log in survey.logs)
                raise LogError(f"{names}: {error}; record longer") from error
        result = judged(result, survey)
    notices = result.notices
    if earlier is not None:
        of_logs = read_otherwise(result.logs, earlier.result, earlier.file)
        notices = [*of_logs, *contradictions(earlier.result, settings.lengths), *notices]
    return result.model_copy(update={"profile": stated, "notices": notices})


def _by_likelihood(
    survey: Recordings,
    settings: Settings,
    earlier: Earlier | None,
    stated: dict[str, Any],
    folder: Path | None,
) -> Result:
    """The result of the logs, its settings with the effort that they show."""
    from algid.identification.by_likelihood import run_fit
    from algid.identification.checks import by_free_lengths, doubted, of_effort, turn_note
    from algid.identification.outcome import outcome_of
    from algid.identification.prior import statement_of, with_prior

    said, known = statement_of(settings), earlier or ()
    # the terms that the logs choose, their fit, and what makes it doubtful
    first = run_fit(survey, settings, *known)
    found = doubted(first)
    # the effort that it shows, and the fit of that; of constants in doubt no weight is missed
    of_driver: list[Notice] = []
    if found is first:
        shown, of_driver = of_effort(found.fit, settings)
        if shown != settings:
            found = doubted(run_fit(survey, shown, *known))
    found = by_free_lengths(found)
    # what CAD or an earlier result says beside the logs
    if said is not None:
        found = replace(found, fit=with_prior(found.fit, said))
    # the estimates, their statuses, and how well they predict
    survey.begin("prediction")
    result = outcome_of(found)
    # gravity that is turned against θ1, unless the caller, or the log itself, says its zero
    log, notices = survey.logs[0], result.notices + of_driver
    reading = log.origin.reading
    said_of_zero = {"zero", "offsets", "theta1.offset"}.intersection(flat(stated))
    plain = reading.zero == "horizontal" and reading.offsets[0] == 0
    if earlier is None and plain and not said_of_zero:
        notices = [*turn_note(found.fit, log), *notices]
    result = result.model_copy(update={"notices": notices})
    if folder is None:
        return result
    # what is drawn over time
    survey.begin("series")
    write_fit_series(folder, found, residual_of(found))
    # beside them the paper's series of the first log of each kind, and its payload route
    logs = [*survey.unloaded[:1], *survey.loaded[:1]]
    if (
        estimator_of(settings.estimator).beside_paper
        and survey.unloaded
        and found.settings.gravity
        and not absent(found.settings.effort, CONSTANT_NAMES)
        and all(SHORTEST <= one.duration <= SERIES_SECONDS for one in logs)
    ):
        survey.begin("series", logs)
        by_paper = run_paper(survey, found.settings, None, folder)
        result = result.model_copy(update={"paper_payload": by_paper.payload})
    return result
