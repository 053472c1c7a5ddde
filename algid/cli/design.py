"""`algid design`: plan an identification run within limits and predict its error bars."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from algid.api.ranges import ends
from algid.cli.common import Force, Form, Quiet, ResultFormat, command_line, out, print_report
from algid.cli.completion import cases
from algid.cli.output import remark
from algid.exits import Exit


def design(
    prior: Annotated[
        str,
        typer.Argument(
            autocompletion=cases,
            help="Result folder of the arm, case1, case2, or a TOML file of the arm.",
        ),
    ],
    out: Annotated[Path, out("Folder for the folder PRIOR.design.")] = Path(),
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
        typer.Option(
            help="Lowest height of the tip over joint 1, m.", **ends("design", "tip_height")
        ),
    ] = None,
    duration: Annotated[
        float | None,
        typer.Option(help="Length of a run, s; 10 by default.", **ends("design", "duration")),
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(
            help="Samples a second of its log, Hz; 1000 by default.", **ends("design", "rate")
        ),
    ] = None,
    runs: Annotated[
        str | None, typer.Option(help="Runs without and with the payload, like 2,1.")
    ] = None,
    wanted: Annotated[
        str | None,
        typer.Option("--for", help="Parameters that matter, like k1,m_p; all by default."),
    ] = None,
    position_noise: Annotated[
        float | None,
        typer.Option(
            help="Noise of the angles, rad (standard deviation).",
            **ends("design", "position_noise"),
        ),
    ] = None,
    torque_noise: Annotated[
        float | None,
        typer.Option(
            help="Noise of the torques, N m (standard deviation).", **ends("design", "torque_noise")
        ),
    ] = None,
    noise_from: Annotated[
        Path | None, typer.Option(help="A log of the arm whose noise is taken.")
    ] = None,
    prior_error: Annotated[
        float | None,
        typer.Option(
            help="Share by which masses and friction may be wrong where no error bar tells; 0.2.",
            **ends("design", "prior_error"),
        ),
    ] = None,
    payload: Annotated[
        float | None,
        typer.Option(help="Payload of the loaded runs, kg.", **ends("design", "payload")),
    ] = None,
    l1: Annotated[
        float | None,
        typer.Option("--l1", help="Length of link 1, m, where known.", **ends("design", "l1")),
    ] = None,
    l2: Annotated[
        float | None,
        typer.Option("--l2", help="Length of link 2, m, where known.", **ends("design", "l2")),
    ] = None,
    margin: Annotated[
        float, typer.Option(help="Share of every limit left unused.", **ends("design", "margin"))
    ] = 0.05,
    joints: Annotated[str, typer.Option(help="Names of the robot's joints.")] = "joint1,joint2",
    seed: Annotated[int, typer.Option(help="Seed of the search.", **ends("design", "seed"))] = 0,
    force: Force = False,
    form: Form = ResultFormat.TABLE,
    quiet: Quiet = False,
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
    from algid.api.design import design as run
    from algid.api.design import folder_of
    from algid.report.progress import progress

    with progress("steps", quiet) as shown:
        planned = run(
            prior,
            limits=limits,
            range=span,
            speed=speed,
            acceleration=acceleration,
            torque=torque,
            tip_height=tip_height,
            duration=duration,
            rate=rate,
            runs=runs,
            wanted=wanted,
            position_noise=position_noise,
            torque_noise=torque_noise,
            noise_from=noise_from,
            prior_error=prior_error,
            payload=payload,
            l1=l1,
            l2=l2,
            margin=margin,
            joints=joints,
            seed=seed,
            out=out,
            force=force,
            command=command_line(),
            progress=shown,
        )
    if not quiet:
        print_report(planned.document(), planned.as_json, form)
        remark(f"wrote {folder_of(prior, out)}")
    if planned.open_parameters:
        raise typer.Exit(Exit.FAILED)
