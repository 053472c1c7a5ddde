"""The estimator's residual: its spectrum and autocorrelation with white noise's band."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from algid.arm import FloatArray
from algid.errors import ResultError
from algid.report.figures.base import (
    Figure,
    Legend,
    Missing,
    Panel,
    Trace,
    axis,
    band,
    between,
    level,
    line,
)
from algid.report.reduce import LARGEST, table_of
from algid.results import Result

TITLE = "Innovations: what the estimator left"
WHITENED, SPECTRUM, TORQUE, CORRELATION = (
    "whitened spectrum",
    "spectrum",
    "torque spectrum",
    "autocorrelation",
)
COLUMNS = ("quantity", "joint", "x", "value", "low", "high")
FAINT = 0.02  # a correlation below which the estimator's test takes colour not to matter
HEIGHT = 260
_FEW_DECADES = 4
_LARGEST_RANGE = 1e12
MILLI = 0.5  # s: lags that end before are shown in milliseconds
WHITE_READING = (
    "Read: white noise leaves 19 of 20 points and bars inside the blue band; a hump in the "
    "spectrum is motion that the "
    "model misses, bars that start high and fall are an error slower than the sampling."
)
RAW_READING = (
    "Read: a flat orange line far below grey is noise and a hump is motion that the model misses; "
    "bars inside the blue "
    "band, one window apart, are white."
)
RESIDUAL = Legend("residual", "the estimator's residual", "@orange")
BAND = Legend("", "95 % band of white noise", "@blue/0.25", "area")


@dataclass(frozen=True, eq=False)
class Curve:
    """One quantity of one joint: axis, values, and white noise's 95 % band, or NaN."""

    x: FloatArray
    value: FloatArray
    low: FloatArray
    high: FloatArray

    @property
    def inside(self) -> int:
        """How many values lie within the band."""
        return int(np.count_nonzero((self.value >= self.low) & (self.value <= self.high)))


Curves = dict[tuple[str, int], Curve]


def innovations(path: Path, result: Result) -> Figure | Missing:
    """A spectrum and an autocorrelation a joint. Raises `ResultError`."""
    curves = read_curves(path)
    joints = [joint for joint in (1, 2) if (CORRELATION, joint) in curves]
    if not joints:
        return Missing("innovations", TITLE, "the logs are too short to tell noise from colour")
    whitened = any(quantity == WHITENED for quantity, _ in curves)
    panels = []
    for joint in joints:
        panels += [_spectrum(curves, joint), _correlation(curves, joint)]
    faint = any(_is_faint(curves[CORRELATION, joint]) for joint in joints)
    legend, reading = [RESIDUAL, BAND], WHITE_READING
    if not whitened:
        reading = RAW_READING
        legend.insert(1, Legend("torque", "measured torque, through the same windows", "@measured"))
    if faint:
        legend.append(
            Legend("", f"±{FAINT:g}: fainter colour moves no error bar", "@muted", "dash")
        )
    return Figure(
        "innovations",
        TITLE,
        tuple(panels),
        reading,
        tuple(legend),
        _note(curves, joints, result),
        columns=2,
    )


def read_curves(path: Path) -> Curves:
    """What `path` holds, by quantity and joint. Raises `ResultError`."""
    rows = table_of(path, COLUMNS, numbers=COLUMNS[1:])
    quantity = np.array(rows.pop("quantity"))
    numbers = {name: np.array(values, dtype=np.float64) for name, values in rows.items()}
    curves: Curves = {}
    for kind in dict.fromkeys(quantity.tolist()):
        for joint in (1, 2):
            own = (quantity == kind) & (numbers["joint"] == joint)
            if own.any():
                x, value, low, high = (numbers[name][own] for name in COLUMNS[2:])
                curves[kind, joint] = Curve(x, value, low, high)
                _check(path, kind, curves[kind, joint])
    return curves


def _check(path: Path, kind: str, curve: Curve) -> None:
    """Refuse a curve that no axis shows."""
    if not (curve.x[0] > 0 and curve.x[-1] <= LARGEST and np.all(np.diff(curve.x) > 0)):
        raise ResultError(
            f"{path}: column 'x' of its {kind}: expected rising numbers above 0; identify again "
            "with this version"
        )


def _spectrum(curves: Curves, joint: int) -> Panel:
    title, says = f"Joint {joint}: spectrum", f"Spectrum of joint {joint}'s residual"
    white = curves.get((WHITENED, joint))
    if white is not None:
        hover = "%{y:.3g} of white noise at %{x:.3g} Hz<extra></extra>"
        traces = list(between(white.x, white.low, white.high, "@blue/0.25"))
        traces.append(line(white.x, white.value, "@orange", "residual", "residual", hover=hover))
        y = axis("share of white noise", type="log", **_round_ticks(white))
        return Panel(
            traces, _layout(white.x, y), f"{says}; {_count(white)} inside the band", title, HEIGHT
        )
    hover = "%{y:.3g} (N m)²/Hz at %{x:.3g} Hz<extra></extra>"
    torque, own = curves.get((TORQUE, joint)), curves.get((SPECTRUM, joint))
    traces = list[Trace]()
    x: FloatArray = np.ones(1)
    density: FloatArray = np.empty(0)
    if torque is not None:
        density = torque.value
        traces.append(
            line(torque.x, torque.value, "@measured", "torque", "torque", width=2, hover=hover)
        )
    if own is not None:
        x, density = own.x, np.concatenate([density, own.value])
        traces.append(line(own.x, own.value, "@orange", "residual", "residual", hover=hover))
    positive = density[density > 0]
    ticks = {"nticks": 5}  # plotly's own where there are few powers of ten
    if positive.size and positive.max() > 1e4 * positive.min():
        ticks = {"dtick": 2}  # every other power of ten
    y = axis("(N m)²/Hz", type="log", tickfont={"size": 10}, **ticks)
    return Panel(traces, _layout(x, y), says, title, HEIGHT)


