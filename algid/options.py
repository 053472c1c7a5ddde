"""What a user can set, one entry an option: its name, who takes it, its help and its range.

Whatever must know an option reads this table: the flags and the help of the command line, the
fields of `Settings` and of `Profile`, Python's keywords, the remedies of notices and the messages
of errors. None of them spells a flag: they name the option, and `flag` writes it. Types and
defaults stand where Python checks them: at the fields, and in the signatures of the verbs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from algid.limits import PHYSICAL, Range
from algid.units import names_of

SETTINGS, PROFILE = "settings", "profile"
"""Takers of an option beside the verbs: how to identify, and what a log means."""


@dataclass(frozen=True)
class Option:
    """An option.

    Parameters
    ----------
    name : str
        As Python and a profile have it.
    of : tuple of `SETTINGS`, `PROFILE` and names of verbs
        Who takes it. Options of one name that mean different things are different entries.
    help : str
        What the command line says of it; the verbs' own stand with their commands.
    range : pair of float, or None
        The least and the largest value of a number.
    open : str or pair of str
        What stands for a value that only the user knows.
    model : bool
        Whether it is of the arm's model, and not of the method.
    kind : type
        What the command line takes where that is not stated by a field's annotation.
    channels : names of channels
        Whose unit it sets: it is no field of a profile, but stands for one in each channel.
    typed : str
        How it is typed where that is not its long flag.
    """

    name: str
    of: tuple[str, ...]
    help: str = ""
    range: Range | None = None
    open: str | tuple[str, ...] = ""
    model: bool = False
    kind: object = str
    channels: tuple[str, ...] = ()
    typed: str = ""


def _either(names: Sequence[str]) -> str:
    """Names as a command line takes them, the last behind "or"."""
    words = []
    for name in names:
        if " " in name:
            name = f'"{name}"'
        words.append(name)
    return f"{', '.join(words[:-1])} or {words[-1]}."


_LENGTH: Range = (1e-3, 1e3)
_MASS: Range = (1e-6, 1e6)
_NOISE: Range = (1e-12, PHYSICAL.noise[1])
_SEED: Range = (0, 2**63)
_LARGEST: Range = (0, 1e9)
_BOTH = (SETTINGS, PROFILE)
_FIT, _LOG = (SETTINGS,), (PROFILE,)
_DESIGN, _SYNTH, _EXPORT, _BATCH = ("design",), ("synth",), ("export",), ("batch",)

OPTIONS: tuple[Option, ...] = (
    # how to identify
    Option("estimator", _FIT, "How to estimate."),
    Option("velocity", _FIT, "Observe velocities, or use the log's own."),
    Option("observer", _FIT, "The paper's observer, or the zero-phase differentiator."),
    Option(
        "poles",
        _FIT,
        "Six poles of the paper's observer, rad/s, three a joint, like -80,-390,….",
    ),
    Option(
        "window",
        _FIT,
        "Window, s: the paper's integrals restart after it (2), or the weak form's (0.4).",
        range=PHYSICAL.window,
    ),
    Option("bandwidth", _FIT, "Of the zero-phase differentiator, Hz.", range=PHYSICAL.bandwidth),
    Option(
        "gravity",
        _BOTH,
        "m/s², 9.81 by default; 0 for an arm that moves in a horizontal plane.",
        range=PHYSICAL.gravity,
        model=True,
    ),
    Option("effort", _BOTH, "What the driver logs as torque; by default raw.", model=True),
    Option(
        "model",
        _FIT,
        "Terms of the torque: auto (chosen by the logs), plain (none), or some of <terms>, like "
        "coulomb,rotor.",
        model=True,
    ),
    Option(
        "torque_hold",
        _FIT,
        "Torque between samples: told by the logs, ramped or held.",
        model=True,
    ),
    Option(
        "delay",
        _FIT,
        "From torque to angle, s, where known; --model delay estimates it.",
        range=PHYSICAL.delay,
        model=True,
    ),
    Option(
        "l1",
        _FIT,
        "Length of link 1, m, where known.",
        range=PHYSICAL.length,
        open="M",
        model=True,
    ),
    Option("l2", _FIT, "Length of link 2, m, where known.", range=PHYSICAL.length, model=True),
    Option(
        "payload_mass",
        _FIT,
        "Mass of the payload, kg, where known: tells the gain of the torques.",
        range=PHYSICAL.mass,
    ),
    Option("constrain", _FIT, "Solve within the physical bounds."),
    Option("cross_validate", _FIT, "Predict each log from the others and report how well."),
    # what a log means
    Option(
        "profile",
        _LOG,
        "algid.toml that says what the log's names and units mean.",
        kind=Path,
    ),
    Option("topic", _LOG, "Topic with the joint states.", open="NAME"),
    Option("joints", _LOG, "The two joints, as NAME,NAME.", open=("A", "B")),
    Option(
        "rate",
        _LOG,
        "Samples a second, Hz, of a table without a time.",
        range=PHYSICAL.rate,
        open="HZ",
    ),
    Option("columns", _LOG, "Names of the columns of a CSV without a header, as t,theta1,…."),
    Option(
        "angle_unit",
        _LOG,
        _either(names_of("angle")),
        channels=("theta1", "theta2", "omega1", "omega2"),
    ),
    Option("torque_unit", _LOG, _either(names_of("torque", "current")), channels=("tau1", "tau2")),
    Option("zero", _LOG, "Where θ1 is zero: horizontal, hanging or upright."),
    Option("second_angle", _LOG, "θ2 is relative (to link 1) or absolute."),
    Option("drive", _LOG, "Where the second motor stands: in its joint, or at the base."),
    Option("passive", _LOG, "The joint without a motor, 1 or 2: its torque is zero."),
    Option("clock", _LOG, "Stamps of the messages' header, or of the log."),
    Option("start", _LOG, "Leave out what comes before, s since the log's first sample.", open="S"),
    Option("end", _LOG, "Leave out what comes after, s since the log's first sample.", open="S"),
    Option(
        "torque_file",
        _LOG,
        "File with the torques, where LOG has none: joined on the stamps.",
        open="FILE",
        kind=Path,
    ),
    Option(
        "segment",
        _LOG,
        "One run alone, 1 for the first, where the log's time starts again.",
        open="N",
    ),
    Option("accept", _LOG, "Checks that may warn but not refuse, as CODE,CODE."),
    Option(
        "set",
        _LOG,
        "Any setting of a profile, as tau1.sign=-1; may be repeated.",
        kind=list[str],
    ),
    # what the verbs take beside them
    Option("loaded", ("identify", "validate")),
    Option("name", ("identify",)),
    Option("parameters", ("identify", "batch", "track")),
    Option("report", ("identify", "batch")),
    Option("export", ("identify", "track", "report")),
    Option("verbose", ("identify",)),
    Option("workers", _BATCH, range=(1, 4096)),
    Option("scheduler", _BATCH),
    Option("memory_limit", _BATCH),
    Option("timeout", _BATCH, range=(1e-3, 1e7)),
    Option("retry_failed", _BATCH),
    Option("part", _BATCH),
    Option("watch", _BATCH),
    Option("max_nrmse", ("validate",), range=_LARGEST),
    Option("simulate", ("validate",)),
    Option("against", ("check",)),
    Option("max_error", ("check",), range=_LARGEST),
    Option("tolerance_file", ("check",)),
    Option("shared_library", ("report",)),
    Option("l1", ("export", "track", "design"), range=_LENGTH),
    Option("l2", ("export", "track", "design"), range=_LENGTH),
    Option("to", _EXPORT),
    Option("m1", _EXPORT, range=_MASS),
    Option("m2", _EXPORT, range=_MASS),
    Option("rotor1", _EXPORT, range=(0, 1e6)),
    Option("flange", _EXPORT),
    Option("draws", _EXPORT, range=(1, 100_000)),
    Option("limits", _DESIGN),
    Option("range", _DESIGN),
    Option("speed", _DESIGN),
    Option("acceleration", _DESIGN),
    Option("torque", _DESIGN),
    Option("tip_height", _DESIGN, range=(-1e6, 1e3)),
    Option("duration", _DESIGN, range=(0.5, 120)),
    Option("rate", _DESIGN, range=(20, 1e5)),
    Option("runs", _DESIGN),
    Option("for", _DESIGN),
    Option("position_noise", _DESIGN, range=_NOISE),
    Option("torque_noise", _DESIGN, range=_NOISE),
    Option("noise_from", _DESIGN),
    Option("prior_error", _DESIGN, range=(0, 100)),
    Option("payload", _DESIGN, range=_MASS),
    Option("margin", _DESIGN, range=(0, 0.5)),
    Option("joints", _DESIGN),
    Option("seed", ("export", "design", "synth"), range=_SEED),
    Option("rate", _SYNTH, range=PHYSICAL.rate),
    Option("duration", _SYNTH, range=PHYSICAL.duration),
    Option("torque", _SYNTH),
    Option("motion", _SYNTH),
    Option("torque_hold", _SYNTH),
    Option("initial", _SYNTH),
    Option("position_noise", _SYNTH, range=PHYSICAL.noise),
    Option("torque_noise", _SYNTH, range=PHYSICAL.noise),
    Option("encoder_bits", _SYNTH, range=(4, 32)),
    Option("jitter", _SYNTH, range=PHYSICAL.noise),
    Option("drop", _SYNTH, range=(0, 0.9)),
    Option("start_time", _SYNTH),
    Option("payload_schedule", _SYNTH),
    Option("out", ("all",), typed="-o"),
    Option("force", ("all",)),
    Option("quiet", ("all",)),
    Option("format", ("all",)),
)
"""Each taker's in the order of its help."""

