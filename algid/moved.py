"""What version 0.2 had under another name, and what to do instead: commands, flags, keywords.

A flag that became a setting behind ``--set`` is not listed: `algid.options.BY_SET` names it.
"""

from __future__ import annotations

from collections.abc import Mapping

from algid.base.errors import SettingError
from algid.options import BY_SET, flag

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