def _layout(x: FloatArray, y: dict[str, object]) -> dict[str, object]:
    ticks = [0.1, 0.3, 1, 3, 10, 30, 100, 300, 1000]
    shown = {"tickvals": ticks, "ticktext": [f"{tick:g}" for tick in ticks]}
    if x.size > 1:
        shown["range"] = [float(np.log10(x[0])), float(np.log10(x[-1]))]
    return {"xaxis": axis("frequency, Hz", type="log", **shown), "yaxis": y, "hovermode": "closest"}


def _round_ticks(white: Curve) -> dict[str, Any]:
    """Ticks and a range that holds the band and the values, in shares of white noise."""
    positive = white.value[white.value > 0]
    high = max(4.0, float(white.high.max()), float(white.value.max()))
    low = min(0.25, float(white.low.min()), float(positive.min(initial=0.25)))
    low = max(low, high / _LARGEST_RANGE)
    decades = np.log10(high / low)
    if decades > _FEW_DECADES:  # ticks of their own would stand on one another
        step = int(np.ceil(decades / _FEW_DECADES))
        first = step * int(np.floor(np.log10(low) / step))
        ticks = [10.0**power for power in range(first, int(np.ceil(np.log10(high))) + 1, step)]
    else:
        ticks = [0.001, 0.01, 0.1, 0.3, 1, 3, 10, 100, 1000, 10_000, 100_000]
    return {
        "tickvals": ticks,
        "ticktext": [f"{tick:,g}" for tick in ticks],
        "range": [float(np.log10(low)) - 0.05, float(np.log10(high)) + 0.05],
    }


def _correlation(curves: Curves, joint: int) -> Panel:
    curve = curves[CORRELATION, joint]
    scale, unit = (1e3, "ms") if curve.x[-1] <= MILLI else (1.0, "s")
    x = scale * curve.x
    stems = line(
        np.repeat(x, 3),
        np.stack([np.zeros(x.size), curve.value, np.full(x.size, np.nan)], axis=1).ravel(),
        "@orange",
        "residual",
        "residual",
        width=4,
        hover=f"%{{y:.3f}} at %{{x:.4g}} {unit}<extra></extra>",
    )
    half = 0.5 * float(x[0])
    shapes = []
    for at, low, high in zip(x, curve.low.tolist(), curve.high.tolist(), strict=True):
        step = {"xref": "x", "x0": float(at - half), "x1": float(at + half)}
        shapes.append(band(low, high, "@blue/0.25") | step)
    reach = max(float(np.abs(curve.value).max()), 2 * float(curve.high.max()))
    if _is_faint(curve):
        shapes += [level(-FAINT, "@muted", "dash", 1.0), level(FAINT, "@muted", "dash", 1.0)]
        reach = max(reach, FAINT)
    reach *= 1.15
    layout = {
        "xaxis": axis(f"lag, {unit}", range=[0.0, float(x[-1]) + 2 * half]),
        "yaxis": axis("correlation", range=[max(-reach, -1.05), min(reach, 1.05)]),
        "shapes": shapes,
        "hovermode": "closest",
    }
    says = f"Autocorrelation of joint {joint}'s residual; {_count(curve)} inside the band"
    return Panel([stems], layout, says, f"Joint {joint}: autocorrelation", HEIGHT)


def _is_faint(curve: Curve) -> bool:
    """Whether the band is so narrow that colour too faint to matter leaves it."""
    return bool(curve.x.size > 1 and float(np.abs(curve.high).max()) < FAINT)


def _count(curve: Curve) -> str:
    return f"{curve.inside} of {curve.x.size}"


def _note(curves: Curves, joints: list[int], result: Result) -> str:
    """How many values lie inside the bands, and what the estimator's own test says."""
    listed = " and ".join(_count(curves[CORRELATION, joint]) for joint in joints)
    note = f"Inside the band: {listed} correlations of joints 1 and 2"
    white = [_count(curves[WHITENED, joint]) for joint in joints if (WHITENED, joint) in curves]
    if white:
        note += f", {' and '.join(white)} frequencies"
    note += "."
    fit = result.fit
    if fit is None:
        return note
    allow = "the intervals allow for colour"
    if fit.intervals == "likelihood":
        allow = "the intervals do not allow for that"
    if not fit.whiteness:
        return f"{note} The {result.estimator} estimator takes no noise to be white: {allow}."
    if all(test.white for test in fit.whiteness.values()):
        return f"{note} The estimator's test finds no colour that would move an error bar."
    return f"{note} The estimator's test finds the residual coloured; {allow}."
