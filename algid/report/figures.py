"""The figures of an identification's page, each drawn from its file of the result's folder."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from algid.arm import FloatArray, mass_matrix
from algid.base.errors import ResultError
from algid.base.quantiles import median, quantile
from algid.base.text import file_name, joined, significant, unit_text
from algid.model import K1, K3, K5
from algid.report.plot import BLUE, GREEN, GREY, ORANGE, Panels, Plot
from algid.report.series import POINTS, Drawn, between, drawn, table
from algid.results import Estimate, FitSummary, Result
from algid.results.rows import known_truth
from algid.results.verdict import share_text

STRONG = 0.95
MOST_CELLS = 600
MOST_WRITTEN = 14
TURN = 540.0  # degrees: an angle that spans more has turned round, and is shown within ±180
HALF = 0.5  # s before and after the worst moment
USUAL = 4.0  # of the median interval: wider ones leave the frame, and do not hide the others
WIDEST = 100.0  # percent: an interval beyond holds zero
CLEAR, STRONGLY = "rgba(59,130,196,0)", "rgba(59,130,196,.75)"


def figures(folder: Path, result: Result, raw: Drawn | None) -> Iterator[Plot | str]:
    """Every figure that the folder gives, in the page's order; or why one cannot be drawn."""
    shown = partial(_drawn, folder)
    if raw is not None:
        yield from shown("torque", lambda path: measured(path.with_stem("scored"), raw, result))
        yield from shown("torque", lambda path: closeup(path, raw, result))
    yield from shown("innovations", lambda path: residual(path, result))
    yield from shown("running", lambda path: running(path, result))
    if raw is not None:
        yield from (signals(raw, result), coverage(raw))
    if result.fit is not None:
        yield from filter(None, [correlation(result.fit)])
    yield from shown("information", information)
    yield from filter(None, [inertia(result, raw)])


def of_paper(folder: Path, result: Result) -> Iterator[Plot | str]:
    """The convergence of the paper's estimates, where it was written."""
    for name in ("estimates", "loaded"):
        yield from _drawn(folder, name, lambda path: convergence(path, result))


def _drawn(folder: Path, name: str, make: Callable[[Path], Plot | None]) -> Iterator[Plot | str]:
    """What `make` draws of a file, where that is there; or why it cannot be drawn."""
    path = folder / f"{name}.parquet"
    if path.is_file():
        try:
            plot = make(path)
        except ResultError as error:
            yield f"Not shown: {error}."
        else:
            if plot is not None:
                yield plot


def intervals(result: Result) -> Plot:
    """Every estimate's 95 % interval in percent of the estimate, each log's own, and the truth."""
    known: dict[str, Estimate] = {}
    shares = []
    for name, one in (result.parameters | result.payload).items():
        if one.estimate and one.half is not None:
            known[name] = one
            shares.append(100 * one.half / abs(one.estimate))
    usual = USUAL * median(shares or [1.0])
    limit = 1.15 * max(min(max(shares, default=1.0), usual, WIDEST), 1e-6)
    names = list(known)
    panels = Panels(["95 % interval, % of the estimate"], height=60 + 20 * len(names))

    def percent(name: str, value: float) -> float:
        estimate = known[name].estimate or 1.0
        return 100 * (value - estimate) / abs(estimate)

    by_log: list[tuple[float, str]] = []
    if result.fit is not None and len(result.fit.by_log) == len(result.logs) > 1:
        for log, own in zip(result.logs, result.fit.by_log, strict=True):
            # a loaded log's constants hold its payload's share
            for name in own.keys() & known.keys() if log.role == "unloaded" else ():
                value = own[name].estimate
                if value is not None and name in result.parameters:
                    by_log.append((percent(name, value), name))
    bars = {"type": "data", "array": shares, "color": BLUE, "thickness": 2.5, "width": 0}
    panels.dots(0, [0.0] * len(names), names, "estimate with its interval", error_x=bars)
    truth = [(percent(n, value), n) for n, value in known_truth(result).items() if n in known]
    for name, colour, pairs in (("each log by itself", GREY, by_log), ("truth", ORANGE, truth)):
        if pairs:
            x, y = zip(*pairs, strict=True)
            size, symbol = (10, "circle-open") if pairs is truth else (5, "circle")
            panels.dots(0, list(x), list(y), name, colour, size, symbol)
    panels.axes(0, {"range": [-limit, limit]})
    order = {"type": "category", "categoryarray": names, "autorange": "reversed"}
    panels.axes(0, y=order)
    reading = "An interval that leaves the frame is far wider than most."
    return Plot("intervals", "95 % intervals", panels, reading)


