"""Whether to trust a track: one sentence, and the reasons behind it."""

from __future__ import annotations

from collections.abc import Iterator

from algid.report.numbers import significant
from algid.report.text import joined, visible
from algid.report.verdict import LEAST_R2, WORST_R2, Verdict
from algid.track.result import StretchStatus, TrackResult
from algid.track.tables import half_text, mass_text

COLOURED = 4.0  # of the rows' variance: intervals twice as wide as the sensors' noise asks for
STRANGE = 1e4  # of the rows' variance: a real arm with friction reaches 6e3, another arm 5e4 and more
ALL_BUT = 0.99  # explained of the torque, beyond which such errors are those of very quiet sensors
MOST_NAMED = 4

STATUS_WORDS = {
    StretchStatus.WEAK_EXCITATION: "moves too little to be weighed",
    StretchStatus.NEGATIVE_MASS: "weighs less than nothing, which no payload does",
}


def verdict(result: TrackResult) -> Verdict:
    """Judge a track by its stretches, what it explains of the torque, and the arm's own result."""
    reasons = tuple(_reasons(result))
    told = _told(result)
    failure = _failure(result)
    if failure is not None:
        return Verdict("failed", f"Failed: {failure}; do not use these masses.", reasons)
    if reasons:
        return Verdict("reservations", f"With reservations: {told}, but {_counted(reasons)}.", reasons)
    return Verdict("good", f"Good: {told}.")


def _counted(reasons: tuple[str, ...]) -> str:
    more = len(reasons) - 1
    rest = "" if more == 0 else f", and there {'is one more reason' if more == 1 else f'are {more} more reasons'} below"
    return reasons[0].partition(": ")[0] + rest


def _told(result: TrackResult) -> str:
    stretches, changes = result.track.stretches, result.track.changes
    if len(stretches) == 1:
        return f"the payload does not change: {mass_text(stretches[0])} ± {half_text(stretches[0])} kg throughout"
    widest = max(stretches, key=lambda stretch: stretch.std)
    times = [f"{moment:.2f}" for moment in changes[:, 0]]
    when = f" at {joined(times)} s" if len(times) <= MOST_NAMED else ""
    how_often = "once" if len(times) == 1 else "twice" if len(times) == 2 else f"{len(times)} times"
    masses = [mass_text(stretch) for stretch in stretches]
    what = f"weighing {joined(masses)} kg" if len(masses) <= MOST_NAMED + 1 else f"in {len(masses)} stretches"
    return f"the payload changes {how_often}{when}, {what}, the least certain to ± {half_text(widest)} kg (95 %)"


def _failure(result: TrackResult) -> str | None:
    if result.track.explained < WORST_R2:
        share = f"{max(100 * result.track.explained, 0):.0f} %"
        return f"arm and payload explain only {share} of the torque: is it this arm, in these units?"
    if result.track.colour > STRANGE and result.track.explained < ALL_BUT:
        times = f"{result.track.colour**0.5:.0f} times"
        return f"arm and payload miss the torque by {times} its sensors' noise: is it this arm, in these units?"
    statuses = result.statuses
    negative = sum(status is StretchStatus.NEGATIVE_MASS for status in statuses)
    if 2 * negative >= len(statuses):
        return f"{_share(negative, len(statuses))} less than nothing: the arm's constants do not fit this log"
    if all(status is StretchStatus.WEAK_EXCITATION for status in statuses):
        return "the arm moves too little to weigh anything"
    return None


def _share(some: int, count: int) -> str:
    return "the payload weighs" if count == 1 else f"{some} of {count} stretches weigh"


def _reasons(result: TrackResult) -> Iterator[str]:
    for status, words in STATUS_WORDS.items():
        numbers = [str(place) for place, found in enumerate(result.statuses, start=1) if found is status]
        if numbers:
            many = len(numbers) > 1
            subject = f"stretch{'es' * many} {joined(numbers)}"
            yield f"{subject} {words.replace('moves', 'move').replace('weighs', 'weigh') if many else words}"
    if result.track.explained < LEAST_R2:
        yield f"arm and payload explain only {max(100 * result.track.explained, 0):.0f} % of the torque"
    if result.track.colour > COLOURED:
        wider = significant(float(result.track.colour) ** 0.5, 2)
        yield (
            f"the torque holds errors {wider} times its sensors' noise that the arm's model does not explain: "
            "intervals are wider by as much, and small changes go unseen"
        )
    if result.data_lost:
        yield "samples of the log are lost"
    if result.arm_sentence is not None:
        yield f"the arm's own result says: {visible(result.arm_sentence)}"
