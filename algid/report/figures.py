"""The figures of an identification's page, each drawn from its file of the result's folder.

A function gives None where there is nothing to draw, and raises `ResultError` for a file that is
damaged.
"""

from __future__ import annotations

import cmath
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from algid.arm import FloatArray
from algid.base.names import rows_of, stacked
from algid.base.quantiles import median, quantile
from algid.base.text import file_name, joined, significant, unit_text
from algid.model import SINES, length_by_coupling, moments_of
from algid.options import flag
from algid.report.plot import ArmDrawing, Panels, down
from algid.report.series import POINTS, Drawn, drawn, table
from algid.results import Result
from algid.results.rows import known_truth

MOST_CELLS = 600
MOST_WRITTEN = 14
USUAL = 4.0  # of the median interval: wider ones leave the frame, and do not hide the others
WIDEST = 100.0  # percent: an interval beyond holds zero


def figures(folder: Path, result: Result, raw: Drawn | None) -> list[Panels]:
    """Every figure that the folder gives, in the page's order; `raw` are the torque's samples."""
    made: list[Panels | None] = [residual(folder), over_time(folder, result, "running")]
    if raw is not None:
        made = [torque(folder, result, raw), *made, signals(result, raw), coverage(raw)]
    made += [correlation(result), information(folder)]
    return [plot for plot in made if plot is not None]


def arm_of(result: Result, raw: Drawn | None) -> ArmDrawing | None:
    """The arm of a result, to scale as far as its lengths are known, moved through the first log.

    None where l1 follows from nothing, or no motion is at hand.
    """
    value = {name: one.estimate or 0.0 for name, one in result.parameters.items()}
    held = result.settings | {name: one.estimate for name, one in result.payload.items()}
    # l1 = g |K1| / |K2| (Table 1)
    l1 = held.get("l1") or length_by_coupling(value, held.get("gravity") or 0.0)
    if not l1 or l1 < 0 or raw is None:
        return None
    of, l2 = raw.samples, held.get("l2")
    moved = rows_of(of, (of["log"] == 0) & np.isfinite(of["theta1"] + of["theta2"]))
    if moved["t"].size < 2:
        return None
    theta = stacked(moved, ("theta1", "theta2"))
    first, second, _ = moments_of(value)
    if first and second and set(value) & set(SINES):
        theta[0] += cmath.phase(second / first)  # θ1's zero against gravity
    reading = f"Play it: does this arm move as yours did? l1 is {significant(l1, 3)} m."
    if not l2 or l2 < 0:
        l2, way = l1, flag("l2")
        reading += f" Link 2's length is not known: it is drawn as long as link 1 (give {way})."
    mass = held.get("m_p")
    payload = "" if mass is None else f"payload of {significant(mass, 3)} kg"
    return ArmDrawing(l1, l2, moved["t"], theta, reading, payload, aside=held.get("y_p") or 0.0)


def _name_logs(panels: Panels, result: Result, rows: Drawn, count: int) -> None:
    """Draw a line where each of several logs begins, and its name in the first panel."""
    starts = rows.starts
    for log, x in starts.items() if len(starts) > 1 else ():
        for place in range(count):
            panels.mark(place, "start", x)
        if len(starts) <= 6:  # more names would stand on one another
            panels.text(0, file_name(result.logs[log].path), x)


