"""Identify an arm and its payload from logs: the one way in for the command line, batches and notebooks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from algid.arm import CONSTANT_NAMES, FloatArray
from algid.errors import LogError, ResultError
from algid.identify.paper.method import SHORTEST
from algid.pipeline.folder import remove_stale, result_folder, whole_folder
from algid.pipeline.outcome import Outcome, result_of
from algid.pipeline.paper import run_paper
from algid.pipeline.series import write_fit_series
from algid.pipeline.settings import Settings
from algid.pipeline.sources import LogLike, LogSource, sources_of
from algid.results import Result, write_result
from algid.threads import one_blas_thread

if TYPE_CHECKING:
    from algid.profile import Profile

SERIES_SECONDS = 600.0  # the paper's convergence series is drawn beside other estimators up to this length of log


def identify(
    unloaded: LogLike | Iterable[LogLike] | None,
    loaded: LogLike | Iterable[LogLike] | None = None,
    settings: Settings | None = None,
    *,
    parameters: Result | None = None,
    profile: Profile | None = None,
    out: Path | None = None,
    name: str | None = None,
    force: bool = False,
    report: bool = True,
    command: str | None = None,
    shared_library: bool = False,
) -> Result:
    """Identify the constants k1 … k7 of an arm and, from loaded logs, its tip payload.

    Parameters
    ----------
    unloaded, loaded : path or `Log`, or several
        Logs of the arm without and with the payload.
    settings : Settings
    parameters : Result
        An arm identified before; then no unloaded log is needed.
    profile : Profile
        What the logs' names, units and signs mean.
    out : Path
        Folder to write into; None writes nothing.
    name : str
        Of the result folder, ``NAME.algid``; the stem of the first log by default.
    force : bool
        Replace a result that is there.
    report : bool
        Write time series and pages beside ``result.json``.
    command : str
        The command line behind the call, for the result.
    shared_library : bool
        Put the pages' plotting library once beside the result folders instead of into each page.

    Raises
    ------
    AlgidError
        If a log cannot be used, or nothing can be written.
    ValueError
        If there is neither an unloaded log nor `parameters`.
    """
    settings = settings or Settings()
    bare = sources_of(unloaded, "unloaded", profile, settings.gravity)
    burdened = sources_of(loaded, "loaded", profile, settings.gravity)
    if not bare and (parameters is None or not burdened):
        raise ValueError("an unloaded log is needed, or parameters and a loaded log")
    if out is None:
        return _identify(bare, burdened, settings, parameters, None, report)
    folder = result_folder((bare + burdened)[0].name, out) if name is None else out / f"{name}.algid"
    if name is None:  # a batch sweeps its whole output once
        remove_stale(folder)
    with whole_folder(folder, force) as temporary:
        result = _identify(bare, burdened, settings, parameters, temporary, report)
        if command is not None:
            result = result.model_copy(update={"settings": result.settings | {"command": command}})
        write_result(result, temporary / "result.json")
        if report:
            _write_pages(temporary, result, shared_library)
    return result


def _identify(
    bare: Sequence[LogSource],
    burdened: Sequence[LogSource],
    settings: Settings,
    parameters: Result | None,
    folder: Path | None,
    report: bool,
) -> Result:
    with one_blas_thread():
        if settings.estimator == "paper":
            return _by_the_paper(bare, burdened, settings, parameters, folder)
        return _by_likelihood(bare, burdened, settings, parameters, folder if report else None)


def _by_the_paper(
    bare: Sequence[LogSource],
    burdened: Sequence[LogSource],
    settings: Settings,
    parameters: Result | None,
    folder: Path | None,
) -> Result:
    if len(bare) > 1 or len(burdened) > 1:
        raise LogError(
            f"{(bare if len(bare) > 1 else burdened)[1].name}: the paper's method takes one log of each kind; "
            "give one, or use --estimator refined or weak"
        )
    first, second = _firsts(bare, burdened)
    known = None if parameters is None else known_constants(parameters)
    return result_of(run_paper(first, second, settings, known, folder), settings, [*bare, *burdened])


def _by_likelihood(
    bare: Sequence[LogSource],
    burdened: Sequence[LogSource],
    settings: Settings,
    parameters: Result | None,
    folder: Path | None,
) -> Result:
    from algid.pipeline.fitted import outcome_of
    from algid.pipeline.statistical import prior_of, run_fit

    prior = None if parameters is None else prior_of(parameters, settings)
    fit = run_fit(bare, burdened, settings, prior)
    outcome = outcome_of(fit, bare, burdened, settings)
    if folder is not None:
        write_fit_series(folder, fit, [*bare, *burdened], settings)
        if settings.estimator == "refined":
            outcome = _with_the_papers(outcome, bare, burdened, settings, folder)
    return result_of(outcome, settings, [*bare, *burdened])


def _with_the_papers(
    outcome: Outcome, bare: Sequence[LogSource], burdened: Sequence[LogSource], settings: Settings, folder: Path
) -> Outcome:
    """The paper's convergence series of the first log of each kind, and its route to the payload."""
    first, second = _firsts(bare, burdened)
    logs = [log for log in (first, second) if log is not None]
    durations = [log.summary().duration for log in logs]
    if first is None or settings.gravity == 0 or min(durations) < SHORTEST or max(durations) > SERIES_SECONDS:
        return outcome
    return replace(outcome, paper_payload=run_paper(first, second, settings, None, folder).payload)


def _firsts(bare: Sequence[LogSource], burdened: Sequence[LogSource]) -> tuple[LogSource | None, LogSource | None]:
    return bare[0] if bare else None, burdened[0] if burdened else None


def _write_pages(folder: Path, result: Result, shared_library: bool) -> None:
    from algid.report import markdown, write_report

    (folder / "report.md").write_text(markdown(result), encoding="utf-8")
    write_report(folder, shared_library)


def known_constants(parameters: Result) -> FloatArray:
    """k1 … k7 (7,) of an earlier result.

    Raises
    ------
    ResultError
        If one of them has no estimate.
    """
    values = [found.estimate if (found := parameters.parameters.get(name)) else None for name in CONSTANT_NAMES]
    if any(value is None for value in values):
        raise ResultError(
            f"{parameters.log.path}: its result lacks a constant; identify the arm from a better log first"
        )
    return np.array(values, dtype=np.float64)
