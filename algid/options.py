"""What a command line calls a setting: the one place that writes flags.

A setting is a field of `algid.settings.Settings` or `algid.profile.Profile`, or a keyword of a
verb: its type, default, bounds and help are stated there, and the command line reads them. What is
seldom set has no flag of its own: ``--set NAME=VALUE`` sets it, like every line of a profile. What
version 0.2 had under another name is refused with what to do instead.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from algid.base.errors import SettingError

SET = "--set "
"""Before a setting without a flag of its own."""
ARGUMENTS, EVERYDAY, ADVANCED = "Arguments", "Options", "Advanced"
"""Panels of a command's help."""
EVERYDAY_FIELDS = ("angle_unit", "torque_unit", "joints", "zero", "cross_validate")
"""Of settings and profiles; the others are for seldom."""
SELDOM = ("export", "force", "name")
"""Of verbs; the others are for every day."""
TYPED = ("loaded", "out", "parameters", "to")
"""Keywords that a command line has by their flags, though Python takes them by their places too."""
BY_SET = frozenset(
    {
        *("acceleration", "bandwidth", "clock", "columns", "constrain", "delay", "drive", "drop"),
        *("encoder_bits", "initial", "jitter", "m1", "m2", "margin", "noise_from"),
        *("observer", "offsets", "passive", "poles", "prior_error", "rotor1", "segment"),
        *("shared_library", "signs", "start_time", "time", "time_unit", "tip_height", "velocity"),
        *("window",),
    }
)
"""Settings without a flag of their own."""
VALUES: Mapping[str, str] = {
    "joints": "A,B",
    **dict.fromkeys(("l1", "l2"), "M"),
    **dict.fromkeys(("topic", "source", "q_des", "time"), "NAME"),
    "rate": "HZ",
    **dict.fromkeys(("start", "end"), "S"),
    **dict.fromkeys(("torque_file", "prior"), "FILE"),
    **dict.fromkeys(("segment", "gear_ratio", "counts"), "N"),
    "offset": "RAD",
    "torque_constant": "K",
}
"""What stands for a value that only the user knows, by the last part of a setting's name."""


@dataclass(frozen=True)
class Option:
    """A keyword of a verb, or a field of `Settings` or `Profile`, as the command line has it.

    An annotation states what its type does not say, `algid.api.options.options_of` the rest.

    Parameters
    ----------
    kind : type
        What is typed, where Python takes more.
    panel : str
        Where help shows it.
    name : str
    help : str
        The first sentence of its entry in the docstring; its words where there is none.
    check : type
        What pydantic holds a value against, and makes of text; its words where there are any.
    default : object
        What a command takes where Python's default is None.
    suggested : callable
        Gives what completes it, where no type states that.
    words : list of str
        The words that it may be; none where it may be others.
    """

    kind: Any = None
    panel: str = ""
    name: str = ""
    help: str = ""
    check: Any = None
    default: Any = None
    suggested: Callable[[], Sequence[str]] | None = None
    words: Sequence[str] = ()

    @property
    def flag(self) -> str:
        """How it is typed."""
        return flag(self.name, off=self.default is True)

    @property
    def by_set(self) -> bool:
        """Whether it has no flag of its own."""
        return self.flag.startswith(SET)


def flag(name: str, *, off: bool = False) -> str:
    """A setting as it is typed.

    Parameters
    ----------
    name : str
    off : bool
        Whether it is switched off.
    """
    if name == "out":
        return "-o"
    if name in BY_SET or "." in name:
        return f"{SET}{name}"
    return f"--{'no-' if off else ''}{name.rstrip('_').replace('_', '-')}"


class _Flags(dict[str, str]):
    """Each setting as it is typed, for format strings: ``{flag[l1]}``."""

    def __missing__(self, name: str) -> str:
        return flag(name)


FLAGS: Mapping[str, str] = _Flags()

MOVED: Mapping[str, str] = {
    # commands
    "algid example": "algid synth example",
    "algid check": "algid validate RESULT --max-error 0.5",
    "algid fleet": "algid report BATCH",
    "algid profile": "algid inspect LOG --write-profile algid.toml",
    # flags
    "--report": "leave it out: pages are written by default",
    "--against": "--max-error paper, or --max-error PERCENT",
    "--tolerance-file": "--max-error FILE.toml",
    "--format=markdown": "--format json, or read report.md",
    "--to=yaml": "--to payload",
    "--save-plots": "the figure's own button saves it as SVG",
    "--plot-format": "the figure's own button saves it as SVG",
    "--install-completion": 'in ~/.bashrc: eval "$(_ALGID_COMPLETE=bash_source algid)"',
    "--show-completion": "_ALGID_COMPLETE=bash_source algid; or zsh_source, fish_source",
    # keywords of Python
    "synthesise(excitation=…)": "torque=, as the flag",
    "synthesise(kind=…)": "format=, as the flag",
    "write_log(kind=…)": "format=",
    "design(wanted=…)": "for_=, as the flag --for",
    "batch(profile_for=…)": "leave it out: keywords hold over each log's profile",
}
"""By the old name what stands in its place."""


def refuse_moved(call: str) -> None:
    """Refuse a call, of a command or of Python, that uses a name of version 0.2.

    Raises
    ------
    SettingError
        If the command, a flag or a keyword has moved: it says what to do instead.
    """
    by_set = {f"--{name.replace('_', '-')}": f"{flag(name)}=VALUE" for name in BY_SET}
    for name, now in {**MOVED, **by_set}.items():
        if f"{name} ".replace("=", " ") in f"{call} ".replace("=", " "):
            raise SettingError(f"{name} is not in this version; instead: {now}")
