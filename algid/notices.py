"""What algid has noticed: a code with its numbers and what mends it.

Whoever shows it writes the words.

A `Notice` is data: nobody searches, cuts or compares its text. A `Remedy` holds settings by name
and value, which are written as flags for the command that was typed, or as Python's keywords.
"""

from __future__ import annotations

import json
import re
import shlex
import string
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from algid.options import BY_SET, FLAGS, VALUES, flag
from algid.text import joined
from algid.words import counted


def _own(name: str, value: object) -> bool:
    """Whether a setting has a flag of its own; any other is one of a profile, behind ``--set``.

    A profile's `velocity` is true or false and has none: the option says where velocities are from.
    """
    return "." not in name and name not in BY_SET and not isinstance(value, bool)


@dataclass(frozen=True, repr=False)
class Remedy:
    """Settings that mend what a notice is of, by name: ``zero``, ``tau1.sign``.

    None stands for the user's own value.

    `when` is the case that it is meant for, in words.
    """

    settings: Mapping[str, Any] = field(hash=False)
    when: str = ""

    @property
    def complete(self) -> bool:
        """Whether every value is known, so that a command with it can be run."""
        return all(value is not None for value in self.settings.values())

    @property
    def flags(self) -> tuple[str, ...]:
        """As words of a command line."""
        words: list[str] = []
        for name, value in self.settings.items():
            shown = _shown(name, value)
            if _own(name, value):
                if isinstance(shown, list | tuple):
                    shown = ",".join(map(str, shown))
                words += [flag(name), str(shown)]
            else:
                plain = value is None or (isinstance(value, str) and value.isalpha())
                if not plain:
                    shown = _toml(name, value)
                words += [flag("set"), f"{name}={shown}"]
        return tuple(words)

    @property
    def keywords(self) -> dict[str, Any]:
        """As Python's keywords, a channel's settings in a dictionary of their own."""
        keywords: dict[str, Any] = {}
        for name, value in self.settings.items():
            channel, dot, key = name.partition(".")
            if dot:
                keywords.setdefault(channel, {})[key] = value
            else:
                keywords[name] = value
        return keywords

    @property
    def words(self) -> str:
        """Its flags as a shell takes them."""
        return " ".join(map(_quoted, self.flags))

    def __str__(self) -> str:
        return f"{self.when}: {self.words}" if self.when else self.words

    def __repr__(self) -> str:
        text = ", ".join(f"{name}={value!r}" for name, value in self.keywords.items())
        return text.replace("'", '"')


def _quoted(word: str) -> str:
    """A word as a shell takes it; what stands in plain quotation marks stays as it reads best."""
    if _IN_MARKS.fullmatch(word):
        return word
    return shlex.quote(word)


_IN_MARKS = re.compile(r'[\w.]+="[\w ]+"')


def _shown(name: str, value: Any) -> Any:
    """A value, or what stands for one that only the user knows."""
    if value is not None:
        return value
    return VALUES.get(name.rpartition(".")[2], "VALUE")


def _toml(name: str, value: Any) -> str:
    if value is not None:
        return json.dumps(value, ensure_ascii=False)
    shown = _shown(name, value)
    if isinstance(shown, tuple) or name.endswith(("source", "topic", "time", "file")):
        return json.dumps(shown)
    return str(shown)


class _Words(string.Formatter):
    """Format strings: ``{count:# sample has|samples have}`` takes its number, lists are joined."""

    def format_field(self, value: Any, spec: str) -> str:
        """One value as `spec` has it."""
        if spec[:1] == "~":
            return self._where_there_is_one(value, spec[1:])
        if "|" in spec:
            shown, _, words = spec.rpartition("# ")
            one, many = words.split("|")
            count = value
            if isinstance(value, list | tuple):
                count = len(value)
            if words != spec:
                return shown + counted(count, one, many)
            if count == 1:
                return one
            return many
        if isinstance(value, list | tuple):
            return joined(list(map(str, value)))
        return str(format(value, spec))

    def _where_there_is_one(self, value: Any, spec: str) -> str:
        """What stands behind ``~``, # for the value; empty where that is 0, None or empty."""
        if not value:
            return ""
        if "|" in spec:
            return self.format_field(value, spec)
        return spec.replace("#", str(value))


