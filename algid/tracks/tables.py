"""The tables of a track, and its verdict."""

from __future__ import annotations

import math
from collections.abc import Iterator

from algid.base.text import ABSENT, file_name, joined, significant
from algid.base.verdict import Verdict, graded
from algid.base.words import counted
from algid.notices import Notice, has_code, lossy, notes_of, warnings_of
from algid.report.document import Kind, Table
from algid.report.tables import log_tables, provenance_table
from algid.results.verdict import LEAST_R2, WORST_R2, share_text
from algid.tracks.payload import Stretch
from algid.tracks.result import StretchStatus, TrackResult


def stretch_table(result: TrackResult) -> Table:
    """The stretches, their masses and intervals."""
    rows = []
    truths = result.truth or (None,) * len(result.track.stretches)
    for place, (stretch, status, truth) in enumerate(
        zip(result.track.stretches, result.statuses, truths, strict=True), start=1
    ):
        true = error = ABSENT
        if truth is not None:
            true, error = fixed(truth, stretch.std), fixed(stretch.m_p - truth, stretch.std)
        span = (f"{stretch.start:.3f}", f"{stretch.end:.3f}")
        mass = (mass_text(stretch), half_text(stretch), "kg", status.value)
        rows.append((str(place), *span, *mass, true, error))
    columns: dict[str, Kind] = {
        "Stretch": "name", "From, s": "number", "To, s": "number", "Payload": "number",
        "± 95 %": "number", "Unit": "text", "Status": "status", "Truth": "number",
        "Error": "number",
    }  # fmt: skip
    return Table("Payload by stretch", columns, tuple(rows)).without_empty()


def change_table(result: TrackResult) -> Table:
    """When the payload changed, and by how much."""
    times = [time for time, _ in result.schedule or () if time > 0]
    rows = []
    for place, (moment, low, high) in enumerate(result.track.changes.tolist()):
        before, after = result.track.stretches[place : place + 2]
        step = fixed(after.m_p - before.m_p, max(before.std, after.std))
        if not step.startswith("-"):
            step = f"+{step}"
        true = ABSENT
        if times:
            true = f"{min(times, key=lambda time: abs(time - moment)):.3f}"
        between = f"[{low:.3f}, {high:.3f}]"
        rows.append((str(place + 1), f"{moment:.3f}", step, "kg", between, true))
    columns: dict[str, Kind] = {
        "Change": "name", "At, s": "number", "By": "number", "Unit": "text",
        "Between, s": "number", "Truth at, s": "number",
    }  # fmt: skip
    note = "Between: the change's 95 % interval."
    return Table("Changes", columns, tuple(rows), note).without_empty()


def quality_tables(result: TrackResult) -> tuple[Table, ...]:
    """What the track leaves of the torque, the log, its channels, and where it has no samples."""
    fit = (
        ("torque explained by arm and payload, noise aside", share_text(result.track.explained)),
        (
            "slow errors and noise over the sensors' noise",
            significant(math.sqrt(result.track.colour), 3),
        ),
    )
    log, channels = log_tables([result.log])
    holes = [(f"{start:.3f}", f"{end:.3f}") for start, end in result.track.holes.tolist()]
    return (
        Table("Fit", {"What": "name", "Value": "number"}, fit),
        log.without(["Arm"]),
        channels.without(["Log"]),
        Table("Times without samples", {"From, s": "name", "To, s": "number"}, tuple(holes)),
    )


def track_provenance(result: TrackResult) -> Table:
    """What the track was made from."""
    return provenance_table(
        [
            ("algid", result.version),
            ("arm's result", result.arm),
            ("sha256 of the arm's result", result.arm_sha256),
            ("path of the log", result.log.path),
            (
                f"sha256 of {file_name(result.log.path)}",
                result.log.sha256 or "unknown, fetched in part",
            ),
        ]
    )


def mass_text(stretch: Stretch) -> str:
    """A stretch's mass in kg, down to the second digit of its standard deviation.

    0 where it may be nothing.
    """
    if stretch.empty:
        return "0"
    return fixed(stretch.m_p, stretch.std)