BY_TAKER: Mapping[tuple[str, str], Option] = {
    (taker, one.name): one for one in OPTIONS for taker in one.of
}
FLAGS: Mapping[str, str] = {
    one.name: one.typed or "--" + one.name.replace("_", "-") for one in OPTIONS
}
"""Each option as it is typed, for format strings: ``{flag[l1]}``."""


def options_of(taker: str) -> tuple[Option, ...]:
    """The options that `SETTINGS`, `PROFILE` or a verb takes, in their order."""
    return tuple(one for one in OPTIONS if taker in one.of)


def names_taken(*takers: str) -> tuple[str, ...]:
    """The names of the options that all of `takers` take."""
    return tuple(one.name for one in OPTIONS if set(takers) <= set(one.of))


def range_of(taker: str, name: str) -> Range:
    """The least and the largest value of a number that `taker` takes.

    Raises
    ------
    KeyError
        If it takes no such number.
    """
    bounds = BY_TAKER[taker, name].range
    if bounds is None:
        raise KeyError(f"{taker}: {name} has no range")
    return bounds


def flag(name: str, *, off: bool = False) -> str:
    """An option as it is typed: the one place that writes flags.

    Parameters
    ----------
    name : str
    off : bool
        Whether it is switched off.

    Raises
    ------
    KeyError
        If there is no option of that name.
    """
    if off:
        return FLAGS[name].replace("--", "--no-")
    return FLAGS[name]
