"""`algid export`: a result as a model for simulators, controllers and planners."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from algid.api.ranges import ends
from algid.cli.common import Force, Quiet, out
from algid.cli.output import complain, remark, say


class To(StrEnum):
    """What a result is exported to."""

    URDF = "urdf"
    MJCF = "mjcf"
    SDF = "sdf"
    PYTHON = "python"
    C = "c"
    PAYLOAD = "payload"
    CSV = "csv"
    PARQUET = "parquet"


def export(
    result: Annotated[
        Path, typer.Argument(help="A result folder of algid identify, or its result.json.")
    ],
    to: Annotated[
        To,
        typer.Option(
            help="Robot description (urdf, mjcf, sdf), dynamics (python, c), payload (YAML), or "
            "table of draws (csv, parquet)."
        ),
    ],
    out: Annotated[
        Path | None,
        out("File or folder; the result's name with the format's ending by default."),
    ] = None,
    l1: Annotated[
        float | None,
        typer.Option(
            help="Length of link 1, m; what the result knows best by default.",
            **ends("export", "l1"),
        ),
    ] = None,
    l2: Annotated[
        float | None, typer.Option(help="Length of link 2, m.", **ends("export", "l2"))
    ] = None,
    m1: Annotated[
        float | None, typer.Option(help="Mass of link 1, kg.", **ends("export", "m1"))
    ] = None,
    m2: Annotated[
        float | None, typer.Option(help="Mass of link 2, kg.", **ends("export", "m2"))
    ] = None,
    rotor1: Annotated[
        float | None,
        typer.Option(
            help="Joint 1's rotor at the joint, kg m²: a part of k5.", **ends("export", "rotor1")
        ),
    ] = None,
    draws: Annotated[
        int | None,
        typer.Option(
            help="Draw so many arms from the estimates' joint distribution, into a folder.",
            **ends("export", "draws"),
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the draws.", **ends("export", "seed"))] = 0,
    flange: Annotated[
        str | None,
        typer.Option(
            help="The flange in link 2's frame for a payload's call: X,Y,ANGLE in m, m and degrees."
        ),
    ] = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Write the arm of RESULT as a model.

    What is not known is chosen nearest to uniform links, and the file says so.

    Example: algid export case1-unloaded.algid --to mjcf --l2 0.5
    """
    from algid.api.export import export as run
    from algid.api.export import file_of

    file = file_of(result, to.value, draws)
    if out is not None:
        file = out / file if out.is_dir() and draws is None else out
    made = run(
        result,
        to.value,
        l1=l1,
        l2=l2,
        m1=m1,
        m2=m2,
        rotor1=rotor1,
        draws=draws,
        seed=seed,
        flange=flange,
        out=file,
        force=force,
    )
    if quiet:
        return
    for warning in made.warnings:
        complain(warning.text)
    say(made.call, end="")
    remark(f"wrote {file}")