MESSAGES: Mapping[str, str | Mapping[str, str]] = {
    # of estimates
    "NOT_IDENTIFIABLE": "{names} {names:is|are} not identifiable{record:~: #}",
    "NOT_SIGNIFICANT": "{names} {names:is|are} not significant: zero lies within the 95 % interval",
    "WEAK_EXCITATION": "{names} {names:is|are} too weakly excited",
    "SINGULAR": "{names} {names:is|are} singular",
    "NOT_CONVERGED": "{names} {names:is|are} not converged",
    "WIDE_INTERVAL": "the 95 % interval of {names} is wide",
    "FAR_FROM_TRUTH": "{names} {names:lies|lie} far from the truth",
    "OPEN_DIRECTION": {
        "alone": "{names} is not determined{why}",
        "sum": "{names} only as a sum{why}",
        "difference": "{names} only as a difference{why}",
        "ratio": "{names} only as {ratio:.3g} times the first plus the second{why}",
        "several": "{names} only in {count:# combination|combinations}{why}",
    },
    # of a fit
    "LITTLE_EXPLAINED": "the model explains only {percent:.0f} % of the torque of joint "
    "{joint}{band}",
    "WORSE_THAN_MEAN": "the model predicts the torque of joint {joint} worse than its mean does",
    "BROKEN_BOUND": "the estimates break {bound} by {distance}",
    "NOT_WHITE": (
        "the residual of {names} is autocorrelated, and the intervals assume white noise"
    ),
    "UNKNOWN_CAUSE": (
        "angles, signs, units or the order of the joints are not what algid took them for, or the "
        "logs are of another "
        "arm"
    ),
    "REFUTED": (
        "residual torque is larger and more autocorrelated than sensor noise (unmodelled "
        "dynamics): the maximum-likelihood fit is rejected, and the {kept} estimate with robust "
        "intervals is reported"
    ),
    "MISFIT": (
        "the residual torque of the maximum-likelihood fit depends on the motion (unmodelled "
        "dynamics): the fit is rejected, and the {kept} estimate with robust intervals is "
        "reported"
    ),
    "SHRUNK_TERMS": (
        "all optional torque terms are kept with a shrinkage prior (no term selection)"
    ),
    "INTEGRATION": (
        "the log has no noise: its own integration and sampling errors, {samples:.2g} of a "
        "sample, limit the intervals (up to {factor:.2g} times wider)"
    ),
    "HELD_TORQUE": (
        "the torque is zero-order held: it acts {late:.3g} ms after its stamp in the mean"
    ),
    "HOLD_UNTOLD": (
        "the logs leave open whether the torque is zero-order held ({half:.3g} ms mean delay): "
        "intervals cover both cases"
    ),
    "FASTER_CONTROLLER": (
        "the controller may run faster than the log: intervals allow for a torque delay of 0 to 1 "
        "ms"
    ),
    "UNLIKE_GAINS": (
        "the two torque channels disagree in scale: τ2/τ1 = {ratio:.3f} ± {half:.2g} (95 %); "
        "check both torque constants: if τ2 is right, all inertias and masses are larger by that "
        "factor"
    ),
    "JOINT_STILL": "{joints} never moved: give a log in which both joints do",
    "HEAVY_ARM": (
        "implausible mass ({mass:.3g} kg on a link of {length:.2g} m): check the torque unit"
    ),
    "MOTORLESS_INSTRUMENTS": (
        "friction of the passive joint biases least squares towards zero: the "
        "instrumental-variable estimate is reported"
    ),
    "MOTORLESS_UNTOLD": (
        "joint {joint} has no motor, and friction or cables pull on it as hard as its load: k1 … "
        "k5 are not determined; move it faster"
    ),
    "JOINTS_CONTRADICT": (
        "{name} is {first:.2g} {unit} from joint 1's equation alone and {second:.2g} from "
        "joint 2's: a torque constant is wrong, a joint is hardly driven, or a term is missing; "
        "check both constants, and give a log that drives both joints"
    ),
    "HARDLY_DRIVEN": (
        "joint {joint} is hardly driven (under {percent:.3g} % of the other joint's torque in "
        "every log): friction dominates; give a log that drives both"
    ),
    "BOUNDS_DOUBTED": (
        "the estimates break {bounds}, but an arm within the bounds explains the torques as well: "
        "a joint is hardly driven, and friction dominates; give logs that drive both joints"
    ),
    "CONSTRAINED": "{flag[constrain]} enforces {bounds}, which the logs contradict",
    "NOT_FEASIBLE": "{flag[constrain]} cannot obey {bounds}: no estimates within the bounds were "
    "found",
    "REFINED_FAILED": "the refined estimator did not converge, and the {kept} estimate with robust "
    "intervals is reported",
    "NO_GRAVITY": "without gravity k2 and k4 have no effect, and the payload has no weight",
    "INSTRUMENTS_STAND": (
        "unmodelled torque drives the motion (least squares is {distance:.1f} σ off), and the "
        "logged torque does not respond to it: the instrumental-variable estimate is reported"
    ),
    "REFERENCE_STANDS": (
        "unmodelled torque drives the motion (least squares is {distance:.1f} σ off): the "
        "instrumental-variable estimate by the logged reference is reported"
    ),
    "FEEDBACK": (
        "the logged torque responds to unmodelled torque (feedback, p = {p_value:.1g}), which "
        "biases least squares and instruments alike: constants may be off by more than their "
        "intervals; log the reference (q_des1, q_des2), or record with the torque commanded in "
        "open loop"
    ),
    "NO_PAYLOAD": "the payload is not significantly different from zero: at most {most:.3g} kg at "
    "95 %",
    "LENGTHS_NEEDED": "without link lengths a payload near zero is not determined: give "
    "{flag[l1]} and {flag[l2]}",
    "LENGTH_MISMATCH": (
        "g k1 / k2 makes l1 {length:.4g} ± {half:.2g} m, given are {given:g} m: gravity is "
        "compensated in part, or a "
        "zero, a sign or a term of the torque is wrong"
    ),
    "EXCHANGED_LOGS": (
        "the payload's mass is clearly negative: the loaded and the unloaded logs are exchanged"
    ),
    "LOGS_APART": (
        "the loaded and the unloaded logs are {distance:.1f} σ from belonging to one arm"
    ),
    "NO_CROSS_VALIDATION": "no cross-validation: a log is too short to be fitted, or to be judged",
    "ONE_RUN": (
        "run-to-run variation is not in the intervals: give four or more logs of different motions"
    ),
    "REPEATABILITY": (
        "the loaded runs by themselves weigh {masses} kg: repeatability {std:.2g} kg (95 %: "
        "{low:.2g} to {high:.2g})"
    ),
    "TORQUE_GAIN": (
        "by the known payload the torques have to be multiplied by {gain:.5g} (95 %: {low:.5g} to "
        "{high:.5g}), and with them k1 … k7, friction and masses"
    ),
    "NO_TORQUE_GAIN": (
        "the known payload does not determine the gain of the torques: its identified mass is not "
        "significant"
    ),
    # of logs
    "SAME_LOG": "{name} is the same log, byte for byte, and counts once",
    "SAME_LOG_LOADED": (
        "{name} is {twin}, byte for byte: one log is given as unloaded and as loaded, which makes "
        "the payload zero"
    ),
    "OTHER_ARM": "its metadata name another arm than {first}",
    "READ_OTHERWISE": "read otherwise than the log of {file}: {differences}",
    "DATA_LOST": "samples of the log are lost",
    "FLIPPED_SIGN": "gravity pulls upwards (k4 = {weight:.3g} N m): the sign of torques or angles "
    "is wrong",
    "WRONG_ZERO": "gravity is turned by about {turn:.0f}°: θ1 is not from the horizontal",
    "GRAVITY_COMPENSATED": (
        "torques carry no weight of the arm: they are gravity-compensated, or the arm moves in a "
        "horizontal plane"
    ),
    "WEIGHT_OF_PAYLOAD": (
        "torques carry the payload's weight and not the arm's: they are taken as "
        "gravity-compensated, without k2 and k4"
    ),
    "PAYLOAD_WEIGHTLESS": (
        "torques do not carry the payload's weight either: only its inertia is left, which "
        "determines its mass where a length is known"
    ),
    "EXTERNAL_EFFORT": (
        "logged torques contain the payload only, not the arm: the driver logs external torque"
    ),
    "NO_FRICTION": (
        "torques contain no friction: they are friction-compensated, or the joints have none"
    ),
    "WRONG_CONVENTION": ("{wrong} by the equations of motion (as read, {contradiction})"),
    "ZERO_OFFSET": "{wrong}, or a centre of mass lies as far off its link's line",
    "PHASES": (
        "θ1's zero against gravity is off by {first}, joint 1's load lies {load} off link 1's "
        "line, and {second} is θ2's zero or link 2's centre of mass, which torque does not "
        "distinguish (95 %)"
    ),
    "PHASE": (
        "{second} is θ2's zero or link 2's centre of mass, which torque does not distinguish (95 %)"
    ),
    "RESTS": (
        "the arm rests {rests}; where friction holds it there, the torque is not that of the "
        "weight: leave the rest out"
    ),
    "LOST_SAMPLES": (
        "{count:# step of the angles is|steps of the angles are} twice as long as usual, though "
        "the stamps are even: "
        "samples were lost and the others renumbered, so that no estimate can be right; take the "
        "stamps of the "
        "messages, or record without losses"
    ),
    # of readers
    "COMMANDED_TORQUE": "torques are commanded ones ({columns}): no measured torque in the log",
    "FOREIGN_UNIT": (
        "the column {column!r} for {name} states the unit {unit!r}, and is taken for {given} as "
        "configured"
    ),
    "STATED_UNUSED": {
        "line": "the file says {said}, which was not used",
        "rate": "the file says {said}, and its stamps {rate:.4g} Hz, which are used",
        "columns": (
            "{column!r} has the values {values}, and was not used: samples may be of several arms "
            "or recordings"
        ),
        "setting": "given and of no use for this log: {said}",
    },
    "CURRENT_AS_TORQUE": (
        "{column!r} for {name} is a current by its name, and is taken for a torque in {given} as "
        "configured"
    ),
    "PASSIVE_TORQUE": (
        "{column!r} holds a torque of {percent:.2g} % of the other joint's at joint {joint}, which "
        "is called passive: it is not used, and estimates lack it where a motor makes it; leave "
        "out {flag[passive]} then"
    ),
    "MOTOR_SIDE": "{columns}: signals of motors, taken for those of joints",
    "OTHER_UNIT": (
        "the file states the unit {unit} for {name} ({column!r}), which is taken for {taken}, {why}"
    ),
    "JOINT_ORDER": "joint 1 is {first!r} and joint 2 {second!r}, {why}",
    "OTHER_JOINTS": (
        "{count:# other joint moves|other joints move} meanwhile: {joints} (in the first "
        "{samples:# sample|samples}); their reaction torques are not modelled: keep them fixed "
        "while recording"
    ),
    "TOPIC_CHOICE": "the joints are taken from {topic!r}; there are two also on {others}",
    "NO_TOPIC": "{file}: topic {topic!r} is not in this file",
    "LOG_TIME": "header stamps of {topic!r} stand still at {stamp} ns: the recorder's times are "
    "taken",
    "LACKING_MESSAGES": "{count:# message|messages} on {topic!r} left out for want of {fields}",
    "OTHER_MESSAGES": "{count:# message|messages} on {topic!r} left out: of other joints",
    "MISFIT_MESSAGES": (
        "{count:# message|messages} on {topic!r} of another form than the schema says; the first: "
        "{first}"
    ),
    "OTHER_TYPE": (
        "topic {topic!r} also carries messages of another type or definition ({types}); they were "
        "not read"
    ),
    "STRAY_MESSAGES": "{count:# message|messages} of no topic that the table 'topics' lists; left "
    "out",
    "MISSING_MESSAGES": "the file counts {promised:# message|messages} and holds {found}",
    "CUT_OFF": {
        "row": "the last row, row {row:,}, breaks off and was dropped",
        "lines": (
            "the file breaks off: {bytes:# byte|bytes} behind its last whole line, NUL bytes at "
            "their end, left out"
        ),
        "record": ("the file breaks off: an unfinished record of {bytes:# byte|bytes}, left out"),
        "chunk": (
            "the file breaks off: an unfinished chunk of {bytes:# byte|bytes}, read as far as it "
            "goes"
        ),
        "end": "the file breaks off behind its last whole record",
    },
    "DAMAGED_CHUNK": {
        "chunk": (
            "{count:# damaged chunk|damaged chunks} left out; the first: {why}"
            "{missing:~; # message is missing|messages are missing}"
        ),
        "row": (
            "{count:# damaged row|damaged rows} left out; the first: {why}"
            "{missing:~; # message is missing|messages are missing}"
        ),
    },
    "TORN_CHUNK": (
        "the last chunk breaks off: {taken:# message|messages} taken from its first {held} of "
        "{bytes:# byte|bytes}{lost:~, about # is lost|are lost}; they could not be checked, since "
        "the chunk's checksum covers all of it"
    ),
    "NO_CHECKSUM": {
        "file": "the file has no checksums: damaged values would go unseen",
        "values": "the file has no sums of its values, as algid's have: changes would go unseen",
    },
    "BROKEN_RECORD": (
        "from byte {first} on the file is damaged ({why}): {bytes:# byte|bytes} left out; "
        "mcap recover may bring more of them back"
    ),
    "MISSING_SPLIT": "{missing} of {files:# file|files} of the bag missing: {names}",
    "NO_INDEX": "the file has no usable index; read by scanning",
    "DAMAGED_SUMMARY": "the file's summary cannot be used ({why}); read by scanning",
    "NOT_FINITE": "{count:# sample holds|samples hold} a number that is not finite; left out",
    "CUT": ("{count:# sample|samples} before {start:g} s or behind {end} left out, as configured"),
    "UNSORTED_STAMPS": "{count:# sample|samples} came late, now in order",
    "DUPLICATE_STAMPS": (
        "{count:# sample repeats|samples repeat} a stamp; the first of each was kept{others}"
    ),
    "REFERENCE_LEFT_OUT": "the reference on {topic!r} is left out: {why}",
    "ALIGNED": (
        "{topic!r} ({rate:.6g} Hz) was interpolated; error, root mean square, in the log's units: "
        "{error}"
    ),
    "NOT_COVERED": (
        "{count:# sample was|samples were} dropped, where another topic or file has none"
    ),
    "OVERLAP": (
        "{count:# sample lies|samples lie} before or behind what {file} holds, and "
        "{count:is|are} left out"
    ),
    "TIME_UNIT": "times are taken for {unit}, from their size and their steps",
    "SLOW_CLOCK": (
        "times in {column!r} are taken for {unit}, which makes {rate:.3g} Hz, too slow for an arm "
        "in motion"
    ),
    "NO_LINE_END": (
        "the last row has no line end: its last number may be cut off, so the row was left out"
    ),
    "EMPTY_CELLS": "{count} of {rows:# row|rows} dropped for want of a value",
    # of checks
    "EFFORT_ZERO": "{channel} is zero in every sample",
    "EFFORT_DENORMAL": "{channel} never exceeds {largest:.3g} N m: no torque",
    "EFFORT_CONSTANT": "{channel} is {value:.6g} N m in every sample",
    "DEGREES": {
        "signal": (
            "{what} of joint {joint} are in degrees by the other signal{unit:~; they are taken "
            "for # as configured}"
        ),
        "reach": (
            "angles reach {largest:.4g}: few arms turn that far in rad{unit:~; they are taken for "
            "# as configured}"
        ),
    },
    "HELD_EFFORT": (
        "{channel} keeps each value for {held:.3g} ms while the angle moves: it is {late:.3g} ms "
        "late in the mean, and "
        "inertia and friction take up what that makes"
    ),
    "SATURATED_EFFORT": {
        "open": "{channel} stands at its limit in {percent:.3g} % of the samples",
        "true": (
            "{channel} stands at its limit in {percent:.3g} % of the samples, and the motion "
            "agrees: it is what the joint got"
        ),
    },
    "CLIPPED_TORQUE": {
        "sensor": (
            "{channel} is cut off at {level:.4g} N m, where the motion implies more: the sensor "
            "reaches the end of its range; {count:# sample|samples} ({percent:.2g} %) left out"
        ),
        "drive": (
            "{channel} exceeds {level:.4g} N m, where the motion implies no more: the drive gives "
            "less than is logged; {count:# sample|samples} ({percent:.2g} %) left out"
        ),
    },
    "DEAD_EFFORT": (
        "{channel} stands still for {seconds:.3g} s from t = {start:.6g} s; leave that out"
    ),
    "ANGLE_CONSTANT": "{channel} is {value:.6g} rad in every sample",
    "WRAPPED_ANGLE": "{channel} jumps by a turn {count:# time|times}",
    "STUCK_SENSOR": "{channel} freezes for {seconds:.3g} s from t = {start:.6g} s, then jumps",
    "SPIKES": "{channel} has {count:# spike|spikes}, the first at t = {start:.6g} s",
    "SHORT_LOG": (
        "the log lasts {seconds:.3g} s; an estimate needs a second of motion at least, ten are "
        "better"
    ),
    "SLOW_SAMPLING": {
        "period": (
            "{samples:.2g} samples in a period of the motion at {rate:.4g} Hz: too slow to "
            "determine its acceleration; record faster, or move more slowly"
        ),
        "turn": (
            "a joint turns {turn:.2g} rad between samples, more than derivatives follow: the "
            "{kept} estimate with robust intervals is reported; record at more than {rate:.3g} Hz"
        ),
    },
    "NEAR_STAMPS": (
        "{count:# sample follows|samples follow} the one before by less than {share:g} of a "
        "period of "
        "{period:.4g} ms, as receipt times do: late ones go back to the period they are missing "
        "from, "
        "the mean stands for the others"
    ),
    "RESTARTS": ("time starts again {count:# time|times}: of {runs} runs {said}"),
    "GAPS": "{count:# gap|gaps}, the longest {seconds:.4g} s; no window spans one",
    "JITTER": (
        "stamps jitter by {jitter:.3g} ms about a period of {period:.4g} ms; resampling moves "
        "angles "
        "by {error:.2g} rad at most, linearly"
    ),
    # of tracks
    "STRETCHES_WEAK": "stretch{numbers:|es} {numbers} {numbers:moves|move} too little to be "
    "weighed",
    "STRETCHES_NEGATIVE": ("stretch{numbers:|es} {numbers}: negative payload mass"),
    "TORQUE_UNEXPLAINED": "arm and payload explain only {percent:.0f} % of the torque",
    "TORQUE_ERRORS": (
        "the torque has errors of {times} times its sensors' noise that the arm's model does not "
        "explain: intervals are wider by as much, and small changes go unseen"
    ),
    "ARM_DOUBTFUL": "the arm's own result is {grade}: {headline}",
    "LENGTH_CONTRADICTED": {
        "identified": (
            "{name} is given as {given:g} m, but identified as {estimate:.5g} ± {half:.2g} m "
            "({distance:.0f} σ apart)"
        ),
        "stated": (
            "{name} is given as {given:g} m, but the arm's result was made with {stated:g} m"
        ),
    },
    # of designs and fleets
    "TERMS_LEFT_OUT": (
        "the plan leaves out {terms}: where they are estimated too, error bars are somewhat "
        "larger than predicted"
    ),
    "DRIFTS": "{count:# drift|drifts}: {names}",
    "CHANGED": (
        "{robot} changed at once between {before} and {after}: {parameter} by {percent:+.2g} %"
        "{count:~; # change in all|changes in all}"
    ),
    "STAND_OUT": "{count:# log stands out|logs stand out}: {names}",
    "SCATTERED": (
        "{few} of {robots:# robot|robots} have {logs} logs or fewer, none at the same time: where "
        "their folders are sessions of one robot, name it in a manifest's column robot and run "
        "algid batch again."
    ),
    "NOT_TESTED": {
        "nameless": (
            "{count:# log|logs} left out for want of a robot: give each robot's logs their own "
            "folder, or name robots in a manifest."
        ),
        "undated": (
            "No drift was looked for in {count:# log|logs} without a date: stamps count from "
            "1970, or a manifest gives the time."
        ),
        "steady": (
            "Drift was not tested for {count:# robot|robots}: fewer than {least} dated logs "
            "within {months} months."
        ),
        "alone": ("Outliers were not tested for {count:# robot|robots}: fewer than {least} logs."),
    },
    "NOT_REACHED": ("no motion within the limits determines {names}"),
    "BROKEN_OFF": "the search was broken off: this is the best motion until then",
}
"""Text by code; of a code with several cases, by the number "case"."""
_ANYWHERE = "{accepted:~ (accepted by {flag[accept]})}{looked_at:~ (in its first # s)}"
"""What may stand behind the text of every code."""


