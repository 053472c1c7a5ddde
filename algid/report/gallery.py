"""Every figure of a result folder, in the page's order, or why it is missing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from algid.errors import ResultError
from algid.progress import Told
from algid.report.figures.base import Figure, Missing
from algid.report.figures.closeup import TITLE as CLOSEUP
from algid.report.figures.closeup import closeup
from algid.report.figures.convergence import convergence
from algid.report.figures.correlation import correlation
from algid.report.figures.coverage import coverage
from algid.report.figures.inertia import inertia
from algid.report.figures.information import TITLE as INFORMATION
from algid.report.figures.information import information
from algid.report.figures.innovations import TITLE as INNOVATIONS
from algid.report.figures.innovations import innovations
from algid.report.figures.running import TITLE as RUNNING
from algid.report.figures.running import running
from algid.report.figures.signals import signals
from algid.report.figures.torque import TITLE as TORQUE
from algid.report.figures.torque import torque
from algid.report.reduce import LARGEST
from algid.report.series import TorqueLog, read_torque
from algid.results import Estimate, Result


@dataclass(frozen=True)
class Gallery:
    """What the figures need of `torque.parquet`, where it can be read; the figures, those of the paper apart."""

    torque: TorqueLog | None
    figures: list[Figure | Missing]
    paper: list[Figure | Missing]

    @property
    def every(self) -> list[Figure | Missing]:
        """All figures, those of the paper last."""
        return [*self.figures, *self.paper]


def gallery(folder: Path, result: Result, told: Told | None = None) -> Gallery:
    """Every figure that the folder gives, in the page's order."""
    result = drawable(result)
    series, loaded, seconds, left, so_far = (
        folder / f"{name}.parquet" for name in ("estimates", "loaded", "information", "innovations", "running")
    )
    paper = [_try("convergence", "Convergence of the estimates", series, lambda: convergence(series, result))]
    figures: list[Figure | Missing] = []
    if loaded.is_file():
        paper.append(
            _try("loaded", "Convergence, loaded log", loaded, lambda: convergence(loaded, result, loaded=True))
        )
    measured = folder / "torque.parquet"
    found = _torque_log(measured, told)
    if isinstance(found, Missing):
        figures.append(found)
    else:
        figures.append(torque(found, result.logs))
        if found.reduced:
            figures.append(_try("closeup", CLOSEUP, measured, lambda: closeup(measured, found)))
    read = None if isinstance(found, Missing) else found
    figures.append(_try("innovations", INNOVATIONS, left, lambda: innovations(left, result)))
    figures.append(_try("running", RUNNING, so_far, lambda: running(so_far, result)))
    if read is not None:
        figures += [signals(read, result.logs), coverage(read)]
    figures.append(correlation(result))
    figures.append(_try("information", INFORMATION, seconds, lambda: information(seconds, result)))
    figures.append(inertia(result, read))
    return Gallery(read, figures, paper)


def drawable(result: Result) -> Result:
    """`result` without the numbers beyond `LARGEST`, which the tables show but no figure can."""

    def kept(found: Estimate) -> Estimate:
        numbers = (found.estimate, found.std, *(found.ci95 or ()))
        if all(number is None or abs(number) <= LARGEST for number in numbers):
            return found
        return found.model_copy(update={"estimate": None, "std": None, "ci95": None})

    groups = ("parameters", "loaded", "payload", "paper_payload")
    changed = {group: {name: kept(e) for name, e in getattr(result, group).items()} for group in groups}
    if result.fit is None:
        return result.model_copy(update=changed)
    covariance = [[None if v is None or abs(v) > LARGEST else v for v in row] for row in result.fit.covariance]
    return result.model_copy(update={**changed, "fit": result.fit.model_copy(update={"covariance": covariance})})


def _torque_log(path: Path, told: Told | None) -> TorqueLog | Missing:
    title = f"{TORQUE}, residual, coverage"
    if not path.is_file():
        return Missing("torque", title, _absent(path))
    try:
        return read_torque(path, told)
    except ResultError as error:
        return Missing("torque", title, str(error))


def _try(key: str, title: str, file: Path, make: Callable[[], Figure | Missing]) -> Figure | Missing:
    if not file.is_file():
        return Missing(key, title, _absent(file))
    try:
        return make()
    except ResultError as error:
        return Missing(key, title, str(error))


def _absent(path: Path) -> str:
    return f"{path.name} is not in this folder"
