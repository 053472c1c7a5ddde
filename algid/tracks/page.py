"""The report of a track: tables, figure, verdict, and the files of its folder.

``track.json``, ``track.parquet``, ``stretches.parquet``, the pages `report.html` and `report.md`,
and ``track.mcap``.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from algid.base.criteria import HOLE
from algid.base.names import concatenated, rows_of
from algid.base.significance import NORMAL
from algid.base.text import cells, counted, file_name, joined, resolved, significant
from algid.notices import Notice, Verdict, graded, lossy, notes_of, warnings_of
from algid.report.document import Document, Section, Table
from algid.report.export import write_mcap
from algid.report.plot import Panels
from algid.report.render import markdown, page, write_texts
from algid.report.series import Block, reduced
from algid.report.tables import log_tables, provenance_table, settings_table
from algid.results.verdict import LEAST_R2, WORST_R2, share_text, wrong_length
from algid.tracks.cells import CELL
from algid.tracks.payload import HALF_BAND
from algid.tracks.result import (
    CURVE,
    FILE,
    Stretch,
    StretchStatus,
    TrackResult,
    track_json,
    write_tables,
)

CHANGE = "{0} | {1:.3f} | {2} | kg | [{3:.3f}, {4:.3f}] | {5:.3f}"
COLOURED = 4.0  # of the rows' variance: intervals twice as wide as the sensors' noise asks for
STRANGE = 1e4
"""Of the rows' variance: a real arm with friction reaches 6e3, another arm 5e4 and more."""
ALL_BUT = 0.99  # explained of the torque, beyond which such errors are those of very quiet sensors
MOST_NAMED = 4  # changes whose times the verdict lists
POINTS = 4_000  # of the curve that are drawn
MOST_MARKS = 60  # changes beyond which bands over the whole panel would hide it
SPACE = 0.08  # of the masses' range, above and below


def track_document(result: TrackResult) -> Document:
    """The report of a track."""
    name = file_name(result.log.path)
    seconds, rate = significant(result.log.duration, 4), significant(result.log.rate, 4)
    sentences = tuple(one.sentence for one in result.notices)
    made = [("algid", result.version), ("arm's result", result.arm)]
    made.append(("sha256 of the arm's result", result.arm_sha256))
    return Document(
        verdict=verdict(result),
        sections=(
            Section("numbers", "Numbers", (stretch_table(result), change_table(result))),
            Section("payload", "Payload in time", (payload_figure(result),)),
            Section("data", "Data quality", (sentences, *quality_tables(result)), folded=True),
            Section(
                "settings",
                "Settings and provenance",
                (settings_table(result.settings), provenance_table(made, [result.log])),
                folded=True,
            ),
        ),
        kicker="a payload in time",
        name=name,
        facts=f"arm of {file_name(result.arm)} · {seconds} s of log at {rate} Hz · "
        f"{counted(result.log.rows, 'sample')}",
    )


def track_folder(log: str, parent: Path) -> Path:
    """Where the track of a log goes: `parent/STEM.track`."""
    return parent / f"{Path(log).stem or 'log'}.track"


def write_track(result: TrackResult, folder: Path, mcap: bool = False) -> None:
    """Write everything into `folder`, `track.mcap` where asked. Raises `OutputError`."""
    write_tables(result, folder)
    write_texts(folder, {FILE: track_json(result)})
    write_pages(result, folder, mcap)


def write_pages(result: TrackResult, folder: Path, mcap: bool = False) -> list[Path]:
    """Write the pages of a track into its `folder`, `track.mcap` where asked.

    The log of ROS 2 has the stamps of the track's own, for Foxglove and PlotJuggler.

    Raises `OutputError`.
    """
    document = track_document(result)
    pages = {"report.html": page(document), "report.md": markdown(document)}
    written = write_texts(folder, pages)
    if mcap:
        written.append(write_mcap(folder / "track.mcap", {"payload": folder / CURVE}))
    return written


