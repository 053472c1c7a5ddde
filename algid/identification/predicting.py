"""The torque that a result predicts along a log that it was not made from."""

from __future__ import annotations

from typing import TYPE_CHECKING

import polars as pl

from algid.arm import FloatArray
from algid.identification.identify import reused
from algid.identification.open_logs import LogLike, open_source
from algid.identification.recordings import Recordings, Role
from algid.identification.series import torque_blocks
from algid.identification.validate import predictor_of
from algid.results import Result

if TYPE_CHECKING:
    from algid.profile import Profile


def predicted(result: Result, log: LogLike, role: Role, profile: Profile | None) -> pl.DataFrame:
    """Motion, measured and predicted torque of a log: see `algid.Result.predict`."""
    known = predictor_of(result, result.log.path)
    source = open_source(log, role, reused(profile, result), known.model.gravity)
    coefficients: dict[str, FloatArray] = {role: known.coefficients(role)}
    blocks = list(torque_blocks(Recordings([source]), known.model, coefficients, known.shift))
    if not blocks:
        return pl.DataFrame()
    return pl.concat(map(pl.DataFrame, blocks), rechunk=True).drop("log")
