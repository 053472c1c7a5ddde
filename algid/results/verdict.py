"""Whether to trust a result, by its statuses, intervals, residual and notices, or by the truth."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isclose
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pydantic import BaseModel, ConfigDict, Field

from algid.arm import CONSTANT_NAMES
from algid.base.criteria import SAME_LENGTH
from algid.base.errors import ResultError, SettingError
from algid.base.files import read_toml
from algid.base.names import outside, within
from algid.base.significance import SURE
from algid.base.text import counted, percent, significant, visible
from algid.model import CHOICES, EVERY_TERM
from algid.notices import (
    Notice,
    Remedy,
    Verdict,
    flat,
    graded,
    has_code,
    notes_of,
    of_codes,
    warnings_of,
)
from algid.options import flag
from algid.physics.parameters import BODY

if TYPE_CHECKING:
    from algid.results import Estimate, Result, TorquePrediction

LEAST_R2 = 0.9  # below, a tenth of the torque's power is not the model's
WORST_R2 = 0.5  # below, most of it is not: wrong angles, signs or units, or not this arm
MOST_CLIPPED = 2.0  # percent of the samples: with more, a torque that is cut off leads the reasons
LEAST_USABLE = 0.5  # share of the parameters that must have an estimate
WIDE = 0.2  # half an interval beyond a fifth of the estimate says little more than its size
LONGEST_COMMAND = 4_000  # characters: a command is there to be copied

UNSURE = (
    *("FROM_PRIOR", "WEAK_EXCITATION", "NOT_IDENTIFIABLE", "NOT_CONVERGED", "NOT_SIGNIFICANT"),
)
"""Statuses that are reasons for doubt, each with a message of its name."""
CAUSES = (
    "OTHER_JOINTS",
    "LOGS_APART:exchanged",
    "WRONG_CONVENTION",
    "FLIPPED_SIGN",
    "WRONG_ZERO",
    "EXTERNAL_EFFORT",
    "GRAVITY_COMPENSATED:arm",
    "LENGTH_CONTRADICTED",
    "LOGS_APART:unlike",
    "SENSOR_FAULT:angle",
    "SENSOR_FAULT:torque",
    "LOST_SAMPLES",
)
"""Notices that say why estimates would be wrong, the likeliest first: they lead the reasons."""


def judge(result: Result) -> Verdict:
    """The verdict on `result`."""
    failure, reasons = _failure(result), list[Notice]()
    for one in _reasons(result):
        if one not in reasons and one.text != failure:
            reasons.append(one)
    notes, command = notes_of(result.notices), _command(result, reasons)
    headline = _identified(result, praise=not reasons)
    return graded(headline, reasons, notes, failure=failure, command=command)


def _failure(result: Result) -> str | None:
    """Why the numbers must not be used, the first of the reasons for it; None without one."""
    statuses = {one.status for one in result.estimates.values()}
    if "NOT_CONVERGED" in statuses or (result.fit is not None and not result.fit.converged):
        return "the estimator did not converge"
    worse, broken = _unexplained(result), _broken_bounds(result)
    if "IMPLAUSIBLE" in statuses or worse:
        if has_code(result.notices, "OTHER_JOINTS") and not worse and not broken:
            return "other joints of the arm move"
        return next((one.text for one in worse + broken), "physics forbids these estimates")
    if result.payload and wrong_length(result.notices):
        return "a link length contradicts the arm's constants"
    if has_code(result.notices, "LOGS_APART:unlike"):
        return "the logs are not of one arm"
    asked = requested(result).values()
    usable = [one for one in asked if one.usable]
    # a number whose interval is merely around zero is none to use, nor has a prior measured one
    if {one.status for one in usable} <= {"NOT_SIGNIFICANT", "FROM_PRIOR"}:
        return "no parameter could be identified"
    if len(usable) < LEAST_USABLE * len(asked):
        return f"only {len(usable)} of {counted(len(asked), 'parameter')} could be identified"
    return None


def wrong_length(notices: Sequence[Notice]) -> bool:
    """Whether a given length is further from what is known of it than rulers differ."""
    for one in of_codes(notices, "LENGTH_CONTRADICTED"):
        known = one.numbers.get("stated", one.numbers.get("estimate"))
        if known is None or not isclose(one.numbers["given"], known, rel_tol=SAME_LENGTH):
            return True
    return False


def _broken_bounds(result: Result) -> list[Notice]:
    """The bounds of physics that the estimates break, the worst first."""
    broken = [] if result.fit is None else result.fit.broken_bounds
    notices = []
    for one in sorted(broken, key=lambda one: -(one.distance_sigma or 0.0)):
        distance = one.distance_sigma and significant(one.distance_sigma, 2)
        numbers = {"bound": visible(one.bound), "value": one.value, "distance": distance}
        notices.append(Notice("BROKEN_BOUND", numbers={"case": "free"} | numbers))
    return notices


def _unexplained(result: Result) -> list[Notice]:
    """Joints of whose torque most is not the model's, if there is something to explain.

    Where the likelihood stands that is noise, and where a parameter is open that is what it would
    make: a model fails only beside a constant there.
    """
    found = None if result.fit is None else result.fit.prediction
    if found is None:
        return []
    least = WORST_R2 if result.complete and has_code(result.notices, "REFUTED") else 0.0
    return [_explained(found, joint) for joint in found.unexplained(least)]


def _explained(found: TorquePrediction, joint: int) -> Notice:
    """How little of a joint's torque (1 or 2) is explained."""
    r2, numbers = found.r2[joint - 1], dict[str, object](case="mean", joint=joint)
    if r2 >= 0:
        numbers |= {"case": "part", "percent": 100 * r2, "band": found.band}
    return Notice("LITTLE_EXPLAINED", numbers=numbers)