def stretch_table(result: TrackResult) -> Table:
    """The stretches, their masses and intervals."""
    rows = []
    for place, (one, status, truth) in enumerate(result.rows, start=1):
        error = None if truth is None else one.m_p - truth
        true = [resolved(truth, one.std), resolved(error, one.std)]
        span = (f"{one.start:.3f}", f"{one.end:.3f}")
        rows.append((str(place), *span, *mass_and_half(one), "kg", status.value, *true))
    return Table(
        "Payload by stretch",
        "Stretch | From, s | To, s | Payload | ± 95 % | Unit | Status | Truth | Error",
        tuple(rows),
    )


def change_table(result: TrackResult) -> Table:
    """When the payload changed, and by how much."""
    times = [time for time, _ in result.schedule or () if time > 0]
    rows = []
    for place, (moment, low, high) in enumerate(result.track.changes.tolist()):
        before, after = result.track.stretches[place : place + 2]
        step = after.m_p - before.m_p
        by = ("" if step < 0 else "+") + resolved(step, max(before.std, after.std))
        near = min(times, key=lambda time: abs(time - moment), default=None)
        rows.append(cells(CHANGE, place + 1, moment, by, low, high, near))
    return Table(
        "Changes",
        "Change | At, s | By | Unit | Between, s | Truth at, s",
        tuple(rows),
        "Between: the change's 95 % interval.",
    )


def quality_tables(result: TrackResult) -> tuple[Table, ...]:
    """What the track leaves of the torque, the log, its channels, and where it has no samples."""
    noise = significant(math.sqrt(result.track.colour), 3)
    fit = (
        ("torque explained by arm and payload, noise aside", share_text(result.track.explained)),
        ("slow errors and noise over the sensors' noise", noise),
    )
    holes = [(f"{start:.3f}", f"{end:.3f}") for start, end in result.track.holes.tolist()]
    return (
        Table("Fit", "What | Value", fit),
        *log_tables([result.log]),
        Table("Times without samples", "From, s | To, s", tuple(holes)),
    )


def mass_and_half(stretch: Stretch) -> tuple[str, str]:
    """A stretch's mass and half its 95 % interval in kg; a mass that may be nothing is 0."""
    half = NORMAL * stretch.std
    mass = "0" if abs(stretch.m_p) <= half else resolved(stretch.m_p, stretch.std)
    return mass, significant(half, 2)


def verdict(result: TrackResult) -> Verdict:
    """Judge a track by its stretches, what it explains of the torque, and the arm's own result."""
    track, statuses, reasons = result.track, result.statuses, []
    for status, case in (
        (StretchStatus.WEAK_EXCITATION, "weak"),
        (StretchStatus.NEGATIVE_MASS, "negative"),
    ):
        own = [str(place) for place, one in enumerate(statuses, start=1) if one is status]
        if own:
            reasons.append(Notice("STRETCHES", numbers={"case": case, "numbers": own}))
    share = max(100 * track.explained, 0.0)
    if track.explained < LEAST_R2:
        numbers = {"case": "track", "percent": share}
        reasons.append(Notice("LITTLE_EXPLAINED", numbers=numbers))
    times = significant(float(track.colour) ** 0.5, 2)
    if track.colour > COLOURED:
        reasons.append(Notice("LITTLE_EXPLAINED", numbers={"case": "errors", "times": times}))
    if result.data_lost and not lossy(result.notices):
        reasons.append(Notice("DATA_LOST"))
    reasons += warnings_of(result.notices)
    # why the masses must not be used
    failure, asked = None, "is it this arm, in these units?"
    negative = statuses.count(StretchStatus.NEGATIVE_MASS)
    if wrong_length(result.notices):
        failure = "a link length contradicts the arm's result"
    elif track.explained < WORST_R2:
        failure = f"arm and payload explain only {share:.0f} % of the torque: {asked}"
    elif track.colour > STRANGE and track.explained < ALL_BUT:
        failure = f"arm and payload miss the torque by {times} times its sensors' noise: {asked}"
    elif 2 * negative >= len(statuses):
        of_all = f"{negative} of {counted(len(statuses), 'stretch', 'stretches')}"
        failure = f"{of_all} with a negative mass: the arm's constants do not fit this log"
    elif set(statuses) == {StretchStatus.WEAK_EXCITATION}:
        failure = "the arm moves too little to weigh anything"
    changes = track.changes[:, 0].tolist()
    masses = [mass_and_half(one)[0] for one in track.stretches]
    half = mass_and_half(max(track.stretches, key=lambda stretch: stretch.std))[1]
    headline = f"the payload does not change: {masses[0]} ± {half} kg throughout"
    if changes:
        what = f", in {len(masses)} stretches"
        if len(changes) <= MOST_NAMED:
            moments = joined([f"{time:.2f}" for time in changes])
            what = f" at {moments} s, weighing {joined(masses)} kg"
        what = f"{counted(len(changes), 'time')}{what}"
        headline = f"the payload changes {what}, the least certain to ± {half} kg (95 %)"
    notes = notes_of(result.notices)
    return graded(headline, reasons, notes, failure=failure, things="masses")


