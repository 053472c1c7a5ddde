"""`algid identify`: from logs to parameters, payload and error bars."""

from __future__ import annotations

import shlex
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Literal

import typer

from algid.cli import EXIT_INCOMPLETE, profiles
from algid.cli.report import ResultFormat, print_result


class Estimator(StrEnum):
    """The estimators."""

    REFINED = "refined"
    WEAK = "weak"
    PAPER = "paper"


class Velocity(StrEnum):
    """Where joint velocities come from."""

    OBSERVER = "observer"
    MEASURED = "measured"


class Observer(StrEnum):
    """How joint velocities are observed."""

    LUENBERGER = "luenberger"
    ZERO_PHASE = "zero-phase"


class Friction(StrEnum):
    """Friction models."""

    VISCOUS = "viscous"
    COULOMB = "coulomb"


class Hold(StrEnum):
    """What the drive does between two torque samples."""

    FOH = "foh"
    ZOH = "zoh"


def identify(
    logs: Annotated[list[Path], typer.Argument(help="Logs of the arm without payload; loaded ones with --parameters.")],
    loaded: Annotated[
        list[Path] | None, typer.Option(help="A log of the arm with its payload; may be repeated.")
    ] = None,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the result folder LOG.algid.")] = Path(),
    estimator: Annotated[Estimator, typer.Option(help="How to estimate.")] = Estimator.REFINED,
    parameters: Annotated[
        Path | None, typer.Option(help="Result of the arm identified before: then LOGS are of the loaded arm.")
    ] = None,
    profile: profiles.ProfileFile = None,
    topic: profiles.Topic = None,
    joints: profiles.Joints = None,
    angle_unit: profiles.AngleUnit = None,
    torque_unit: profiles.TorqueUnit = None,
    zero: profiles.Zero = None,
    second_angle: profiles.SecondAngle = None,
    clock: profiles.Clock = None,
    velocity: Annotated[Velocity, typer.Option(help="Observe velocities, or use the log's own.")] = Velocity.OBSERVER,
    observer: Annotated[
        Observer | None, typer.Option(help="The paper's observer, or the zero-phase differentiator.")
    ] = None,
    poles: Annotated[
        str | None, typer.Option(help="Six poles of the paper's observer, rad/s, three a joint, like -80,-390,….")
    ] = None,
    window: Annotated[
        float | None,
        typer.Option(help="Window, s: the paper's integrals restart after it (2), or the weak form's (0.4)."),
    ] = None,
    bandwidth: Annotated[float, typer.Option(help="Of the zero-phase differentiator, Hz.")] = 60.0,
    gravity: Annotated[float, typer.Option(help="m/s²; 0 for an arm that moves in a horizontal plane.")] = 9.81,
    friction: Annotated[Friction, typer.Option(help="Viscous, or viscous and Coulomb.")] = Friction.VISCOUS,
    torque_offset: Annotated[bool, typer.Option("--torque-offset", help="Estimate an offset of each torque.")] = False,
    rotor_inertia: Annotated[bool, typer.Option("--rotor-inertia", help="Estimate joint 2's rotor inertia.")] = False,
    torque_hold: Annotated[Hold, typer.Option(help="Torque between samples: ramped or held.")] = Hold.FOH,
    delay: Annotated[str, typer.Option(help="From torque to angle, s, or 'estimate'.")] = "0",
    l1: Annotated[float | None, typer.Option("--l1", help="Length of link 1, m, where known.")] = None,
    l2: Annotated[float | None, typer.Option("--l2", help="Length of link 2, m, where known.")] = None,
    constrain: Annotated[bool, typer.Option("--constrain", help="Solve within the physical bounds.")] = False,
    cross_validate: Annotated[
        bool, typer.Option("--cross-validate", help="Predict each log from the others and report how well.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace a result that is there.")] = False,
    report: Annotated[bool, typer.Option(help="Write pages and time series beside result.json.")] = True,
    output: Annotated[ResultFormat, typer.Option("--format", help="What to print.")] = ResultFormat.TABLE,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Identify an arm's constants k1 … k7 and, with loaded logs, its payload; write LOG.algid.

    Exit code 3 tells that a parameter could not be identified or that samples were lost.

    Example: algid identify run-unloaded.mcap --loaded run-loaded.mcap -o results
    """
    from algid.pipeline.identify import identify as run
    from algid.pipeline.settings import Settings
    from algid.results import read_result

    settings = Settings(
        estimator=estimator.value,
        velocity=velocity.value,
        observer=None if observer is None else observer.value,
        window=window,
        bandwidth=bandwidth,
        gravity=gravity,
        friction=friction.value,
        torque_offset=torque_offset,
        rotor_inertia=rotor_inertia,
        torque_hold=torque_hold.value,
        delay=_delay(delay),
        l1=l1,
        l2=l2,
        constrain=constrain,
        cross_validate=cross_validate,
        **({} if poles is None else {"poles": _poles(poles)}),
    )
    known = None if parameters is None else read_result(parameters)
    bare, burdened = (logs, loaded or []) if known is None else ([], [*logs, *(loaded or [])])
    meaning = profiles.profile_from(
        profile,
        topic=topic,
        joints=joints,
        angle_unit=angle_unit,
        torque_unit=torque_unit,
        zero=zero,
        second_angle=second_angle,
        clock=clock,
    )
    command = shlex.join(["algid", *sys.argv[1:]])
    result = run(
        bare,
        burdened,
        settings,
        parameters=known,
        profile=meaning,
        out=out,
        force=force,
        report=report,
        command=command,
    )
    if not quiet:
        print_result(result, output)
    if not result.complete or result.data_lost:
        raise typer.Exit(EXIT_INCOMPLETE)


def _delay(text: str) -> float | Literal["estimate"]:
    from algid.errors import SettingError

    if text == "estimate":
        return "estimate"
    try:
        return float(text)
    except ValueError:
        raise SettingError(f"--delay: expected seconds or 'estimate', found {text!r}") from None


def _poles(text: str) -> tuple[complex, ...]:
    """Six poles out of text; complex ones like -80+20j."""
    from algid.errors import SettingError
    from algid.observers import observer_gain

    like = "give six like -80,-390,-391,-392,-393,-394"
    try:
        poles = tuple(complex(part.strip()) for part in text.split(","))
    except ValueError:
        raise SettingError(f"--poles {text}: expected numbers between commas; {like}") from None
    try:
        observer_gain(poles)
    except ValueError as error:
        raise SettingError(f"--poles {text}: {error}; {like}") from None
    return tuple(pole.real if pole.imag == 0 else pole for pole in poles)
