"""Arms drawn from the joint distribution of a result's estimates, to randomise simulations by.

With the estimates b, their covariance C and the fit's ν effective degrees of freedom, a draw is

    c = b + z √(ν / χ²_ν),   z ~ N(0, C)

Student's t, whose 95 % intervals are the result's: its covariance is C ν / (ν - 2). A draw that no
arm is like is drawn again. Where l1 is given, each draw is moved onto g |K1| = l1 |K2| as the
estimates are, which is a draw of the conditional distribution.
"""

from __future__ import annotations

import io
import json
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.special import stdtridf

from algid import __version__
from algid.base.errors import ResultError, SettingError
from algid.base.names import named_values, vector, within
from algid.estimators.diagnostics import bounds
from algid.estimators.parametrisation import BODY_PARAMETERS, Shared
from algid.exports.description import describe
from algid.exports.formats import ROBOTS, SUFFIXES, takes, written
from algid.exports.links import Knowns
from algid.identification.known import (
    covariance_of,
    model_of,
    prior_of,
    values_of,
    with_error_bar,
)
from algid.notices import Notice
from algid.options import flag
from algid.results import Result

TABLES = ("csv", "parquet")
_HOPELESS = 100
"""Draws that no arm is like for each that one is: more say that the estimates are none's."""


def drawn_files(
    result: Result, file: str, to: str, knowns: Knowns, count: int, seed: int
) -> tuple[dict[str, bytes], tuple[Notice, ...]]:
    """Files of `count` draws by name, ``manifest.json`` first, and what does not fit.

    Parameters
    ----------
    to : str
        A name in `SUFFIXES`, which gives a file a draw, or in `TABLES`, which gives a row.

    Raises
    ------
    ResultError
        If the estimates have no error bars, or hardly an arm is like them.
    SettingError
        If the format has no draws or no place for what is known, or that leaves no possible arm.
    """
    if to not in (*SUFFIXES, *TABLES):
        raise SettingError(f"{flag('draws')}: {to} has no draws; leave it out")
    takes(to, knowns)
    model, links = model_of(result), to in ROBOTS
    arm = prior_of(result, model, file).names
    others = [name for name in result.estimates if name not in (*model.names, *result.loaded)]
    names = (*arm, *with_error_bar(result, others))
    mean = vector(names, values_of(result))
    best = describe(result, file, knowns, links=links)
    covariance = covariance_of(result, names, names)
    size = np.sqrt(np.diag(covariance))
    size[size == 0] = 1.0
    still, correlation = np.zeros(len(names)), covariance / np.outer(size, size)
    # of normal intervals 1e10
    freedom, random = float(stdtridf(0.975, result.quantile)), np.random.default_rng(seed)
    shared = Shared(model, payload="m_p" in names, body=within(BODY_PARAMETERS, names))
    broken = list[str]()
    files: dict[str, bytes] = {"manifest.json": b""}
    rows: list[dict[str, Any]] = []
    refused = 0
    while len(rows) < count:
        if refused >= _HOPELESS * (len(rows) + 1):
            raise ResultError(
                f"{file}: {refused} of {refused + len(rows)} draws are no arm ({broken[-1]}); "
                "identify it from more informative logs"
            )
        wide = np.sqrt(freedom / random.chisquare(freedom))
        one_each = random.multivariate_normal(
            still, correlation, method="eigh", check_valid="ignore"
        )
        numbers = named_values(names, mean + size * one_each * wide)
        beta = vector(shared.names, numbers, 0.0)
        broken = [name for name, value in bounds(shared, beta).items() if value < 0]
        moved = {}
        for kind, given in (("parameters", result.parameters), ("payload", result.payload)):
            moved[kind] = {
                name: one.model_copy(update={"estimate": numbers.get(name, one.estimate)})
                for name, one in given.items()
            }
        try:
            one = describe(result.model_copy(update=moved), file, knowns, links=links)
        except (ResultError, SettingError) as error:
            broken.append(str(error))
        if broken:
            refused += 1
            continue
        row: dict[str, Any] = {"draw": len(rows) + 1}
        if to not in TABLES:
            row["file"] = f"draw-{row['draw']:0{len(str(count))}d}{SUFFIXES[to]}"
            said = f"{one.source}, draw {row['draw']} of seed {seed}"
            drawn = replace(one, word="drawn", source=said, warnings=best.warnings)
            files[row["file"]] = written(drawn, to).encode()
        # of the arm as l1 moved it
        rows.append(row | numbers | {name: one.value[name] for name in arm})
    manifest = {
        "algid": __version__,
        "result": file,
        "estimator": result.estimator,
        "seed": seed,
        "refused": refused,
        "known": {**knowns},
        "distribution": "Student's t",
        "degrees_of_freedom": freedom,
        "names": list(names),
        "from_prior": [name for name in names if result.estimates[name].status == "FROM_PRIOR"],
        "estimates": mean.tolist(),
        "covariance": covariance.tolist(),
        "draws": rows,
    }
    files["manifest.json"] = (json.dumps(manifest, indent=1, ensure_ascii=False) + "\n").encode()
    if to in TABLES:
        import polars as pl

        content = io.BytesIO()
        frame = pl.DataFrame(rows)
        frame.write_csv(content) if to == "csv" else frame.write_parquet(content)
        files[f"draws.{to}"] = content.getvalue()
    return files, best.warnings