def payload_figure(result: TrackResult) -> Panels:
    """Payload and residual over time, with the stretches, the changes and the true schedule."""
    track, stretches = result.track, result.track.stretches
    panels = Panels(
        "payload", ("payload, kg", f"residual over the sensors' noise, RMS of each {CELL:g} s")
    )
    half = NORMAL * track.std
    curve = {"t": track.t, "low": track.m_p - half, "m_p": track.m_p, "high": track.m_p + half}
    curve["left"] = track.left
    size = max(1, -(-2 * track.t.size // POINTS))
    # lines break at holes and between stretches
    apart = np.flatnonzero((np.diff(track.stretch) != 0) | (np.diff(track.t) > HOLE + CELL)) + 1
    parts = list[Block]()
    for part in np.split(np.arange(track.t.size), apart):
        drawn = reduced(rows_of(curve, part), size)
        parts += [drawn, dict.fromkeys(curve, np.full(1, np.nan)) | {"t": drawn["t"][-1:]}]
    t, low, m_p, high, left = concatenated(parts).values()
    panels.band(0, t, low, high, "its 95 % band")
    panels.add(0, t, m_p, f"m_p(t) from ± {HALF_BAND:g} s around")
    ends = np.array([[one.start, one.end] for one in stretches]).ravel()
    masses = np.repeat([one.m_p for one in stretches], 2)
    panels.add(0, ends, masses, "mass of each stretch")
    # in view: masses, their intervals and the truth; m_p(t) where it is as certain as usual, but
    # for jolts
    certain = track.std <= 3 * np.median(track.std)
    reach = [
        float(np.percentile(curve[end][certain], at)) for end, at in (("low", 1), ("high", 99))
    ]
    for one in stretches:
        reach += one.ci95
    if result.schedule is not None:
        steps = [(time, mass) for time, mass in result.schedule if time < ends[-1]]
        times, true = zip((-np.inf, 0.0), *steps, strict=True)
        x = np.clip([*times, np.inf], ends[0], ends[-1])
        panels.add(0, x, np.array([*true, true[-1]]), "true schedule")
        reach += true
    if len(track.changes) <= MOST_MARKS:
        for _, start, end in track.changes.tolist():
            for place in (0, 1):
                panels.mark(place, "step", start, end)
    space = SPACE * (max(reach) - min(reach)) or 0.05
    panels.axes(0, y={"range": [min(reach) - space, max(reach) + space]})
    panels.add(1, t, left, "residual")
    panels.mark(1, "level", 1.0, way="y")
    panels.note = f"Median of the residual over the noise: {float(np.median(track.left)):.2f}."
    return panels