def half_text(stretch: Stretch) -> str:
    """Half the 95 % interval in kg, with the mass's digits; one digit beside 0."""
    half = stretch.ci95[1] - stretch.m_p
    if stretch.empty:
        return fixed(half, 10 * float(f"{half:.0e}"))
    return fixed(half, stretch.std)


def fixed(value: float, std: float) -> str:
    """`value` with the decimals that its standard deviation resolves, so that columns line up."""
    decimals = 3
    if math.isfinite(std) and std > 0:
        decimals = min(max(1 - math.floor(math.log10(std)), 0), 9)
    text = f"{value:.{decimals}f}"
    if float(text) == 0:
        return text.removeprefix("-")
    return text


COLOURED = 4.0  # of the rows' variance: intervals twice as wide as the sensors' noise asks for
STRANGE = 1e4
"""Of the rows' variance: a real arm with friction reaches 6e3, another arm 5e4 and more."""
ALL_BUT = 0.99  # explained of the torque, beyond which such errors are those of very quiet sensors
MOST_NAMED = 4

CASES = {StretchStatus.WEAK_EXCITATION: "weak", StretchStatus.NEGATIVE_MASS: "negative"}


def verdict(result: TrackResult) -> Verdict:
    """Judge a track by its stretches, what it explains of the torque, and the arm's own result."""
    return graded(
        _weighed(result),
        list(_reasons(result)),
        notes_of(result.notices),
        failure=_failure(result),
        things="masses",
    )


def _weighed(result: TrackResult) -> str:
    stretches, changes = result.track.stretches, result.track.changes
    if len(stretches) == 1:
        return (
            f"the payload does not change: {mass_text(stretches[0])} ± "
            f"{half_text(stretches[0])} kg throughout"
        )
    widest = max(stretches, key=lambda stretch: stretch.std)
    count = len(changes)
    how_often = {1: "once", 2: "twice"}.get(count, counted(count, "time"))
    if count <= MOST_NAMED:
        when = f" at {joined(list(map('{:.2f}'.format, changes[:, 0])))} s"
        what = f"weighing {joined(list(map(mass_text, stretches)))} kg"
    else:
        when, what = "", f"in {counted(len(stretches), 'stretch', 'stretches')}"
    return (
        f"the payload changes {how_often}{when}, {what}, the least certain to ± "
        f"{half_text(widest)} kg (95 %)"
    )


def _failure(result: TrackResult) -> str | None:
    if has_code(result.notices, "LENGTH_CONTRADICTED"):
        return "a link length contradicts the arm's result"
    if result.track.explained < WORST_R2:
        share = f"{max(100 * result.track.explained, 0):.0f} %"
        return (
            f"arm and payload explain only {share} of the torque: is it this arm, in these units?"
        )
    if result.track.colour > STRANGE and result.track.explained < ALL_BUT:
        times = f"{significant(float(result.track.colour) ** 0.5, 2)} times"
        return (
            f"arm and payload miss the torque by {times} its sensors' noise: is it this arm, "
            "in these units?"
        )
    statuses = result.statuses
    negative = statuses.count(StretchStatus.NEGATIVE_MASS)
    if 2 * negative >= len(statuses):
        share = f"{negative} of {counted(len(statuses), 'stretch', 'stretches')} have"
        if len(statuses) == 1:
            share = "the payload has"
        return f"{share} a negative mass: the arm's constants do not fit this log"
    if set(statuses) == {StretchStatus.WEAK_EXCITATION}:
        return "the arm moves too little to weigh anything"
    return None


def _reasons(result: TrackResult) -> Iterator[Notice]:
    for status, case in CASES.items():
        numbers = []
        for place, given in enumerate(result.statuses, start=1):
            if given is status:
                numbers.append(str(place))
        if numbers:
            yield Notice("STRETCHES", numbers={"case": case, "numbers": numbers})
    if result.track.explained < LEAST_R2:
        yield Notice(
            "LITTLE_EXPLAINED",
            numbers={"case": "track", "percent": max(100 * result.track.explained, 0.0)},
        )
    if result.track.colour > COLOURED:
        yield Notice(
            "LITTLE_EXPLAINED",
            numbers={"case": "errors", "times": significant(float(result.track.colour) ** 0.5, 2)},
        )
    if result.data_lost and not lossy(result.notices):
        yield Notice("DATA_LOST")
    yield from warnings_of(result.notices)
