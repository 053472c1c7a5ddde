"""The motion of an identification run, planned within limits, its error bars known beforehand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from algid.api import Answer
from algid.api.options import (
    CASES,
    AnyLog,
    Folder,
    Length,
    Mass,
    Seed,
    called,
    folder_or_none,
    meant,
    verb,
)
from algid.base.errors import exit_of
from algid.base.limits import PHYSICAL, PLANNED, PRIOR_ERROR, within
from algid.options import Option
from algid.results import Result

if TYPE_CHECKING:
    from algid.base.progress import Progress
    from algid.designs.campaign import Planned

Noise = Annotated[float, within((1e-12, PHYSICAL.noise[1]))]
Pair = float | str | Sequence[float]
Span = float | str | Sequence[float | Sequence[float]]


@verb
def design(
    prior: Annotated[Result | str | Path, Option(kind=str, suggested=lambda: CASES)],
    *,
    limits: str | Path | None = None,
    range: Span | None = None,  # noqa: A002  # as the flag
    speed: Pair | None = None,
    acceleration: Pair | None = None,
    torque: Pair | None = None,
    tip_height: Annotated[float, within(PLANNED["tip_height"])] | None = None,
    duration: float | None = None,
    rate: float | None = None,
    runs: Sequence[int] | str | None = None,
    for_: Sequence[str] | str | None = None,
    position_noise: Noise | None = None,
    torque_noise: Noise | None = None,
    noise_from: AnyLog | None = None,
    prior_error: Annotated[float, within(PRIOR_ERROR)] | None = None,
    payload: Mass | None = None,
    l1: Length | None = None,
    l2: Length | None = None,
    margin: Annotated[float, within((0, 0.5))] = 0.05,
    joints: Sequence[str] | str = "joint1,joint2",
    seed: Seed = 0,
    out: Folder | None = None,
    force: bool = False,
    command: str = "",
    progress: Progress | None = None,
) -> Planned:
    """Plan the motion that tells most about an arm within its limits; write PRIOR.design.

    Exit code 3 tells that a parameter stays open.

    Parameters
    ----------
    prior : Result, str or Path
        Result of the arm, case1, case2, or a TOML file of the arm.
    limits : path
        TOML file with range, speed, …; flags beat it.
    range : float, rad
        rad: 1.2 about hanging, 1.2,1.0, or LOW:HIGH,LOW:HIGH. In Python also
        pairs of lowest and highest.
    speed : float or pair, rad/s
        Largest speed, rad/s: 3, or 3,4 by joint.
    acceleration : float or pair, rad/s²
        Largest acceleration, rad/s²; none by default.
    torque : float or pair, N m
        Largest torque, N m: 5, or 5,2 by joint.
    tip_height : float, m
        Lowest height of the tip over joint 1, m.
    duration : float, s
        Length of a run, s; 10 by default.
    rate : float, Hz
        Samples a second of its log, Hz; 1000 by default.
    runs : pair of int
        Runs without and with the payload, like 2,1.
    for_ : names of parameters
        Parameters that matter, like k1,m_p; all by default.
    position_noise : float, rad
        Noise of the angles, rad (standard deviation).
    torque_noise : float, N m
        Noise of the torques, N m (standard deviation).
    noise_from : a log as `algid.identify` takes it
        A log of the arm whose noise is taken.
    prior_error : float
        Per cent by which masses and friction may be wrong where no error bar tells; 20.
    payload : float, kg
        Payload of the loaded runs, kg.
    l1 : float, m
        Length of link 1, m, where known.
    l2 : float, m
        Length of link 2, m, where known.
    margin : float
        Share of every limit left unused.
    joints : two names
        Names of the robot's joints.
    seed : int
        Seed of the search.
    out : Path
        Folder for the folder PRIOR.design. None writes nothing.
    force : bool
        Replace what is there.
    command : str
        The command line behind the call, for the files.
    progress : callable
        Called as the search goes on.

    Returns
    -------
    Planned
        Its `bounds`, `open_parameters`, and the trajectory by `to_frame()`.

    Raises
    ------
    SettingError
        If a limit that must be given is not, or a setting is wrong.
    ResultError
        If the prior is a result that cannot be planned from.
    OutputError
        If a design is there already and `force` is not set, or cannot be written.

    Examples
    --------
    $ algid design case1 --range 1.2 --speed 3 --torque 1.5 --position-noise 1e-3
    --torque-noise 1e-2

    >>> import algid
    >>> noise = {"position_noise": 1e-3, "torque_noise": 1e-2}
    >>> plan = algid.design("case1", range=1.2, speed=3, torque=1.5, duration=2.0, **noise)
    >>> plan.open_parameters
    []
    """
    from algid.base.runtime import one_blas_thread
    from algid.designs.campaign import campaign_of, plan
    from algid.designs.limits import Request, request
    from algid.designs.prior import PriorKnowledge, noise_for, prior_of
    from algid.designs.write import write_design
    from algid.log import Log
    from algid.readers import read_log

    own = locals()
    asked = request(
        None if limits is None else Path(limits), {name: own[name] for name in Request.model_fields}
    )
    names, source = meant(None, {"joints": joints}).joints, called(prior)
    folder = None if out is None else folder_of(source, Path(out))
    with folder_or_none(folder, force) as temporary, one_blas_thread():
        known = prior_of(
            prior if isinstance(prior, Result) else source,
            None if asked.runs is None else bool(asked.runs[1] > 0),
            PriorKnowledge(l1, l2, payload, None if prior_error is None else prior_error / 100),
        )
        log: Any = noise_from
        if log is not None and not isinstance(log, Log):
            log = read_log(log)
        noise = noise_for(known, position_noise, torque_noise, log)
        campaign = campaign_of(known, asked, noise, for_, margin, seed)
        if progress is not None:
            progress("searching", 0, 0)
        planned = plan(replace(campaign, joints=names, command=command), progress)
        if temporary is not None:
            write_design(planned, temporary)
    return planned


def answer(planned: Planned, given: Mapping[str, Any]) -> Answer:
    """The plan; 3 where a parameter stays open."""
    from algid.designs.write import design_document, design_json

    return Answer(
        map(design_document, [planned]),
        lambda: design_json(planned),
        [f"wrote {folder_of(given['prior'], given['out'])}"],
        exit=exit_of(failed=bool(planned.open_parameters), lost=False),
    )


def folder_of(prior: str, out: Path) -> Path:
    """Where the design for a prior goes."""
    return out / f"{Path(prior).stem or 'arm'}.design"
