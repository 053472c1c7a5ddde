"""`algid design`: the motion of an identification run, planned within limits, its error bars known beforehand."""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from algid.cli.completion import cases
from algid.cli.output import console, remark, say
from algid.cli.settings import two_names
from algid.exits import Exit

if TYPE_CHECKING:
    from algid.designs.campaign import Campaign
    from algid.designs.prior import BelievedArm
    from algid.designs.request import Request
    from algid.estimators.whitening import NoiseLevels

RATE, DURATION = 1000.0, 10.0


class Drive(StrEnum):
    """What the arm is driven by."""

    POSITION = "position"
    TORQUE = "torque"


class Shown(StrEnum):
    """What is printed."""

    TABLE = "table"
    JSON = "json"


def design(
    prior: Annotated[
        str,
        typer.Argument(
            autocompletion=cases,
            help="Result folder of the arm, case1, case2, or a TOML file of the arm.",
        ),
    ],
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Folder for the folder PRIOR.design.")
    ] = Path(),
    limits: Annotated[
        Path | None,
        typer.Option(help="TOML file with range, speed, …, in the flags' words; flags beat it."),
    ] = None,
    span: Annotated[
        str | None,
        typer.Option(
            "--range", help="rad: 1.2 to both sides of hanging, 1.2,1.0, or LOW:HIGH,LOW:HIGH."
        ),
    ] = None,
    speed: Annotated[
        str | None, typer.Option(help="Largest speed, rad/s: 3, or 3,4 by joint.")
    ] = None,
    acceleration: Annotated[
        str | None, typer.Option(help="Largest acceleration, rad/s²; none by default.")
    ] = None,
    torque: Annotated[
        str | None, typer.Option(help="Largest torque, N m: 5, or 5,2 by joint.")
    ] = None,
    tip_height: Annotated[
        float | None,
        typer.Option(help="Lowest height of the tip over joint 1, m.", min=-1e6, max=1e3),
    ] = None,
    duration: Annotated[
        float | None, typer.Option(help="Length of a run, s; 10 by default.", min=0.5, max=120)
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(help="Samples a second of its log, Hz; 1000 by default.", min=20, max=1e5),
    ] = None,
    runs: Annotated[
        str | None, typer.Option(help="Runs without and with the payload, like 2,1.")
    ] = None,
    drive: Annotated[
        Drive, typer.Option(help="Position control, or open loop torque.")
    ] = Drive.POSITION,
    wanted: Annotated[
        str | None,
        typer.Option("--for", help="Parameters that matter, like k1,m_p; all by default."),
    ] = None,
    position_noise: Annotated[
        float | None,
        typer.Option(help="Noise of the angles, rad (standard deviation).", min=1e-12, max=1e3),
    ] = None,
    torque_noise: Annotated[
        float | None,
        typer.Option(help="Noise of the torques, N m (standard deviation).", min=1e-12, max=1e3),
    ] = None,
    noise_from: Annotated[
        Path | None, typer.Option(help="A log of the arm whose noise is taken.")
    ] = None,
    prior_error: Annotated[
        float | None,
        typer.Option(
            help="Share by which masses and friction may be wrong where no error bar tells; 0.2.",
            min=0,
            max=100,
        ),
    ] = None,
    payload: Annotated[
        float | None, typer.Option(help="Payload of the loaded runs, kg.", min=1e-6, max=1e6)
    ] = None,
    l1: Annotated[
        float | None,
        typer.Option("--l1", help="Length of link 1, m, where known.", min=1e-3, max=1e3),
    ] = None,
    l2: Annotated[
        float | None,
        typer.Option("--l2", help="Length of link 2, m, where known.", min=1e-3, max=1e3),
    ] = None,
    margin: Annotated[
        float, typer.Option(help="Share of every limit left unused.", min=0, max=0.5)
    ] = 0.05,
    joints: Annotated[str, typer.Option(help="Names of the robot's joints.")] = "joint1,joint2",
    seed: Annotated[int, typer.Option(help="Seed of the search.", min=0, max=2**63)] = 0,
    force: Annotated[bool, typer.Option("--force", help="Replace a design that is there.")] = False,
    form: Annotated[Shown, typer.Option("--format", help="What to print.")] = Shown.TABLE,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Plan the motion that tells most about an arm within its limits; write PRIOR.design.

    Ctrl-C ends the search early and keeps the best motion so far. Exit code 3 tells that a
    parameter stays open.

    Example: algid design case1 --range 1.2 --speed 3 --torque 1.5 --position-noise 1e-3
    --torque-noise 1e-2

    Raises
    ------
    typer.Exit
        With `Exit.FAILED` where a parameter stays open.
    """
    import shlex

    from algid.designs.campaign import plan
    from algid.designs.page import design_document
    from algid.designs.prior import KnownBefore, prior_of
    from algid.designs.request import request
    from algid.designs.write import Provenance, design_json, write_design
    from algid.files import refuse_existing, whole_folder
    from algid.report.progress import progress
    from algid.report.terminal import print_document
    from algid.runtime import one_blas_thread

    asked = request(
        limits,
        {
            "range": span,
            "speed": speed,
            "acceleration": acceleration,
            "torque": torque,
            "tip_height": tip_height,
            "duration": duration,
            "rate": rate,
            "runs": runs,
        },
    )
    names = two_names("joints", joints)
    folder = out / f"{Path(prior).stem or 'arm'}.design"
    refuse_existing(folder, force)
    wished = asked.get("runs", None)
    known = prior_of(
        prior, None if wished is None else wished[1] > 0, KnownBefore(l1, l2, payload, prior_error)
    )
    noise = _noise(known, position_noise, torque_noise, noise_from)
    campaign = _campaign(known, asked, noise, wanted, drive, margin, seed)
    with one_blas_thread(), progress("steps", quiet) as shown:
        planned = plan(campaign, shown)
    origin = Provenance(prior, shlex.join(["algid", *sys.argv[1:]]), names, known.doubts)
    with whole_folder(folder, force) as temporary:
        write_design(planned, temporary, origin)
    if not quiet:
        if form is Shown.JSON:
            say(design_json(planned, origin), end="")
        else:
            print_document(design_document(planned, prior, known.doubts), console())
        remark(f"wrote {folder}")
    if planned.open_parameters:
        raise typer.Exit(Exit.FAILED)


def _campaign(
    prior: BelievedArm,
    asked: Request,
    noise: NoiseLevels,
    wanted: str | None,
    drive: Drive,
    margin: float,
    seed: int,
) -> Campaign:
    from algid.designs.belief import asked_for
    from algid.designs.campaign import Campaign
    from algid.designs.information import Experiment
    from algid.designs.request import limits_of

    shared = prior.belief.shared
    runs = asked.get("runs", (1, 1) if shared.payload else (1, 0))
    names = None if wanted is None else [name.strip() for name in wanted.split(",")]
    return Campaign(
        experiment=Experiment(shared, runs, noise, asked.get("rate", RATE)),
        belief=prior.belief,
        limits=limits_of(asked, prior.lengths),
        asked=asked_for(prior.belief, names, prior.source),
        duration=asked.get("duration", DURATION),
        drive="torque" if drive is Drive.TORQUE else "position",
        margin=margin,
        seed=seed,
    )


def _noise(
    prior: BelievedArm, position: float | None, torque: float | None, log: Path | None
) -> NoiseLevels:
    """Noise of flags, else of a log, else of the logs behind the prior. Raises `SettingError` where none tells."""
    import numpy as np

    from algid.errors import SettingError
    from algid.estimators.noise import first_guess
    from algid.estimators.whitening import NoiseLevels

    measured = prior.noise
    if log is not None:
        from algid.readers import read_log

        found = read_log(log)
        measured = first_guess(found.theta, found.tau)
    levels = {}
    for flag, given, name in (
        ("--position-noise", position, "theta"),
        ("--torque-noise", torque, "tau"),
    ):
        if given is not None:
            levels[name] = np.full(2, given)
        elif measured is not None and np.all(getattr(measured, name) > 0):
            levels[name] = getattr(measured, name)
        else:
            raise SettingError(
                f"{flag}: {prior.source} does not tell how noisy the sensors are; give it, or --noise-from LOG"
            )
    return NoiseLevels(**levels)
