"""The options of every command that reads a log: a profile, and flags that beat it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from algid.profile import Profile

ProfileFile = Annotated[
    Path | None, typer.Option("--profile", help="algid.toml that says what the log's names and units mean.")
]
Topic = Annotated[str | None, typer.Option(help="Topic with the joint states.")]
Joints = Annotated[str | None, typer.Option(help="The two joints, as NAME,NAME.")]
AngleUnit = Annotated[str | None, typer.Option(help="rad, deg, rev or counts.")]
TorqueUnit = Annotated[str | None, typer.Option(help='"N m", "mN m", A or mA.')]
Zero = Annotated[str | None, typer.Option(help="Where θ1 is nought: horizontal or hanging.")]
SecondAngle = Annotated[str | None, typer.Option(help="θ2 is relative (to link 1) or absolute.")]
Clock = Annotated[str | None, typer.Option(help="Stamps of the messages' header, or of the log.")]


def profile_from(file: Path | None, **flags: str | None) -> Profile | None:
    """The profile of a file with flags over it; None where neither is given.

    Raises
    ------
    SettingError
        If the file or a flag is wrong.
    """
    given = {name: value for name, value in flags.items() if value is not None}
    if file is None and not given:
        return None
    from algid.profile import Profile, load_profile, with_settings

    settings: dict[str, Any] = {}
    for name, value in given.items():
        if name == "joints":
            settings["joints"] = [part.strip() for part in value.split(",")]
        elif name == "angle_unit":
            settings |= {channel: {"unit": value} for channel in ("theta1", "theta2", "omega1", "omega2")}
        elif name == "torque_unit":
            settings |= {channel: {"unit": value} for channel in ("tau1", "tau2")}
        else:
            settings[name] = value
    return with_settings(load_profile(file) if file else Profile(), settings)