def _name_logs(panels: Panels, result: Result, rows: Drawn, count: int) -> None:
    """Draw a line where each of several logs begins, and its name in the first panel."""
    starts = rows.starts if len(rows.logs) > 1 else {}
    for log, x in starts.items():
        for place in range(count):
            panels.line(place, x=x, dash="dot")
        if len(starts) <= 6:  # more names would stand on one another
            panels.text(0, file_name(result.logs[log].path), x)


def measured(scored: Path, raw: Drawn, result: Result) -> Plot:
    """Measured and predicted torque as they are scored, with the residual as recorded beside."""
    titles = ("Joint 1: torque, N m", "residual, N m", "Joint 2: torque, N m", "residual, N m")
    panels = Panels(titles, height=190, together=True)
    shown = drawn(scored, POINTS // 2) if scored.is_file() else raw
    x = shown["x"]
    for joint in (1, 2):
        above, below = 2 * joint - 2, 2 * joint - 1
        if shown is not raw:
            recorded = raw["x"], raw[f"residual{joint}"], "residual as recorded"
            panels.curve(below, *recorded, "#e3a46f", 0.8, visible="legendonly")
        panels.curve(above, x, shown[f"tau{joint}"], "measured", GREY, 3.6)
        panels.curve(above, x, shown[f"tau{joint}_predicted"], "predicted by the model", BLUE)
        panels.curve(below, x, shown[f"residual{joint}"], "residual", ORANGE)
    panels.axes(3, "time, s")
    _name_logs(panels, result, shown, 4)
    band = note = ""
    score = result.fit.prediction if result.fit is not None else None
    if score is not None:
        band = score.band
        each = []
        for joint in (0, 1):
            rmse, r2 = significant(score.rmse[joint], 3), share_text(score.r2[joint])
            each.append(f"joint {joint + 1} {rmse} N m RMS, R² {r2}")
        note = f"Residual{band}: {'; '.join(each)}."
    reading = "Blue should cover grey; orange should look like noise, with no trace of the motion."
    return Plot("torque", f"Measured and predicted torque{band}", panels, reading, note)


def closeup(path: Path, raw: Drawn, result: Result) -> Plot | None:
    """One second about the largest residual of each joint, every sample; None without one."""
    titles, parts = [], []
    for place in (0, 1):
        log = max(raw.logs, key=lambda log: raw.logs[log].worst[place][0])
        size, t = raw.logs[log].worst[place]
        if size > 0:
            parts.append((place + 1, between(path, log, t - HALF, t + HALF)))
            of = f" of {file_name(result.logs[log].path)}" if len(raw.logs) > 1 else ""
            titles.append(f"Joint {place + 1}: {significant(size, 3)} N m at {t:.3f} s{of}")
    if not parts:
        return None
    panels = Panels(titles, 2)
    for place, (joint, rows) in enumerate(parts):
        x, tau, known = rows["t"], rows[f"tau{joint}"], rows[f"tau{joint}_predicted"]
        panels.curve(place, x, tau, "measured", GREY, 3.6)
        panels.curve(place, x, known, "predicted by the model", BLUE)
        panels.curve(place, x, tau - known, "residual", ORANGE)
        panels.axes(place, "time, s", "N m")
    reading = (
        "A residual that stands out once is an event, such as a knock; one like the rest is the "
        "model's limit."
    )
    return Plot("closeup", "The largest residual, every sample", panels, reading)


def residual(path: Path, result: Result) -> Plot | None:
    """Spectrum and autocorrelation of the estimator's residual, with white noise's 95 % band."""
    rows = {name: np.array(values) for name, values in table(path).items()}
    own = [kind for kind in dict.fromkeys(rows["quantity"].tolist()) if "torque" not in kind]
    kinds = sorted(own, reverse=True)  # the spectrum first
    if "autocorrelation" not in kinds:
        return None
    each = [(joint, kind) for joint in (1, 2) for kind in kinds]
    panels = Panels([f"Joint {joint}: {kind}" for joint, kind in each], len(kinds))
    inside = []

    def curve(kind: str, joint: int) -> list[FloatArray]:
        rows_of_it = (rows["quantity"] == kind) & (rows["joint"] == joint)
        return [rows[name][rows_of_it].astype(np.float64) for name in ("x", "value", "low", "high")]

    for place, (joint, kind) in enumerate(each):
        x, y, low, high = curve(kind, joint)
        panels.band(place, x, low, high, "95 % band of white noise")
        if kind == "autocorrelation":
            stems = np.stack([0 * y, y, np.nan * y], axis=1).ravel()
            panels.curve(place, np.repeat(x, 3), stems, "residual", ORANGE, 4)
            panels.axes(place, "lag, s")
            inside.append(f"{np.count_nonzero((y >= low) & (y <= high))} of {y.size}")
            continue
        torque = curve("torque spectrum", joint)
        if torque[0].size:
            panels.curve(place, torque[0], torque[1], "measured torque", GREY, 2)
        panels.curve(place, x, y, "residual", ORANGE)
        unit = "share of white noise" if np.isfinite(low).any() else "(N m)²/Hz"
        frequency = {"type": "log", "dtick": 1, "title": {"text": "frequency, Hz"}}
        panels.axes(place, frequency, {"type": "log", "nticks": 5})
        panels.axes(place, y=unit)
    note = f"Correlations of joints 1 and 2 inside the band: {joined(inside)}."
    if result.fit is not None and result.fit.whiteness:
        white = all(test.white for test in result.fit.whiteness.values())
        note += f" {'No significant' if white else 'Significant'} residual autocorrelation."
    reading = (
        "Of white noise 19 of 20 values lie in the blue band; a hump in the spectrum is motion "
        "that the model misses, bars that start high and fall are slow errors."
    )
    return Plot("residual", "Residuals: spectrum and autocorrelation", panels, reading, note)


def running(path: Path, result: Result) -> Plot | None:
    """What the estimator had found by each moment, and its 95 % band."""
    rows = drawn(path, 10_000)
    names = []
    for name in result.estimates:
        if f"{name}_half" in rows.columns and np.isfinite(rows[name]).any():
            names.append(name)
    if not names:
        return None
    titles = [f"{name}, {unit_text(result.estimates[name].unit)}" for name in names]
    panels, x = Panels(titles, 2, 210, together=True), rows["x"]
    for place, name in enumerate(names):
        value, half = rows[name], rows[f"{name}_half"]
        panels.band(place, x, value - half, value + half, "its 95 % interval")
        panels.curve(place, x, value, "estimate from all samples so far")
        known = np.flatnonzero(np.isfinite(value) & np.isfinite(half))
        final = float(value[np.isfinite(value)][-1])
        panels.line(place, y=final)
        if known.size:  # the last two thirds, and the final interval several times over
            late, reach = known[known.size // 3 :], 4 * half[known[-1]]
            low = min(final - reach, np.min(value[late] - half[late]))
            high = max(final + reach, np.max(value[late] + half[late]))
            panels.axes(place, y={"range": [float(low), float(high)]})
    _name_logs(panels, result, rows, len(names))
    reading = (
        "The band must shrink and the line stay inside what the band was before; a line that "
        "leaves it late shows a part of the logs that contradicts the rest."
    )
    return Plot("running", "Running estimate", panels, reading)


def signals(raw: Drawn, result: Result) -> Plot:
    """Angles, velocities and torques of all logs."""
    quantities = {"theta": "Angle, rad", "omega": "Velocity, rad/s", "tau": "Measured torque, N m"}
    panels = Panels(list(quantities.values()), height=200, together=True)
    for place, name in enumerate(quantities):
        for joint, colour, dash in ((1, BLUE, "solid"), (2, ORANGE, "5px,2px")):
            y = raw[f"{name}{joint}"]
            panels.curve(place, raw["x"], y, f"joint {joint}", colour, 1.2, dash)
    panels.axes(2, "time, s")
    _name_logs(panels, result, raw, 3)
    reading = (
        "Look for jumps, flat stretches and clipped tops: what is odd here is odd in every number."
    )
    return Plot("signals", "Signals", panels, reading)


def coverage(raw: Drawn) -> Plot:
    """Where the motion went: angles and speeds."""
    panels = Panels(("Angles, °", "Speeds, rad/s"), 2, 320)
    for place, (name, scale) in enumerate((("theta", 180 / np.pi), ("omega", 1.0))):
        ways = []
        for joint in (1, 2):
            way = scale * raw.samples[f"{name}{joint}"]
            if name == "theta" and np.ptp(way[np.isfinite(way)]) > TURN:
                way = (way + 180) % 360 - 180
            ways.append(way)
        panels.dots(place, ways[0], ways[1], "samples", BLUE, 4, opacity=0.5)
        panels.axes(place, "joint 1", "joint 2")
    reading = (
        "Dots spread over both planes inform; a line or a spot leaves parameters tied to each "
        "other. Angles that turned round are within ±180°."
    )
    return Plot("coverage", "Coverage of the motion", panels, reading)


def correlation(fit: FitSummary) -> Plot | None:
    """Which estimates err together; what is not identifiable has no correlation."""
    names = fit.covariance_names
    if not names:
        return None
    C = np.array(fit.covariance, dtype=np.float64)  # None becomes NaN
    variance = np.diag(C)
    scale = np.sqrt(np.where(variance > 0, variance, np.nan))
    R = C / np.outer(scale, scale)
    strong = np.argwhere(np.triu(np.abs(R) > STRONG, 1))
    pairs = [f"{names[i]} and {names[j]} ({R[i, j]:+.3f})" for i, j in strong]
    panels = Panels([""])
    orange = [[0, "rgba(217,119,43,.5)"], [0.5, "rgba(217,119,43,0)"]]
    shades = [*orange, [0.5, CLEAR], [1, "rgba(59,130,196,.5)"]]  # pale enough to write on
    more: dict[str, object] = {"zmin": -1, "zmax": 1, "colorscale": shades, "xgap": 3}
    if len(names) <= MOST_WRITTEN:
        more["texttemplate"] = "%{z:.2f}"
    panels.heat(names, list(names), R, **more)
    reading = "Two estimates of a strong colour err together: trust their combination first."
    note = f"Correlated beyond {STRONG:g}: {joined(pairs) or 'no pair'}."
    return Plot("correlation", "Correlation of the estimates", panels, reading, note)


def information(path: Path) -> Plot | None:
    """Which seconds determine each parameter."""
    rows = table(path)
    names = [name for name in rows if name not in ("log", "t")]
    if not names or not rows["t"]:
        return None
    return shares_of_time(
        names, np.nan_to_num(np.array([rows[name] for name in names], dtype=np.float64)), 1.0
    )


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


def inertia(result: Result, raw: Drawn | None) -> Plot | None:
    """M11, M12 and M22 over one turn of joint 2, with their 95 % bands."""
    names = (K1, K3, K5)
    known = [result.parameters[name].estimate for name in names if name in result.parameters]
    if len(known) < len(names) or None in known:
        return None
    theta2 = np.linspace(-np.pi, np.pi, 181)

    def parts(k1: float, k3: float, k5: float) -> FloatArray:
        k = np.array([k1, 0, k3, 0, k5, 0, 0])
        return np.stack(mass_matrix(k, np.stack([0 * theta2, theta2])))

    m = parts(*(value or 0.0 for value in known))
    # M is linear in the constants: unit vectors give its derivatives
    slopes = np.stack([parts(*unit) for unit in np.eye(3).tolist()])
    C = np.full((3, 3), np.nan) if result.fit is None else result.fit.covariance_of(names)
    std = np.sqrt(np.maximum(np.einsum("ipn,ij,jpn->pn", slopes, C, slopes), 0))
    half = result.quantile * std
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
    definite = "M is positive definite for every θ2"
    if smallest <= 0:
        definite = "M is not positive definite for every θ2, which no arm is"
    note = f"{definite}; its smallest eigenvalue is {significant(smallest, 3)} kg m²."
    reading = "M11 and M22 must stay above zero; outside the grey stretch the curves extrapolate."
    return Plot("inertia", "Mass matrix M(θ)", panels, reading, note)


def convergence(path: Path, result: Result) -> Plot:
    """The paper's Figure 2: each estimate over time, with final value, interval and truth."""
    rows = drawn(path, POINTS // 2)
    names = [name for name in rows.columns if name not in ("log", "t", "x", "k7_condition")]
    loaded = path.stem == "loaded"
    known: Mapping[str, Estimate] = result.parameters
    if loaded:
        known = result.payload | result.paper_payload | result.loaded
    truth = known_truth(result)
    panels = Panels(names, 2, 220, together=True)
    for place, name in enumerate(names):
        series = rows[name]
        if name == "condition":
            series = np.where(np.isfinite(series), series, np.nan)
            panels.axes(place, y={"type": "log"})
        panels.curve(place, rows["x"], series, "the paper's estimate over time", width=1.2)
        finite = series[np.isfinite(series)]
        if name == "condition" or not finite.size:
            continue
        # spikes near singular instants start outside the view
        settled = finite[finite.size // 4 :]
        ends = [quantile(settled, share) for share in (0.04, 0.96)]
        one = known.get(name)
        if one is not None and one.estimate is not None:
            ends += [one.estimate, *(end for end in one.ci95 or () if end is not None)]
            panels.line(place, y=one.estimate, colour=GREEN, dash="solid")
        if name in truth:
            ends.append(truth[name])
            panels.line(place, y=truth[name], colour=ORANGE)
        space = 0.25 * (max(ends) - min(ends)) or 0.05 * abs(ends[0]) or 1.0
        panels.axes(place, y={"range": [min(ends) - space, max(ends) + space]})
    reading = (
        "From ε = 0.2 s on, blue should settle on the green line, the result; the dashed line is "
        "the truth. Double-click shows the spikes that the frame cuts off."
    )
    title = (
        "Convergence, loaded log"
        if loaded
        else ("Convergence of the estimates (the paper's Figure 2)")
    )
    return Plot(path.stem, title, panels, reading)
