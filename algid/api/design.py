"""The motion of an identification run, planned within limits, its error bars known beforehand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from algid.api.given import called, folder_or_none, parts_of
from algid.api.options import two_names
from algid.api.ranges import check
from algid.errors import SettingError
from algid.files import refuse_existing
from algid.options import flag
from algid.results import Result

if TYPE_CHECKING:
    import polars as pl

    from algid.designs.campaign import Campaign, Design
    from algid.designs.prior import BelievedArm
    from algid.designs.request import Request
    from algid.designs.write import Provenance
    from algid.estimators.whitening import NoiseLevels
    from algid.identification.source import LogLike
    from algid.progress import Progress
    from algid.report.document import Document

RATE, DURATION = 1000.0, 10.0

Pair = float | tuple[float, float] | str
Span = Pair | tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True)
class Planned:
    """A planned motion: what it is, what it will tell, and where it comes from."""

    design: Design
    origin: Provenance

    def __repr__(self) -> str:
        return f"Planned({', '.join(f'{name} ± {std:.2g}' for name, std in self.bounds.items())})"

    @property
    def open_parameters(self) -> list[str]:
        """Names of those asked for whose error bar is as large as they are."""
        return self.design.open_parameters

    @property
    def bounds(self) -> dict[str, float]:
        """By parameter the standard deviation that is to be expected."""
        return dict(zip(self.design.names, self.design.std.tolist(), strict=True))

    def to_frame(self) -> pl.DataFrame:
        """The trajectory of ``trajectory.csv``: time, angle, velocity, acceleration, torque."""
        import polars as pl

        from algid.designs.write import trajectory

        return pl.DataFrame(trajectory(self.design))

    def document(self) -> Document:
        """Its report."""
        from algid.designs.page import design_document

        return design_document(self.design, self.origin.source, self.origin.doubts)

    def as_json(self) -> str:
        """The text of ``design.json``."""
        from algid.designs.write import design_json

        return design_json(self.design, self.origin)


def design(
    prior: Result | str | Path,
    *,
    limits: str | Path | None = None,
    range: Span | None = None,  # noqa: A002  # as the flag
    speed: Pair | None = None,
    acceleration: Pair | None = None,
    torque: Pair | None = None,
    tip_height: float | None = None,
    duration: float | None = None,
    rate: float | None = None,
    runs: tuple[int, int] | str | None = None,
    wanted: Sequence[str] | str | None = None,
    position_noise: float | None = None,
    torque_noise: float | None = None,
    noise_from: LogLike | None = None,
    prior_error: float | None = None,
    payload: float | None = None,
    l1: float | None = None,
    l2: float | None = None,
    margin: float = 0.05,
    joints: tuple[str, str] | str = ("joint1", "joint2"),
    seed: int = 0,
    out: str | Path | None = None,
    force: bool = False,
    command: str = "",
    progress: Progress | None = None,
) -> Planned:
    """Plan the motion that tells most about an arm within its limits.

    Parameters
    ----------
    prior : Result, str or Path
        Result of the arm or its folder, name of a case that ships with algid, or a TOML file of the
        arm.
    limits : path
        TOML file with limits in these keywords' words, which beat it.
    range : float, rad
        1.2 to both sides of hanging, (1.2, 1.0) by joint, or pairs of lowest and highest.
    speed, acceleration, torque : float or pair, rad/s, rad/s² and N m
        The largest, of both joints or by joint.
    tip_height : float, m
        The lowest of the tip over joint 1.
    duration, rate : float, s and Hz
        Of a run and its log; 10 s at 1000 Hz.
    runs : pair of int
        Runs without and with the payload.
    wanted : names of parameters
        That matter, like ("k1", "m_p"); all by default.
    position_noise, torque_noise : float, rad and N m
        Standard deviations.
    noise_from : a log as `algid.identify` takes it
        Whose noise is taken.
    prior_error : float
        Share by which masses and friction may be wrong where no error bar tells; 0.2.
    payload : float, kg, of the loaded runs
    l1, l2 : float, m, where known
    margin : float
        Share of every limit left unused.
    joints : two names
        Of the robot's joints.
    seed : int
        Of the search.
    out : Path
        Folder to write the folder ``PRIOR.design`` into; None writes nothing.
    force : bool
        Replace a design that is there.
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
    >>> import algid
    >>> noise = {"position_noise": 1e-3, "torque_noise": 1e-2}
    >>> plan = algid.design("case1", range=1.2, speed=3, torque=1.5, duration=2.0, **noise)
    >>> plan.open_parameters
    []
    """
    from algid.designs.campaign import plan
    from algid.designs.prior import KnownBefore, prior_of
    from algid.designs.request import request
    from algid.designs.write import Provenance, write_design
    from algid.runtime import one_blas_thread

    check(
        "design",
        tip_height=tip_height,
        duration=duration,
        rate=rate,
        position_noise=position_noise,
        torque_noise=torque_noise,
        prior_error=prior_error,
        payload=payload,
        l1=l1,
        l2=l2,
        margin=margin,
        seed=seed,
    )
    of_flags = {
        "range": range,
        "speed": speed,
        "acceleration": acceleration,
        "torque": torque,
        "runs": runs,
    }
    flags: dict[str, str | float | None] = {
        "tip_height": tip_height,
        "duration": duration,
        "rate": rate,
    }
    for name, value in of_flags.items():
        flags[name] = _spelled(value)
    file = None
    if limits is not None:
        file = Path(limits)
    asked = request(file, flags)
    names = two_names("joints", joints)
    source = called(prior)
    folder = None
    if out is not None:
        folder = folder_of(source, Path(out))
        refuse_existing(folder, force)
    loaded = None
    if asked.get("runs", None) is not None:
        loaded = asked.content["runs"][1] > 0
    known = prior_of(
        prior if isinstance(prior, Result) else source,
        loaded,
        KnownBefore(l1, l2, payload, prior_error),
    )
    noise = noise_of(known, position_noise, torque_noise, noise_from)
    campaign = campaign_of(known, asked, noise, wanted, margin, seed)
    origin = Provenance(source, command, names, known.doubts)
    if progress is not None:
        progress("searching", 0, 0)
    with folder_or_none(folder, force) as temporary:
        with one_blas_thread():
            planned = plan(campaign, progress)
        if temporary is not None:
            write_design(planned, temporary, origin)
    return Planned(planned, origin)


def folder_of(prior: str, out: Path) -> Path:
    """Where the design for a prior goes."""
    return out / f"{Path(prior).stem or 'arm'}.design"


def campaign_of(
    prior: BelievedArm,
    asked: Request,
    noise: NoiseLevels,
    wanted: Sequence[str] | str | None,
    margin: float,
    seed: int,
) -> Campaign:
    """The campaign that is asked for, with defaults where nothing is."""
    from algid.designs.belief import asked_for
    from algid.designs.campaign import Campaign
    from algid.designs.information import Experiment
    from algid.designs.request import limits_of

    shared = prior.belief.shared
    runs = asked.get("runs", (1, int(shared.payload)))
    names = None
    if wanted is not None:
        names = [name.strip() for name in parts_of(wanted)]
    return Campaign(
        experiment=Experiment(shared, runs, noise, asked.get("rate", RATE)),
        belief=prior.belief,
        limits=limits_of(asked, prior.lengths),
        asked=asked_for(prior.belief, names, prior.source),
        duration=asked.get("duration", DURATION),
        margin=margin,
        seed=seed,
    )


def noise_of(
    prior: BelievedArm, position: float | None, torque: float | None, log: LogLike | None
) -> NoiseLevels:
    """Noise that is given, else of a log, else of the logs behind the prior.

    Raises
    ------
    SettingError
        Where none is known.
    """
    from algid.estimators.noise import first_guess
    from algid.estimators.whitening import NoiseLevels

    measured = prior.noise
    if log is not None:
        from algid.log import Log
        from algid.readers import read_log

        if not isinstance(log, Log):
            log = read_log(log)
        measured = first_guess(log.theta, log.tau)
    levels = {}
    for option, given, name in (
        ("position_noise", position, "theta"),
        ("torque_noise", torque, "tau"),
    ):
        if given is not None:
            levels[name] = np.full(2, given)
        elif measured is not None and np.all(getattr(measured, name) > 0):
            levels[name] = getattr(measured, name)
        else:
            raise SettingError(
                f"{flag(option)}: {prior.source} does not tell how noisy the sensors are; give it, "
                f"or {flag('noise_from')} LOG"
            )
    return NoiseLevels(**levels)


def _spelled(value: Any) -> str | None:
    """A limit as the command line has it: ``1.2``, ``1.2,1.0``, ``-2.7:-0.4,-1.2:1.2``."""
    if value is None or isinstance(value, str):
        return value
    if not isinstance(value, tuple | list):
        return str(value)
    parts = []
    for one in value:
        if isinstance(one, tuple | list):
            parts.append(":".join(map(str, one)))
        else:
            parts.append(str(one))
    return ",".join(parts)
