"""What the figures need of a convergence series, gathered in one pass of bounded memory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.report.blocks import Block, blocks, columns_of, row_count
from algid.report.reduce import MinMax, Share, Thinned, bucket_size

EPSILON = 0.2  # s: the paper's ε
WINDOW = 2.0  # s: after which the paper's integrals restart, unless its own settings say otherwise
LARGEST_CONDITION = 1e10  # beyond, the paper's stages call a system singular
POINTS = 2_000
STRETCHES = 400
SAMPLES = 20_000
MIDDLES = 500
NOT_SERIES = ("t", "condition", "k7_condition")

Series = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class SeriesLog:
    """Series by name: `lines` by their extremes, `samples` for their size, `middles` their running medians.

    `singular` is the share of samples that have no estimate, after ε, because the system was singular;
    `condition` is the condition number, infinite ones left out. `start`, `end` and `window` are in s.
    """

    start: float
    end: float
    window: float
    coarse: bool
    lines: dict[str, Series]
    samples: dict[str, FloatArray]
    middles: dict[str, Series]
    singular: dict[str, Series]
    condition: Series | None

    @property
    def windows(self) -> list[float]:
        """When each window starts, in s."""
        return [float(begin) for begin in np.arange(self.start, self.end, self.window)]

    @property
    def any_singular(self) -> bool:
        """Whether any series has a singular stretch."""
        return any(bool(share.any()) for _, share in self.singular.values())


def read_series(path: Path, settings: Mapping[str, Any]) -> SeriesLog:
    """Read `path`: a column ``t``, a column a series, perhaps ``condition``. Raises `ResultError`."""
    columns = columns_of(path)
    gathering = _Gathering([name for name in columns if name not in NOT_SERIES], row_count(path), settings)
    wanted = ["t", *gathering.names, *(name for name in ("condition", "k7_condition") if name in columns)]
    for block in blocks(path, wanted):
        gathering.take(block)
    return gathering.result("condition" in columns)


class _Gathering:
    def __init__(self, names: list[str], total: int, settings: Mapping[str, Any]) -> None:
        self.names = names
        self._total = total
        self._window = _positive(settings.get("window"), WINDOW) if settings.get("estimator") == "paper" else WINDOW
        self._start: float | None = None
        self._end = 0.0
        self._size = bucket_size(total, POINTS)
        self._lines = {name: MinMax(self._size) for name in names}
        self._singular = {name: Share(max(total // STRETCHES, 1)) for name in names}
        self._condition = MinMax(self._size)
        self._samples = Thinned(total // SAMPLES)

    def take(self, block: Block) -> None:
        """Add the next block."""
        t = block["t"]
        self._start = float(t[0]) if self._start is None else self._start
        self._end = float(t[-1])
        since = t - self._start
        # stamps are multiples of the period but for rounding, which must not move a window's first sample
        late = np.mod(since + 1e-9, self._window) >= EPSILON
        for name in self.names:
            self._lines[name].feed(t, block[name])
            self._singular[name].feed(t, late & np.isnan(block[name]) & _ill(block, name))
        if "condition" in block:
            self._condition.feed(t, np.where(np.isfinite(block["condition"]), block["condition"], np.nan))
        self._samples.feed(np.stack([t, *(block[name] for name in self.names)]))

    def result(self, with_condition: bool) -> SeriesLog:
        """What was gathered."""
        start = self._start or 0.0
        samples = self._samples.result(1 + len(self.names))
        named = dict(zip(self.names, samples[1:], strict=True))
        period = (self._end - start) / max(self._total - 1, 1)
        return SeriesLog(
            start=start,
            end=self._end,
            window=self._window,
            coarse=self._size * period >= EPSILON,
            lines={name: line.result() for name, line in self._lines.items()},
            samples=named,
            middles={name: _medians(samples[0], values) for name, values in named.items()},
            singular={name: share.result() for name, share in self._singular.items()},
            condition=self._condition.result() if with_condition else None,
        )


def _ill(block: Block, name: str) -> NDArray[np.bool_]:
    """Where the system of that series is singular; everywhere where the file does not tell."""
    conditions = ["condition", *(["k7_condition"] if name == "k7" else [])]
    known = [~(block[condition] <= LARGEST_CONDITION) for condition in conditions if condition in block]
    return np.logical_or.reduce(known) if known else np.ones(block["t"].size, dtype=bool)


def _medians(x: FloatArray, y: FloatArray) -> Series:
    """Medians of the finite samples in `MIDDLES` stretches, NaN where there are none."""
    size = max(x.size // MIDDLES, 1)
    whole = x.size - x.size % size
    stretches = np.sort(y[:whole].reshape(-1, size), axis=1)  # NaN goes last
    finite = np.isfinite(stretches).sum(axis=1)
    middle = stretches[np.arange(finite.size), np.maximum(finite - 1, 0) // 2]
    return x[:whole:size], middle


def _positive(value: object, otherwise: float) -> float:
    usable = isinstance(value, int | float) and not isinstance(value, bool) and value > 0
    return float(value) if usable else otherwise  # type: ignore[arg-type]
