"""The figures of an identification's page, each drawn from its file of the result's folder.

A function gives None where there is nothing to draw, and raises `ResultError` for a file that is
damaged.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from algid.arm import FloatArray, mass_matrix
from algid.base.quantiles import median, quantile
from algid.base.text import file_name, joined, significant, unit_text
from algid.model import K1, K3, K5
from algid.report.plot import BLUE, GREEN, GREY, ORANGE, Panels, Plot, names_down
from algid.report.series import POINTS, Drawn, between, drawn, table
from algid.results import Estimate, Result
from algid.results.rows import known_truth

MOST_CELLS = 600
MOST_WRITTEN = 14
HALF = 0.5  # s before and after the worst moment
USUAL = 4.0  # of the median interval: wider ones leave the frame, and do not hide the others
WIDEST = 100.0  # percent: an interval beyond holds zero
CLEAR, STRONGLY = "rgba(59,130,196,0)", "rgba(59,130,196,.75)"


def figures(folder: Path, result: Result, raw: Drawn | None) -> list[Plot]:
    """Every figure that the folder gives, in the page's order; `raw` are the torque's samples."""
    made: list[Plot | None] = []
    if raw is not None:
        made += [torque(folder, result, raw), closeup(folder, result, raw)]
    made += [residual(folder), running(folder, result)]
    if raw is not None:
        made += [signals(result, raw), coverage(raw)]
    made += [correlation(result), information(folder), inertia(result, raw)]
    return [plot for plot in made if plot is not None]


def figures_of_paper(folder: Path, result: Result) -> list[Plot]:
    """The convergence of the paper's estimates, where it was written."""
    loaded = result.payload | result.paper_payload | result.loaded
    every = {"estimates": result.parameters, "loaded": loaded}
    made = [convergence(folder, result, name, known) for name, known in every.items()]
    return [plot for plot in made if plot is not None]


def _name_logs(panels: Panels, result: Result, rows: Drawn, count: int) -> None:
    """Draw a line where each of several logs begins, and its name in the first panel."""
    starts = rows.starts
    for log, x in starts.items() if len(starts) > 1 else ():
        for place in range(count):
            panels.line(place, x=x, dash="dot")
        if len(starts) <= 6:  # more names would stand on one another
            panels.text(0, file_name(result.logs[log].path), x)


def _prediction(panels: Panels, places: Sequence[int], x: FloatArray, of: Any, joint: int) -> None:
    """Measured and predicted torque of a joint and what is left, each in its panel."""
    tau, predicted = of[f"tau{joint}"], of[f"tau{joint}_predicted"]
    panels.curve(places[0], x, tau, "measured", GREY, 3.6)
    panels.curve(places[1], x, predicted, "predicted by the model", BLUE)
    panels.curve(places[2], x, of[f"residual{joint}"], "residual", ORANGE)