def _text(code: str, numbers: Mapping[str, Any]) -> str:
    """What a notice says."""
    form = MESSAGES[code]
    if not isinstance(form, str):
        form = form[numbers["case"]]
    values = {"flag": FLAGS, "accepted": False, "looked_at": 0, "record": ""} | dict(numbers)
    return _Words().vformat(form + _ANYWHERE, (), values)


@dataclass(frozen=True)
class Notice:
    """Something that a user should know of a log or of a result.

    Parameters
    ----------
    code : a fixed word such as ``DUPLICATE_STAMPS``
    text : what was seen, in a clause; made of the numbers where `MESSAGES` has the code
    lossy : whether samples are missing from the log
    note : whether it says how things were done, and is no reason to doubt a result
    refuse : whether the log is not used for it
    numbers : what the text is made of
    remedies : what mends it, the likeliest first
    logs : names of the logs that it is of
    """

    code: str
    text: str = ""
    lossy: bool = False
    note: bool = False
    refuse: bool = False
    numbers: Mapping[str, Any] = field(default_factory=dict, hash=False)
    remedies: tuple[Remedy, ...] = ()
    logs: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.text:
            return
        try:
            object.__setattr__(self, "text", _text(self.code, self.numbers))
        except (LookupError, TypeError, ValueError) as error:
            raise ValueError(
                f"code {self.code!r:.60}: it has no text for the numbers {sorted(self.numbers)}"
            ) from error

    @property
    def remedy(self) -> Remedy | None:
        """The first remedy that can be applied as it stands."""
        for one in self.remedies:
            if one.complete:
                return one
        return None

    @property
    def advice(self) -> str:
        """What mends it, in flags, those of one case side by side; empty where nothing is known."""
        cases: dict[str, list[str]] = {}
        for one in self.remedies:
            cases.setdefault(one.when, []).append(one.words)
        return "; ".join(
            f"{case}: {' or '.join(of)}" if case else " or ".join(of) for case, of in cases.items()
        )

    @property
    def sentence(self) -> str:
        """Logs, text and advice in one clause."""
        return f"{_place(self.logs)}{self.clause}"

    @property
    def clause(self) -> str:
        """Text and advice."""
        if not self.remedies:
            return self.text
        return f"{self.text}: {self.advice}"

    def of(self, *logs: str) -> Notice:
        """The same of those logs."""
        return replace(self, logs=logs)


