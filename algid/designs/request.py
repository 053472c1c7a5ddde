"""What a campaign keeps to, from a TOML file, the command line's text, or keywords: one model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, PlainValidator, ValidationError, ValidationInfo
from pydantic_core import PydanticCustomError

from algid.arm import FloatArray
from algid.base.errors import SettingError
from algid.base.files import misfit, toml_content
from algid.base.limits import PLANNED, within
from algid.designs.belief import objective_of
from algid.designs.campaign import Campaign
from algid.designs.information import Experiment
from algid.designs.limits import HANGING, Limits
from algid.designs.prior import PriorArm
from algid.estimators.noise import first_guess
from algid.estimators.whitening import NoiseLevels
from algid.log import Log
from algid.options import flag

RATE, DURATION = 1000.0, 10.0  # Hz and s
MOST_RUNS = 1000
FURTHEST = 2 * np.pi  # rad to either side: few joints turn further
SMALLEST, LARGEST = 1e-6, 1e6
"""What a limit in rad, rad/s, rad/s² or N m may be, but for 0 and inf."""
EXAMPLES = {
    "range": "rad like 1.2 (to both sides of hanging), 1.2,1.0, or LOW:HIGH of each joint like "
    "-2.7:-0.4,-1.2:1.2",
    "speed": "rad/s like 3 or 3,4",
    "acceleration": "rad/s² like 30 or 30,60",
    "torque": "N m like 5 or 5,2",
    "runs": "numbers of runs without and with the payload like 2,1",
}


def _pair(value: Any, info: ValidationInfo) -> FloatArray:
    """Numbers (2,) of both joints or both kinds of run; of a range its ends (2, 2) by joint.

    One number stands for both joints, and of a range for both sides of hanging.

    Raises
    ------
    PydanticCustomError
        If it can be no such limit.
    """
    name = str(info.field_name)
    if isinstance(value, str):
        value = [part.split(":") for part in value.split(",")]
    try:
        table = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):  # no numbers, or not as many in each part
        table = np.full(1, np.nan)
    if table.shape[-1:] == (1,):
        table = table[..., 0]
    spans = name == "range" and table.shape == (2, 2)
    low, high = table.T if spans else (-table, table)
    like = EXAMPLES[name]
    if name == "runs":
        whole = (table == np.rint(table)) & (table >= 0) & (table <= MOST_RUNS)
        right = bool(table.shape == (2,) and table.any() and np.all(whole))
    else:
        sizes = np.abs(table[np.isfinite(table) & (table != 0)])
        most = FURTHEST if name == "range" else LARGEST
        right = bool(np.all(low < high) and np.all((sizes >= SMALLEST) & (sizes <= most)))
        right = right and np.array_equal(np.isfinite(low), np.isfinite(high))
        right = right and low.shape in ((), (1,), (2,))
        like = f"{like}; from {SMALLEST:g} to {most:.4g}, or inf"
    if not right:
        raise PydanticCustomError("limit", "expected {like}", {"like": like})
    if name != "range":
        return np.broadcast_to(table, 2)
    if spans:
        return table
    half, middle = np.broadcast_to(table, 2), np.array(HANGING)
    return np.stack([middle - half, middle + half], axis=1)


Pair = Annotated[FloatArray, PlainValidator(_pair)]
UNLIMITED = np.full(2, np.inf)


class Request(BaseModel):
    """What a campaign is asked to keep to; inf is no limit."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    range: Pair
    speed: Pair
    torque: Pair
    acceleration: Pair = UNLIMITED
    tip_height: float = -np.inf
    duration: float = within(PLANNED["duration"], DURATION)
    rate: float = within(PLANNED["rate"], RATE)
    runs: Pair | None = None


def request(file: Path | None, given: Mapping[str, Any]) -> Request:
    """What the file asks for, and over it what is given; None leaves it to the file.

    Raises
    ------
    SettingError
        If either is wrong; it names the option or the file's line.
    """
    content = {} if file is None else toml_content(file)
    own = {name: value for name, value in given.items() if value is not None}
    try:
        return Request.model_validate(content | own)
    except ValidationError as error:
        place, said = misfit(error)
        name = place.partition(".")[0]
        if error.errors()[0]["type"] == "missing":
            said = (
                f"it must be given, or `{name} = …` in the file of {flag('limits')}; inf is no "
                "limit at all"
            )
        elif name not in own:
            raise SettingError(f"{file}: {place}: {said}") from error
        raise SettingError(f"{flag(name)}: {said}") from error


def limits_of(asked: Request, lengths: FloatArray) -> Limits:
    """The limits of a request for an arm of these link lengths (2,).

    Raises
    ------
    SettingError
        If the height of the tip cannot be kept to, or nothing is limited.
    """
    height, reach = asked.tip_height, float(np.sum(lengths))
    if np.isfinite(height) and not np.isfinite(reach):
        raise SettingError(
            f"{flag('tip_height')}: the link lengths are not known; give {flag('l1')} and "
            f"{flag('l2')}"
        )
    if height >= reach:
        raise SettingError(
            f"{flag('tip_height')}: expected less than the arm's reach, {reach:.4g} m, found "
            f"{height:g} m"
        )
    low, high = asked.range.T
    limits = Limits(low, high, asked.speed, asked.acceleration, asked.torque, height, lengths)
    every = np.stack([limits.half, limits.speed, limits.acceleration, limits.torque])
    if not np.any(np.isfinite(every)):
        raise SettingError(
            f"{flag('range')}: without any limit no motion is the best, found inf for all; give one"
        )
    return limits


def campaign_of(
    prior: PriorArm,
    asked: Request,
    noise: NoiseLevels,
    wanted: Sequence[str] | str | None,
    margin: float,
    seed: int,
) -> Campaign:
    """The campaign that is asked for, with defaults where nothing is."""
    shared = prior.belief.shared
    unloaded, loaded = (1, shared.payload) if asked.runs is None else asked.runs
    names = wanted
    if isinstance(wanted, str):
        names = [name.strip() for name in wanted.split(",")]
    return Campaign(
        experiment=Experiment(shared, (int(unloaded), int(loaded)), noise, asked.rate),
        belief=prior.belief,
        limits=limits_of(asked, prior.lengths),
        asked=objective_of(prior.belief, names, prior.source),
        duration=asked.duration,
        margin=margin,
        seed=seed,
    )


def noise_of(
    prior: PriorArm, position: float | None, torque: float | None, log: Log | None
) -> NoiseLevels:
    """Noise that is given, else of a log, else of the logs behind the prior.

    Raises
    ------
    SettingError
        Where none is known.
    """
    measured = prior.noise
    if log is not None:
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
                f"or {flag('noise_from')}=LOG"
            )
    return NoiseLevels(**levels)