def torque(folder: Path, result: Result, raw: Drawn) -> Panels:
    """Measured and predicted torque as scored, with the residual as recorded beside."""
    panels = Panels("torque")
    shown = drawn(folder / "scored.parquet", POINTS // 2) or raw
    if shown is not raw:
        for joint in (1, 2):
            name = "residual as recorded"
            panels.add(2 * joint - 1, raw["x"], raw[f"residual{joint}"], name)
    for place in range(4):
        panels.draw(place, shown["x"], shown)
    _name_logs(panels, result, shown, 4)
    if result.fit is not None and result.fit.prediction is not None:
        panels.title += result.fit.prediction.band
    return panels


def residual(folder: Path) -> Panels | None:
    """Spectrum and autocorrelation of the residual, with the 95 % band of white noise."""
    rows = table(folder / "innovations.parquet")
    kinds = sorted(set(rows.get("quantity", ())) - {"torque spectrum"}, reverse=True)
    if "autocorrelation" not in kinds:
        return None
    each = [(joint, kind) for joint in (1, 2) for kind in kinds]
    panels, inside = Panels("residual", [f"Joint {j}: {kind}" for j, kind in each]), []
    for place, (joint, kind) in enumerate(each):
        of_joint = rows_of(rows, rows["joint"] == joint)
        own = rows_of(of_joint, of_joint["quantity"] == kind)
        x, y, low, high = stacked(own, ("x", "value", "low", "high"))
        panels.band(place, x, low, high, "95 % band of white noise")
        if kind == "autocorrelation":
            panels.add(place, x, y, "residual", "stems")
            panels.axes(place, "lag, s")
            inside.append(f"{np.count_nonzero((y >= low) & (y <= high))} of {y.size}")
            continue
        measured = rows_of(of_joint, of_joint["quantity"] == "torque spectrum")
        if measured["x"].size:
            panels.add(place, measured["x"], measured["value"], "measured torque")
        panels.add(place, x, y, "residual")
        unit = "share of white noise" if np.isfinite(low).any() else "(N m)²/Hz"
        panels.axes(place, "frequency, Hz", unit)
    panels.note = f"Correlations of joints 1 and 2 inside the band: {joined(inside)}."
    return panels


def over_time(folder: Path, result: Result, name: str) -> Panels | None:
    """Estimates over time with their 95 % band, the result, and the truth where it is known."""
    rows, truth = drawn(folder / f"{name}.parquet", POINTS // 2), known_truth(result)
    if rows is None:
        return None
    known = result.estimates | (result.paper_payload if name == "loaded" else {})
    titles = {n: f"{n}, {unit_text(one.unit)}" for n, one in known.items()}
    titles["condition"] = "condition"
    names = [one for one in rows.columns if one in titles and np.isfinite(rows[one]).any()]
    panels = Panels(name, [titles[one] for one in names])
    for place, one in enumerate(names):
        value = np.where(np.isfinite(rows[one]), rows[one], np.nan)
        half = rows.columns.get(f"{one}_half", np.zeros(1))
        low, high = value - half, value + half
        if half.any():
            panels.band(place, rows["x"], low, high, "its 95 % interval")
        panels.add(place, rows["x"], value, "estimate from all samples so far")
        if one not in known:
            panels.axes(place, y="logarithm")
            continue
        # what comes first, and spikes near singular instants, start outside the view
        late = np.stack([low, high])[:, value.size // 4 :]
        ends = [quantile(late[np.isfinite(late)], share) for share in (0.05, 0.95)]
        for look, mark in ("result", known[one].estimate), ("truth", truth.get(one)):
            if mark is not None:
                ends.append(mark)
                panels.mark(place, look, mark, way="y")
        space = 0.4 * (max(ends) - min(ends)) or 0.05 * abs(ends[0]) or 1.0
        panels.axes(place, y={"range": [min(ends) - space, max(ends) + space]})
    _name_logs(panels, result, rows, len(names))
    return panels if names else None


def signals(result: Result, raw: Drawn) -> Panels:
    """Angles, velocities and torques of all logs."""
    panels = Panels("signals")
    for place in range(3):
        panels.draw(place, raw["x"], raw)
    _name_logs(panels, result, raw, 3)
    return panels


def coverage(raw: Drawn) -> Panels:
    """Where the motion went: angles and speeds."""
    panels, of = Panels("coverage"), raw.samples
    panels.add(0, np.degrees(of["theta1"]), np.degrees(of["theta2"]), "samples")
    panels.add(1, of["omega1"], of["omega2"], "samples")
    return panels


def correlation(result: Result) -> Panels | None:
    """Which estimates err together; what is not identifiable has no correlation."""
    names = result.fit.covariance_names if result.fit is not None else []
    if not names:
        return None
    C = result.covariance
    scale = np.sqrt(np.where(np.diag(C) > 0, np.diag(C), np.nan))
    panels = Panels("correlation")
    written = {"texttemplate": "%{z:.2f}"} if len(names) <= MOST_WRITTEN else {}
    panels.heat(names, list(names), C / np.outer(scale, scale), **written)
    return panels


def information(folder: Path) -> Panels | None:
    """Which seconds determine each parameter."""
    rows = table(folder / "information.parquet")
    names = [name for name in rows if name not in ("log", "t")]
    if not names or not rows["t"].size:
        return None
    return shares_of_time(names, np.nan_to_num([rows[name] for name in names]), 1.0)


def intervals(result: Result) -> Panels:
    """Every estimate's 95 % interval in percent of the estimate, each log's own, and the truth."""
    known, shares = dict[str, float](), list[float]()
    for name, one in (result.parameters | result.payload).items():
        if one.estimate and one.half is not None:
            known[name] = one.estimate
            shares.append(100 * one.half / abs(one.estimate))
    widest = min(max(shares, default=1.0), USUAL * median(shares or [1.0]), WIDEST)
    over = "95 % interval, % of the estimate"
    panels = down("intervals", over, list(known), 1.15 * max(widest, 1e-6))
    bars = {"type": "data", "array": shares, "thickness": 2.5, "width": 0}
    panels.add(0, [0.0] * len(known), list(known), "estimate with its interval", error_x=bars)
    beside, by_log = [("truth", known_truth(result))], result.fit.by_log if result.fit else []
    if len(by_log) == len(result.logs) > 1:
        for log, own in zip(result.logs, by_log, strict=True):
            if log.role == "unloaded":  # a loaded one's hold its payload's share
                found = {n: one.estimate for n, one in own.items() if one.estimate is not None}
                beside.insert(-1, ("each log by itself", found))
    for name, found in beside:
        names = [one for one in known if one in found]
        x = [100 * (found[one] - known[one]) / abs(known[one]) for one in names]
        if names:
            panels.add(0, x, names, name)
    return panels


def shares_of_time(names: Sequence[str], gained: FloatArray, width: float) -> Panels:
    """Information (Q, n) of stretches `width` s wide, in percent of each parameter's own."""
    # information adds up: the seconds of a long log are summed, not thinned
    step = -(-gained.shape[1] // MOST_CELLS)
    gained = np.add.reduceat(gained, np.arange(0, gained.shape[1], step), axis=1)
    total = gained.sum(axis=1, keepdims=True)
    shares = 100 * np.divide(gained, total, out=np.zeros_like(gained), where=total > 0)
    panels = Panels("information")
    panels.heat(names, (np.arange(shares.shape[1]) + 0.5) * step * width, shares)
    return panels
