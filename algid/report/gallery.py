"""Every figure of a result folder, in the page's order, or why it is missing."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from algid.errors import ResultError
from algid.methods import settles
from algid.progress import Progress
from algid.report.figures.base import Figure, Missing
from algid.report.figures.convergence import LOADED, convergence
from algid.report.figures.convergence import TITLE as CONVERGENCE
from algid.report.figures.correlation import correlation
from algid.report.figures.coverage import coverage
from algid.report.figures.inertia import inertia
from algid.report.figures.information import TITLE as INFORMATION
from algid.report.figures.information import information
from algid.report.figures.innovations import TITLE as INNOVATIONS
from algid.report.figures.innovations import innovations
from algid.report.figures.running import TITLE as RUNNING
from algid.report.figures.running import running
from algid.report.figures.torque import CLOSEUP, Scored, closeup, signals, torque
from algid.report.figures.torque import TITLE as TORQUE
from algid.report.reduce import LARGEST
from algid.report.series import TorqueLog, read_scored, read_torque
from algid.results import Estimate, Result

T = TypeVar("T")


@dataclass(frozen=True)
class Gallery:
    """What the figures need of `torque.parquet`, where it can be read.

    The figures, those of the paper apart.
    """

    torque: TorqueLog | None
    figures: list[Figure | Missing]
    paper: list[Figure | Missing]

    @property
    def every(self) -> list[Figure | Missing]:
        """All figures, those of the paper last."""
        return self.figures + self.paper


def gallery(folder: Path, result: Result, progress: Progress | None = None) -> Gallery:
    """Every figure that the folder gives, in the page's order."""
    result = drawable(result)
    estimates, loaded, torques, left, so_far, seconds = (
        folder / f"{name}.parquet"
        for name in ("estimates", "loaded", "torque", "innovations", "running", "information")
    )
    scored = folder / "scored.parquet"
    measured = _try(
        "torque", f"{TORQUE}, residual, coverage", torques, lambda: read_torque(torques, progress)
    )
    read = None if isinstance(measured, Missing) else measured
    figures: list[Figure | Missing] = []
    if isinstance(measured, Missing):
        figures.append(measured)
    else:
        figures.append(
            _try(
                "torque",
                f"{TORQUE}, residual",
                torques,
                lambda: torque(
                    measured, result.logs, _scored(scored, result, measured.ranges.keys())
                ),
            )
        )
        if measured.reduced:
            figures.append(
                _try("closeup", CLOSEUP, torques, lambda: closeup(torques, measured, result.logs))
            )
    figures.append(_try("innovations", INNOVATIONS, left, lambda: innovations(left, result)))
    figures.append(_try("running", RUNNING, so_far, lambda: running(so_far, result)))
    if read is not None:
        figures += [signals(read, result.logs), coverage(read)]
    figures.append(correlation(result))
    figures.append(_try("information", INFORMATION, seconds, lambda: information(seconds, result)))
    figures.append(inertia(result, read))
    paper = [_try("convergence", CONVERGENCE, estimates, lambda: convergence(estimates, result))]
    if loaded.is_file():
        paper.append(
            _try("loaded", LOADED, loaded, lambda: convergence(loaded, result, loaded=True))
        )
    if settles(result.estimator):  # which has no residual, no intervals and nothing of them
        figures = [one for one in figures if not _is_absent(one)]
    return Gallery(read, figures, paper)


def _is_absent(figure: Figure | Missing) -> bool:
    return isinstance(figure, Missing) and figure.absent


def _scored(path: Path, result: Result, logs: Collection[int]) -> Scored | None:
    """The torque that is scored.

    None of a result that scores none, or one of an earlier version.

    Raises
    ------
    ResultError
        If `path` cannot be read, or holds others than these logs.
    """
    if result.fit is None or result.fit.residual is None or not path.is_file():
        return None
    series = read_scored(path)
    if others := sorted(series.keys() - logs):
        raise ResultError(
            f"{path}: expected the logs of torque.parquet, found log {others[0]}; identify again"
        )
    return Scored(series, result.fit.residual)


def drawable(result: Result) -> Result:
    """`result` without the numbers beyond `LARGEST`, which the tables show but no figure can."""
    changed: dict[str, Any] = {}
    for group in ("parameters", "loaded", "payload", "paper_payload"):
        estimates = getattr(result, group)
        changed[group] = {name: _drawable(one) for name, one in estimates.items()}
    if result.fit is not None:
        covariance = []
        for row in result.fit.covariance:
            covariance.append([value if _fits(value) else None for value in row])
        changed["fit"] = result.fit.model_copy(update={"covariance": covariance})
    return result.model_copy(update=changed)


def _drawable(found: Estimate) -> Estimate:
    """The estimate, without numbers where one of them cannot be drawn."""
    low, high = found.ci95 or (None, None)
    if all(map(_fits, (found.estimate, found.std, low, high))):
        return found
    return found.model_copy(update={"estimate": None, "std": None, "ci95": None})


def _fits(value: float | None) -> bool:
    """Whether a number, where there is one, can be drawn."""
    return value is None or abs(value) <= LARGEST


def _try(key: str, title: str, file: Path, make: Callable[[], T]) -> T | Missing:
    """What `make` gives, or why the file does not give it."""
    if not file.is_file():
        return Missing(key, title, f"{file.name} is not in this folder", absent=True)
    try:
        return make()
    except ResultError as error:
        return Missing(key, title, str(error))