def _reasons(result: Result) -> Iterator[Notice]:
    """Reasons for doubt in a result, the weightiest first."""
    doubts, fit = warnings_of(result.notices), result.fit
    causes = [one for cause in CAUSES for one in of_codes(doubts, cause)]
    implausible = any(one.status == "IMPLAUSIBLE" for one in result.estimates.values())
    if not causes and (implausible or _unexplained(result)):  # it failed
        yield Notice("UNKNOWN_CAUSE")
    yield from causes
    for one in of_codes(doubts, "SATURATED_EFFORT", "CLIPPED_TORQUE"):
        if one.numbers.get("percent", 0.0) > MOST_CLIPPED:
            yield one
    yield from of_codes(doubts, "REFUTED")  # why another estimator's numbers are reported
    asked = requested(result)
    for status in UNSURE:
        names = [visible(name) for name, one in asked.items() if one.status == status]
        record = not causes and not {*CONSTANT_NAMES}.isdisjoint(names)
        if names:
            yield Notice(status, numbers={"names": names, "record": record})
    wide = [
        f"{visible(name)} (±{percent(one.half, one.estimate)} %)"
        for name, one in asked.items()
        if one.status == "OK" and one.half and one.estimate and one.half > WIDE * abs(one.estimate)
    ]
    if wide:
        yield Notice("WIDE_INTERVAL", numbers={"names": wide})
    yield from _broken_bounds(result)
    if fit is not None:
        least, found = LEAST_R2, fit.prediction
        if fit.intervals == "likelihood":
            least = 0.0  # what is left of a torque is its sensors' noise
        if found is not None:
            yield from (_explained(found, one) for one in (1, 2) if found.r2[one - 1] < least)
    far = [
        f"{visible(row.parameter)} ({significant(distance, 2)} σ)"
        for row in result.table4
        if row.truth is not None
        and row.estimate is not None
        and row.std
        and (distance := abs(row.estimate - row.truth) / row.std) > SURE
    ]
    if far:
        yield Notice("FAR_FROM_TRUTH", numbers={"names": far})
    # those of the fit before those of a log
    yield from sorted(doubts, key=lambda one: bool(one.logs))


def requested(result: Result) -> dict[str, Estimate]:
    """The estimates that were asked for: without shrunk terms and what the logs have chosen.

    Such a term, or a payload's offset or inertia, is there for the sake of the others. That its own
    coefficients are small beside their error bars is no reason to doubt those. Phases are, since
    they say how the arm is bent.
    """
    model = result.torque_model
    if model is None:
        return result.estimates
    own = [*model.shrunk, *(one.name for one in BODY)]
    if model.chosen_by == "logs":
        for term in (EVERY_TERM[name] for name in CHOICES):
            own += () if term.sines else term.names
    return {name: result.estimates[name] for name in outside(result.estimates, own)}


