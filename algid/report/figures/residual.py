"""Spectrum of the residual beside the torque's own, and its autocorrelation."""

from __future__ import annotations

import numpy as np

from algid.arm import FloatArray
from algid.report.figures.base import Figure, Legend, Missing, Panel, axis, band, line, packed
from algid.report.series import TorqueLog
from algid.results import Result
from algid.signals.filters import LAGS

FEW_POWERS = 4
TITLE = "Residual: spectrum and whiteness"
LEGEND = (
    Legend("measured", "measured torque", "@measured"),
    Legend("residual", "residual", "@orange"),
    Legend("", "95 % band of white noise", "@blue/0.25", "area"),
)


def residual(found: TorqueLog, result: Result) -> Figure | Missing:
    """Spectra and autocorrelations a joint."""
    if not found.density.size:
        return Missing("residual", TITLE, "no stretch of the logs is long enough, or predicted without a gap")
    panels = tuple(panel for joint in (1, 2) for panel in (_spectrum(found, joint), _correlation(found, joint)))
    reading = (
        "Read: left, a flat orange line far below grey is noise and a hump is motion the model misses; "
        "right, bars inside the band are white."
    )
    return Figure("residual", TITLE, panels, reading, LEGEND, _note(result), columns=2)


def _spectrum(found: TorqueLog, joint: int) -> Panel:
    hover = "%{y:.3g} (N m)²/Hz at %{x:.3g} Hz<extra></extra>"
    traces = [
        line(found.frequency, found.density[joint - 1], "@measured", "measured", "measured", width=2, hover=hover),
        line(found.frequency, found.density[joint + 1], "@orange", "residual", "residual", hover=hover),
    ]
    layout = {
        "xaxis": axis("frequency, Hz", type="log", **_decades()),
        "yaxis": axis("(N m)²/Hz", type="log", tickfont={"size": 10}, **_powers(found.density[[joint - 1, joint + 1]])),
        "hovermode": "closest",
    }
    return Panel(
        traces,
        layout,
        f"Power spectral density of joint {joint}'s torque and residual",
        f"Joint {joint}: spectrum",
        260,
    )


def _powers(density: FloatArray) -> dict[str, object]:
    """Ticks at every other power of ten where there are many; plotly's own where there are few."""
    positive = density[density > 0]
    many = positive.size and positive.max() > 10.0**FEW_POWERS * positive.min()
    return {"dtick": 2} if many else {"nticks": 5}


def _decades() -> dict[str, object]:
    ticks = [0.1, 0.3, 1, 3, 10, 30, 100, 300, 1000]
    return {"tickvals": ticks, "ticktext": [f"{tick:g}" for tick in ticks]}


def _correlation(found: TorqueLog, joint: int) -> Panel:
    correlation = found.autocorrelation[joint - 1, 1:]
    limit = 1.96 / np.sqrt(max(found.independent, 1))
    reach = min(1.05, max(4 * limit, 1.15 * float(np.abs(correlation).max())))
    bars = {
        "type": "bar",
        "x": packed(np.arange(1, LAGS + 1, dtype=np.float64)),
        "y": packed(correlation),
        "marker": {"color": "@orange"},
        "name": "residual",
        "legendgroup": "residual",
        "hovertemplate": "%{y:.3f} at lag %{x}<extra></extra>",
    }
    layout = {
        "xaxis": axis("lag, samples", range=[0, LAGS + 0.7]),
        "yaxis": axis("correlation", range=[min(-2 * limit, 1.15 * float(correlation.min()), -0.1 * reach), reach]),
        "shapes": [band(-limit, limit, "@blue/0.25")],
        "bargap": 0.35,
    }
    says = f"Autocorrelation of joint {joint}'s residual; {correlation[0]:.2f} at lag one"
    return Panel([bars], layout, says, f"Joint {joint}: autocorrelation", 260)


def _note(result: Result) -> str:
    if result.fit is None or not result.fit.whiteness:
        return ""
    white = [name for name, test in result.fit.whiteness.items() if test.white]
    how = (
        "the intervals allow for that"
        if result.fit.intervals != "likelihood"
        else "the intervals do not allow for that"
    )
    if len(white) == len(result.fit.whiteness):
        return "The estimator's test finds the residual white."
    return f"The estimator's test finds the residual coloured; {how}."
