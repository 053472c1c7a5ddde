"""`algid export`: a result as a model for simulators, controllers and planners."""

from __future__ import annotations

import re
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from algid.cli.output import complain, remark


class To(StrEnum):
    """What a result is exported to."""

    URDF = "urdf"
    MJCF = "mjcf"
    SDF = "sdf"
    PYTHON = "python"
    C = "c"
    YAML = "yaml"


def export(
    result: Annotated[
        Path, typer.Argument(help="A result folder of algid identify, or its result.json.")
    ],
    to: Annotated[
        To,
        typer.Option(
            help="Robot description (urdf, mjcf, sdf), dynamics (python, c), or payload (yaml)."
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "-o", "--out", help="File; the result's name with the format's ending by default."
        ),
    ] = None,
    l1: Annotated[
        float | None,
        typer.Option(help="Length of link 1, m; g k1 / k2 by default.", min=1e-3, max=1e3),
    ] = None,
    l2: Annotated[
        float | None, typer.Option(help="Length of link 2, m.", min=1e-3, max=1e3)
    ] = None,
    m1: Annotated[float | None, typer.Option(help="Mass of link 1, kg.", min=1e-6, max=1e6)] = None,
    m2: Annotated[float | None, typer.Option(help="Mass of link 2, kg.", min=1e-6, max=1e6)] = None,
    rotor1: Annotated[
        float | None,
        typer.Option(help="Joint 1's rotor at the joint, kg m²: a part of k5.", min=0, max=1e6),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a file that is there.")] = False,
) -> None:
    """Write the arm of RESULT as a model.

    What is not known is chosen nearest to uniform links, and the file says so.

    Example: algid export case1-unloaded.algid --to mjcf --l2 0.5
    """
    from algid.exports.formats import FORMATS, exported
    from algid.exports.links import Knowns
    from algid.files import refuse_existing, whole_file
    from algid.results import read_result

    text, warnings = exported(
        read_result(result), str(result), to.value, Knowns(l1, l2, m1, m2, rotor1)
    )
    if out is None:
        stem = (result if result.name != "result.json" else result.resolve().parent).stem or "arm"
        stem = re.sub(r"\W", "_", stem) if to is To.PYTHON else stem
        out = Path(f"{stem}-payload.yaml" if to is To.YAML else f"{stem}{FORMATS[to.value].suffix}")
    refuse_existing(out, force)
    with whole_file(out) as temporary:
        temporary.write_text(text, encoding="utf-8")
    for warning in warnings:
        complain(warning.text)
    remark(f"wrote {out}")
