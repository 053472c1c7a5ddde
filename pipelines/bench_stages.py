"""Where the weak estimator's time goes: each stage run on top of the ones before it, in one
process.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from pathlib import Path
from statistics import median

from algid.base.runtime import one_blas_thread
from algid.estimators.prediction import PredictionSums
from algid.estimators.weak import WeakSettings, fit, normal_equations
from algid.identification.identify import identify
from algid.readers import open_log
from algid.settings import Settings
from algid.signals.segments import Segment, segments

_TIMES = 5


def stages(path: Path) -> str:
    """Markdown table of processor seconds by stage on a log of a million samples."""
    held = list(segments(open_log(path).blocks()))
    settings = WeakSettings(bandwidth=60.0)
    with one_blas_thread():
        read = _seconds(lambda: sum(len(block) for block in open_log(path).blocks()))
        sampled = _seconds(lambda: sum(map(len, segments(open_log(path).blocks()))))
        equations = _seconds(lambda: normal_equations(lambda: held, settings))
        solved = _seconds(lambda: fit([lambda: held], (), settings))
        predicted = _seconds(lambda: _predict(held, settings))
        whole = _seconds(
            lambda: identify(path, settings=Settings(estimator="weak", model="plain"), report=False)
        )
    lines = [
        ("reading in blocks", read),
        ("uniform segments", sampled - read),
        ("normal equations of the weak form", equations),
        ("solution and error bars", solved - equations),
        ("sums behind the prediction's score", predicted),
        ("checks, endogeneity, hash, result", whole - sampled - solved - predicted),
        ("all of it, warm", whole),
    ]
    table = "\n".join(f"| {name} | {1e3 * seconds:.0f} |" for name, seconds in lines)
    return f"\n| stage of weak, 1,000,000 samples | processor ms |\n|---|---|\n{table}\n"


def _predict(held: Iterable[Segment], settings: WeakSettings) -> None:
    sums = PredictionSums(settings.model)
    for segment in held:
        sums.push(segment)
    sums.finish()


def _seconds(work: Callable[[], object]) -> float:
    found = []
    for _ in range(_TIMES):
        start = time.process_time()
        work()
        found.append(time.process_time() - start)
    return median(found)
