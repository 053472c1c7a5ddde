"""When k1 … k5 get no error bar: a joint stood still or was hardly driven, or they disagree.

Where a likelihood is refuted and there are few logs, what differs from run to run does not show by
itself. What is alike in every run, a wrong torque constant say, shows in no number of them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from algid.arm import FloatArray
from algid.base.criteria import STILL
from algid.estimators import weak
from algid.estimators.combine import FEWEST_LOGS
from algid.estimators.diagnostics import ratio_of_joints
from algid.estimators.fit import Fit
from algid.estimators.modulating_functions import MOTORLESS
from algid.estimators.problem import Problem, Source
from algid.model import K1, K2, K3
from algid.notices import Notice

UNLIKE, UNLIKE_IN_MANY = 0.5, 0.2
"""Share of the larger of two values: more than what a model lacks makes in one run, and in many."""
UNEXPLAINED = 0.1
"""Share of a torque's power: constants that leave more of it do not explain that joint."""
OF_LINK_2 = (K1, K2, K3)
LEAST_ACTING = 0.02
"""Share of the other joint's torque: less at a joint without a motor is bearing or cable."""


def undriven(fit: Fit, problem: Problem) -> Notice | None:
    """Why k1 … k5 are doubtful where they do not explain a joint without a motor.

    Inertia, weight and friction, which cancel there, are then of no size beside the other joint's
    torque: constants near nothing solve that equation too, and least squares ends there where
    friction and cables pull as hard as the arm's own load.
    """
    for kind, sources in problem.kinds():
        c, gram = _at_fit(fit, problem, kind, sources)
        power = gram[:, -1, -1]
        for joint in range(2):
            acting = np.diag(gram[joint])[:-1] @ c**2
            if power[joint] == 0 and acting < LEAST_ACTING**2 * power[1 - joint]:
                return Notice("HARDLY_DRIVEN", numbers={"case": "passive", "joint": joint + 1})
    return None


def _at_fit(
    fit: Fit, problem: Problem, kind: bool, sources: Sequence[Source]
) -> tuple[FloatArray, FloatArray]:
    """Coefficients (q,) of logs of one kind, and sums (2, q + 1, q + 1) of their windows there."""
    settings = problem.at(fit.shared.model, fit.delay).settings
    c = fit.shared.coefficients(fit.values, kind)[: len(settings.model.names)]
    normals = weak.normals_of(sources, settings, c)
    nothing = np.zeros((2, c.size + 1, c.size + 1))
    return c, sum((normal.gram.sum(axis=0) for normal in normals), nothing)


def contradicted(fit: Fit, problem: Problem) -> Notice | None:
    """Why k1 … k5 are doubtful in a fit whose likelihood is refuted; None where nothing says so.

    Parameters
    ----------
    fit : Fit
        With `FEWEST_LOGS` logs or more it is the joints' contradiction alone that is asked for, a
        smaller one: see `ratio_of_joints`.
    problem : Problem
        With a model that is linear.
    """
    few = len(fit.logs) < FEWEST_LOGS
    still = [f"joint {joint + 1}" for joint in range(2) if fit.moved[joint] < STILL]
    if few and still:
        return Notice("HARDLY_DRIVEN", numbers={"case": "still", "joints": still})
    settings = problem.at(problem.settings.model, fit.delay).settings
    for kind, sources in problem.kinds():
        normals = weak.normals_of(sources, settings)
        if not normals:
            continue
        ratio = ratio_of_joints(normals, settings.model, UNLIKE if few else UNLIKE_IN_MANY)
        if ratio is not None:
            return Notice("JOINTS_CONTRADICT", numbers={"ratio": ratio})
        torques = np.max([normal.power / normal.rows for normal in normals], axis=0)
        # a joint without a torque has no motor: see `undriven`
        hardly = (torques > 0) & (torques < MOTORLESS**2 * torques[::-1])
        if not few or not hardly.any():
            continue
        joint = int(np.argmax(hardly)) + 1
        c, gram = _at_fit(fit, problem, kind, sources)
        if not _confirmed(fit.shared.model.names, joint, c, gram):
            return Notice(
                "HARDLY_DRIVEN",
                numbers={"case": "torque", "joint": joint, "percent": 100 * MOTORLESS},
            )
    return None


def _confirmed(names: Sequence[str], joint: int, c: FloatArray, gram: FloatArray) -> bool:
    """True if both joints confirm the constants of one that is hardly driven, 1 or 2.

    A light second link needs little torque. Its constants stand where they explain that torque,
    and their part of the other joint's torque is larger than what the fit leaves there. What
    bearings and cables make of a joint that no motor moves is confirmed by nothing.
    """
    of_link = np.append(np.where(np.isin(names, OF_LINK_2), c, 0.0), 0.0)
    residual = np.append(-c, 1.0)
    left, part = (gram @ residual) @ residual, (gram @ of_link) @ of_link
    own, other = joint - 1, 2 - joint
    return bool(left[own] < UNEXPLAINED * gram[own, -1, -1] and left[other] < part[other])