NAMED = 3  # logs that are named


def _place(logs: Sequence[str]) -> str:
    if not logs:
        return ""
    if len(logs) <= NAMED:
        return f"{', '.join(logs)}: "
    return f"{', '.join(logs[:1])} and {len(logs) - 1} more: "


def merged(notices: Iterable[Notice]) -> list[Notice]:
    """Of each code the first notice, with the logs of all of them.

    Each notice of lost samples stays.
    """
    together: dict[object, Notice] = {}
    for place, one in enumerate(notices):
        key: object = (one.code, one.note)
        if one.lossy:
            key = place
        if key in together:
            first = together[key]
            one = replace(first, logs=tuple(dict.fromkeys(first.logs + one.logs)))
        together[key] = one
    return list(together.values())


def flat(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings by their names with dots, as a `Remedy` has them; without those that are None."""
    by_name: dict[str, Any] = {}
    for name, value in settings.items():
        if isinstance(value, Mapping):
            for key, inner in value.items():
                by_name[f"{name}.{key}"] = inner
        elif value is not None:
            by_name[name] = value
    return by_name


def of_codes(notices: Iterable[Notice], *codes: str) -> list[Notice]:
    """Those of the notices that have one of the codes."""
    return [one for one in notices if one.code in codes]


def has_code(notices: Iterable[Notice], *codes: str) -> bool:
    """Whether a notice has one of the codes."""
    return bool(of_codes(notices, *codes))


def lossy(notices: Iterable[Notice]) -> bool:
    """Whether a notice says that data were lost."""
    return any(one.lossy for one in notices)


def warnings_of(notices: Iterable[Notice]) -> list[Notice]:
    """Those of the notices that make a result doubtful."""
    return [one for one in notices if not one.note]


def notes_of(notices: Iterable[Notice]) -> list[Notice]:
    """Those of the notices that say how things were read and done."""
    return [one for one in notices if one.note]


def from_flags(flags: Sequence[str]) -> Remedy:
    """The remedy that flags stand for, as results of an earlier schema hold them."""
    settings: dict[str, Any] = {}
    for word, value in zip(flags[::2], flags[1::2], strict=False):
        name, text = word.removeprefix("--"), value
        if word == flag("set"):
            name, _, text = value.partition("=")
        try:
            settings[name.replace("-", "_")] = json.loads(text)
        except json.JSONDecodeError:
            settings[name.replace("-", "_")] = text
    return Remedy(settings)