def torque(folder: Path, result: Result, raw: Drawn) -> Plot:
    """Measured and predicted torque as scored, with the residual as recorded beside."""
    titles = ("Joint 1: torque, N m", "residual, N m", "Joint 2: torque, N m", "residual, N m")
    panels, band = Panels(titles, height=190, together=True), ""
    shown = drawn(folder / "scored.parquet", POINTS // 2) or raw
    for place, joint in ((0, 1), (2, 2)):
        if shown is not raw:
            recorded = raw["x"], raw[f"residual{joint}"], "residual as recorded"
            panels.curve(place + 1, *recorded, "#e3a46f", 0.8, visible="legendonly")
        _prediction(panels, (place, place, place + 1), shown["x"], shown, joint)
    panels.axes(3, "time, s")
    _name_logs(panels, result, shown, 4)
    if result.fit is not None and result.fit.prediction is not None:
        band = result.fit.prediction.band
    reading = "Blue should cover grey; orange should look like noise, with no trace of the motion."
    return Plot("torque", f"Measured and predicted torque{band}", panels, reading)


def closeup(folder: Path, result: Result, raw: Drawn) -> Plot | None:
    """One second about the largest residual of each joint, every sample."""
    titles, parts = [], []
    for joint, (size, t, log) in enumerate(raw.worst, start=1):
        if size > 0:
            parts.append((joint, between(folder / "torque.parquet", log, t - HALF, t + HALF)))
            of = f" of {file_name(result.logs[log].path)}" if len(raw.starts) > 1 else ""
            titles.append(f"Joint {joint}: {significant(size, 3)} N m at {t:.3f} s{of}")
    if not parts:
        return None
    panels = Panels(titles, 2)
    for place, (joint, rows) in enumerate(parts):
        _prediction(panels, [place] * 3, rows["t"], rows, joint)
        panels.axes(place, "time, s", "N m")
    reading = (
        "A residual that stands out once is an event, such as a knock; one like the rest is "
        "the model's limit."
    )
    return Plot("closeup", "The largest residual, every sample", panels, reading)


def residual(folder: Path) -> Plot | None:
    """Spectrum and autocorrelation of the residual, with the 95 % band of white noise."""
    rows = table(folder / "innovations.parquet")
    kinds = sorted(set(rows["quantity"]) - {"torque spectrum"}, reverse=True) if rows else []
    if "autocorrelation" not in kinds:
        return None
    each = [(joint, kind) for joint in (1, 2) for kind in kinds]
    panels, inside = Panels([f"Joint {j}: {kind}" for j, kind in each], len(kinds)), []

    def curve(kind: str, joint: int) -> list[FloatArray]:
        own = (rows["quantity"] == kind) & (rows["joint"] == joint)
        return [rows[name][own].astype(np.float64) for name in ("x", "value", "low", "high")]

    for place, (joint, kind) in enumerate(each):
        x, y, low, high = curve(kind, joint)
        panels.band(place, x, low, high, "95 % band of white noise")
        if kind == "autocorrelation":
            stems = np.stack([0 * y, y, np.nan * y], axis=1).ravel()
            panels.curve(place, np.repeat(x, 3), stems, "residual", ORANGE, 4)
            panels.axes(place, "lag, s")
            inside.append(f"{np.count_nonzero((y >= low) & (y <= high))} of {y.size}")
            continue
        measured = curve("torque spectrum", joint)
        if measured[0].size:
            panels.curve(place, measured[0], measured[1], "measured torque", GREY, 2)
        panels.curve(place, x, y, "residual", ORANGE)
        unit = "share of white noise" if np.isfinite(low).any() else "(N m)²/Hz"
        frequency = {"type": "log", "dtick": 1, "title": {"text": "frequency, Hz"}}
        panels.axes(place, frequency, {"type": "log", "nticks": 5, "title": {"text": unit}})
    note = f"Correlations of joints 1 and 2 inside the band: {joined(inside)}."
    reading = (
        "Of white noise 19 of 20 values lie in the blue band; a hump in the spectrum is motion "
        "that the model misses, bars that start high and fall are slow errors."
    )
    return Plot("residual", "Residuals: spectrum and autocorrelation", panels, reading, note)


def running(folder: Path, result: Result) -> Plot | None:
    """What the estimator had found by each moment, and its 95 % band."""
    rows = drawn(folder / "running.parquet", 10_000)
    if rows is None:
        return None
    names = []
    for name in result.estimates:
        if f"{name}_half" in rows.columns and np.isfinite(rows[name]).any():
            names.append(name)
    titles = [f"{name}, {unit_text(result.estimates[name].unit)}" for name in names]
    panels, x = Panels(titles, 2, 210, together=True), rows["x"]
    for place, name in enumerate(names):
        value, half = rows[name], rows[f"{name}_half"]
        panels.band(place, x, value - half, value + half, "its 95 % interval")
        panels.curve(place, x, value, "estimate from all samples so far")
        final = float(value[np.isfinite(value)][-1])
        panels.line(place, y=final)
        sure = half[np.isfinite(half)]
        if sure.size:  # most of the way, and the final interval several times over
            reach = max(4 * float(sure[-1]), 2 * float(median(sure.tolist())))
            panels.axes(place, y={"range": [final - reach, final + reach]})
    _name_logs(panels, result, rows, len(names))
    reading = (
        "The band must shrink and the line stay inside what the band was before; a line that "
        "leaves it late shows a part of the logs that contradicts the rest."
    )
    return Plot("running", "Running estimate", panels, reading) if names else None


def signals(result: Result, raw: Drawn) -> Plot:
    """Angles, velocities and torques of all logs."""
    titles = ("Angle, rad", "Velocity, rad/s", "Measured torque, N m")
    panels = Panels(titles, height=200, together=True)
    for place, name in enumerate(("theta", "omega", "tau")):
        for joint, colour, dash in ((1, BLUE, "solid"), (2, ORANGE, "5px,2px")):
            y = raw[f"{name}{joint}"]
            panels.curve(place, raw["x"], y, f"joint {joint}", colour, 1.2, dash)
    panels.axes(2, "time, s")
    _name_logs(panels, result, raw, 3)
    reading = "Look for jumps, flat stretches and clipped tops."
    return Plot("signals", "Signals", panels, reading)


def coverage(raw: Drawn) -> Plot:
    """Where the motion went: angles and speeds."""
    panels = Panels(("Angles, °", "Speeds, rad/s"), 2, 320)
    for place, (name, scale) in enumerate((("theta", 180 / np.pi), ("omega", 1.0))):
        x, y = scale * raw.samples[f"{name}1"], scale * raw.samples[f"{name}2"]
        panels.dots(place, x, y, "samples", BLUE, 4, opacity=0.5)
        panels.axes(place, "joint 1", "joint 2")
    reading = (
        "Dots spread over both planes inform; a line or a spot leaves parameters tied to each "
        "other."
    )
    return Plot("coverage", "Coverage of the motion", panels, reading)


def correlation(result: Result) -> Plot | None:
    """Which estimates err together; what is not identifiable has no correlation."""
    names = result.fit.covariance_names if result.fit is not None else []
    if not names:
        return None
    C = result.covariance
    scale = np.sqrt(np.where(np.diag(C) > 0, np.diag(C), np.nan))
    R = C / np.outer(scale, scale)
    panels = Panels([""])
    orange = [[0, "rgba(217,119,43,.5)"], [0.5, "rgba(217,119,43,0)"]]
    shades = [*orange, [0.5, CLEAR], [1, "rgba(59,130,196,.5)"]]  # pale enough to write on
    numbers = {"texttemplate": "%{z:.2f}"} if len(names) <= MOST_WRITTEN else {}
    panels.heat(names, list(names), R, zmin=-1, zmax=1, colorscale=shades, xgap=3, **numbers)
    reading = "Two estimates of a strong colour err together: trust their combination first."
    return Plot("correlation", "Correlation of the estimates", panels, reading)


def information(folder: Path) -> Plot | None:
    """Which seconds determine each parameter."""
    rows = table(folder / "information.parquet")
    names = [name for name in rows if name not in ("log", "t")]
    if not names or not rows["t"].size:
        return None
    gained = np.nan_to_num(np.stack([rows[name].astype(np.float64) for name in names]))
    return shares_of_time(names, gained, 1.0)


def inertia(result: Result, raw: Drawn | None) -> Plot | None:
    """M11, M12 and M22 over one turn of joint 2, with their 95 % bands."""
    names, known = (K1, K3, K5), result.parameters.items()
    k = [one.estimate for name, one in known if name in names and one.estimate is not None]
    if len(k) < len(names):
        return None
    theta2 = np.linspace(-np.pi, np.pi, 181)
    # M is linear in the constants: unit vectors give its derivatives (3, 3, n)
    units, angles = np.zeros((3, 7)), np.stack([0 * theta2, theta2])
    units[range(3), (0, 2, 4)] = 1
    slopes = np.stack([np.stack(mass_matrix(unit, angles)) for unit in units])
    m = np.einsum("i,ipn->pn", np.array(k), slopes)
    C = np.full((3, 3), np.nan) if result.fit is None else result.fit.covariance_of(names)
    variance = np.einsum("ipn,ij,jpn->pn", slopes, C, slopes)
    half = result.quantile * np.sqrt(np.maximum(variance, 0))
    panels, degrees = Panels(["kg m² over θ2"], height=320), np.degrees(theta2)
    looks = (("M11", BLUE, "solid"), ("M12 = M21", ORANGE, "dash"), ("M22", GREEN, "dot"))
    for place, (name, colour, dash) in enumerate(looks):
        panels.band(0, degrees, m[place] - half[place], m[place] + half[place], "95 % interval")
        panels.curve(0, degrees, m[place], name, colour, 2, dash)
    if raw is not None:
        reached = np.degrees(raw["theta2"])
        panels.stretch(0, max(np.nanmin(reached), -180.0), min(np.nanmax(reached), 180.0))
    panels.axes(0, {"range": [-180, 180], "dtick": 45, "title": {"text": "θ2, °"}})
    smallest = float((0.5 * (m[0] + m[2]) - np.hypot(0.5 * (m[0] - m[2]), m[1])).min())
    note = f"The smallest eigenvalue of M is {significant(smallest, 3)} kg m²."
    reading = "M11 and M22 must stay above zero; outside the grey stretch the curves extrapolate."
    return Plot("inertia", "Mass matrix M(θ)", panels, reading, note)


def convergence(
    folder: Path, result: Result, name: str, known: Mapping[str, Estimate]
) -> Plot | None:
    """The paper's Figure 2: each estimate over time, with final value, interval and truth."""
    rows, truth = drawn(folder / f"{name}.parquet", POINTS // 2), known_truth(result)
    if rows is None:
        return None
    names = [one for one in rows.columns if one not in ("log", "t", "x", "k7_condition")]
    panels = Panels(names, 2, 220, together=True)
    for place, one in enumerate(names):
        series = np.where(np.isfinite(rows[one]), rows[one], np.nan)
        panels.curve(place, rows["x"], series, "the paper's estimate over time", width=1.2)
        finite = series[np.isfinite(series)]
        if one == "condition":
            panels.axes(place, y={"type": "log"})
        elif finite.size:
            # spikes near singular instants start outside the view
            ends = [quantile(finite[finite.size // 4 :], share) for share in (0.04, 0.96)]
            final = known[one].estimate if one in known else None
            for value, colour, dash in (
                (final, GREEN, "solid"), (truth.get(one), ORANGE, "dash")
            ):  # fmt: skip
                if value is not None:
                    ends.append(value)
                    panels.line(place, y=value, colour=colour, dash=dash)
            space = 0.25 * (max(ends) - min(ends)) or 0.05 * abs(ends[0]) or 1.0
            panels.axes(place, y={"range": [min(ends) - space, max(ends) + space]})
    reading = (
        "From ε = 0.2 s on, blue should settle on the green line, the result; the dashed line "
        "is the truth. Double-click shows the spikes that the frame cuts off."
    )
    title = "Convergence of the estimates (the paper's Figure 2)"
    if name == "loaded":
        title = "Convergence, loaded log"
    return Plot(name, title, panels, reading)


def intervals(result: Result) -> Plot:
    """Every estimate's 95 % interval in percent of the estimate, each log's own, and the truth."""
    known = {}
    for name, one in (result.parameters | result.payload).items():
        if one.estimate and one.half is not None:
            known[name] = one.estimate, 100 * one.half / abs(one.estimate)
    names, shares = list(known), [share for _, share in known.values()]
    widest = min(max(shares, default=1.0), USUAL * median(shares or [1.0]), WIDEST)
    panels = Panels(["95 % interval, % of the estimate"], height=60 + 20 * len(names))
    bars = {"type": "data", "array": shares, "color": BLUE, "thickness": 2.5, "width": 0}
    panels.dots(0, [0.0] * len(names), names, "estimate with its interval", error_x=bars)
    by_log = []
    if result.fit is not None and len(result.fit.by_log) == len(result.logs) > 1:
        for log, own in zip(result.logs, result.fit.by_log, strict=True):
            # a loaded log's constants hold its payload's share
            if log.role == "unloaded":
                by_log += [(n, one.estimate) for n, one in own.items() if n in result.parameters]
    for name, colour, size, symbol, pairs in (
        ("each log by itself", GREY, 5, "circle", by_log),
        ("truth", ORANGE, 10, "circle-open", list(known_truth(result).items())),
    ):
        x, y = [], []
        for of, value in pairs:
            if of in known and value is not None:
                x.append(100 * (value - known[of][0]) / abs(known[of][0]))
                y.append(of)
        if x:
            panels.dots(0, x, y, name, colour, size, symbol)
    limit = 1.15 * max(widest, 1e-6)
    panels.axes(0, {"range": [-limit, limit]}, names_down(names))
    reading = "An interval that leaves the frame is far wider than most."
    return Plot("intervals", "95 % intervals", panels, reading)


def shares_of_time(names: Sequence[str], gained: FloatArray, width: float) -> Plot:
    """Information (Q, n) of stretches `width` s wide, in percent of each parameter's own."""
    # information adds up: the seconds of a long log are summed, not thinned
    step = -(-gained.shape[1] // MOST_CELLS)
    gained = np.add.reduceat(gained, np.arange(0, gained.shape[1], step), axis=1)
    total = gained.sum(axis=1, keepdims=True)
    shares = 100 * np.divide(gained, total, out=np.zeros_like(gained), where=total > 0)
    panels = Panels([""])
    look = {"colorscale": [[0, CLEAR], [1, STRONGLY]], "colorbar": {"ticksuffix": " %"}}
    panels.heat(names, (np.arange(shares.shape[1]) + 0.5) * step * width, shares, **look)
    panels.axes(0, "time, s")
    reading = (
        "Strongly coloured seconds inform most; a row with colour in one place only rests on that "
        "moment."
    )
    return Plot("information", "Information by time", panels, reading)