def _identified(result: Result, *, praise: bool) -> str:
    """How many parameters are identified, by which estimator if it was not the requested.

    Of `praise` also how certain they are.
    """
    estimates, asked = result.estimates, replaced_estimator(result)
    identified = [one for one in estimates.values() if one.status == "OK"]
    share = "all" if len(identified) == len(estimates) else f"{len(identified)} of"
    have = f"{share} {counted(len(estimates), 'parameter')} are identified"
    if asked is not None and not praise:
        have += f" by the {visible(result.estimator)} estimator in place of the {asked} one"
    widths = {
        one.half / abs(one.estimate): name
        for name, one in requested(result).items()
        if one.half is not None and one.estimate
    }
    if praise and widths:
        widest = max(widths)
        half = significant(100 * widest, 2)
        have += f", the least certain, {visible(widths[widest])}, to ±{half} % (95 %)"
    return have


def replaced_estimator(result: Result) -> str | None:
    """The estimator that was asked for, where another one's estimates stand in the result."""
    asked = result.settings.get("estimator")
    return None if asked in (None, result.estimator) else visible(str(asked))


def share_text(share: float) -> str:
    """A share such as R² in percent, never rounded up to all."""
    return "over 99.99 %" if share > 0.9999 else f"{100 * share:.2f} %"


def _command(result: Result, reasons: Sequence[Notice]) -> str | None:
    """The command to run first: the first cause's remedy, or `algid inspect` without a cause.

    None where neither says more than the call that was made, or Python or a batch made it: the
    reason names the flags.
    """
    said = flat(result.profile)
    first = next(iter(of_codes(reasons, *CAUSES, "UNKNOWN_CAUSE")), None)
    if first is None:
        return None
    if first.code == "UNKNOWN_CAUSE":
        words = ["algid", "inspect", result.log.path, *Remedy(said).flags]
        return visible(shlex.join(words), LONGEST_COMMAND)
    remedy = first.remedy
    if remedy is None or "accept" in remedy.settings:  # to accept a cause mends nothing
        return None
    known = remedy.settings.items() <= (said | result.settings).items()
    return None if known else again(result, remedy)


def again(result: Result, remedy: Remedy) -> str | None:
    """The command line that made the result, with `remedy`; None where none did."""
    made = result.settings.get("command")
    if not isinstance(made, str):
        return None
    words = [*shlex.split(made), *remedy.flags]  # of a flag that stands twice the last one counts
    if flag("force") not in words:
        words.append(flag("force"))
    return visible(shlex.join(words), LONGEST_COMMAND)


@dataclass(frozen=True)
class Judged:
    """One parameter's error in percent beside its limit; None where there was no estimate."""

    parameter: str
    error: float | None
    limit: float

    @property
    def passed(self) -> bool:
        """Whether there is an estimate and its error is within the limit."""
        return self.error is not None and self.error <= self.limit

    @property
    def text(self) -> str:
        """One line for the terminal."""
        word = "ok  " if self.passed else "OVER"
        size = "no estimate" if self.error is None else f"{self.error:.4g} %"
        return f"{word}  {self.parameter:12}  {size:>12}  limit {self.limit:.4g} %"


class _Tolerances(BaseModel):
    model_config = ConfigDict(extra="forbid")

    max_error_percent: dict[str, Annotated[float, Field(ge=0)]] = Field(min_length=1)


def judged_errors(result: Result, largest: float | str) -> list[Judged]:
    """Rows of Table 4 beside their limits.

    Parameters
    ----------
    result : Result
    largest : float, 'paper' or path
        One limit for all in percent; the paper's; or a TOML file with a table
        ``[max_error_percent]``.

    Raises
    ------
    SettingError
        If the file of limits cannot be read, or names a parameter that is no row of Table 4.
    ResultError
        If the result holds no truth to compare with, or no case of the paper.
    """
    log, limits = result.log.path, dict[str, float]()
    rows = {row.parameter: row for row in result.table4 if row.truth is not None}
    if not rows:
        raise ResultError(
            f"{log}: the log holds no true parameters; only synthetic logs can be checked"
        )
    if isinstance(largest, float):
        limits = dict.fromkeys(rows, largest)
    elif largest == "paper":
        for name, row in rows.items():
            if row.paper_error_percent is not None:
                limits[name] = row.paper_error_percent
        if not limits:
            raise ResultError(
                f"{log}: not a case of the paper; give {flag('max_error')} in percent"
            )
    else:
        limits = read_toml(Path(str(largest)), _Tolerances).max_error_percent
        for name in outside(limits, rows):
            raise SettingError(
                f"{largest}: max_error_percent.{name}: expected one of {', '.join(rows)}"
            )
    return [Judged(name, rows[name].error_percent, limits[name]) for name in within(rows, limits)]
