"""Whether runs of one motion agree in what a likelihood leaves: the model lacks something then.

Noise is each run's own. What the model lacks is the same in each repeat at the same place of its
motion, whatever its shape: repeats tell it from noise, as pure error does in a test of lack of fit
(Neill & Johnson 1984). Of the scores of runs i and j over stretch t of a motion

    A = Σ_t Σ_(i≠j) s_itᵀ H⁻¹ s_jt,   var A = 2 Σ_t Σ_(i≠j) tr(H⁻¹ P_it H⁻¹ P_jt)

where the model holds: A then lies about zero. Where it does not, A / Q is what the variances of
the estimates exceed those of white noise by, in the mean.

======  ==================================================  =========  =================
symbol  name                                                shape      unit
======  ==================================================  =========  =================
s       scores of a log, by stretch                         (B, Q)     1 / unit
P       their information, by stretch                       (B, Q, Q)  1 / (unit unit)
H       information of all logs and of what was known       (Q, Q)     1 / (unit unit)
======  ==================================================  =========  =================
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from algid.arm import FloatArray
from algid.base.significance import ONE_SIDED
from algid.estimators.combine import LogInformation, scaled_pinv, scores_of
from algid.estimators.parametrisation import Shared
from algid.estimators.repeats import Groups, merged


def agree(
    shared: Shared,
    logs: Sequence[LogInformation],
    beta: FloatArray,
    H: FloatArray,
    groups: Groups,
) -> bool:
    """Whether logs that repeat each other leave the same at `beta` (Q,), by more than chance.

    One set in twenty does by chance: error bars by the scatter of repeats are right there too.

    Parameters
    ----------
    shared : Shared
    logs : each log's quadratic likelihood
    beta : (Q,)
    H : (Q, Q)
    groups : Groups
        Logs that repeat each other, begun at the same place of their motion.
    """
    inverse = scaled_pinv(H)
    agreed: FloatArray = np.zeros(2)
    for group, whole in zip(groups, merged(logs, groups), strict=True):
        if len(group) > 1:
            agreed += _squares(shared, whole, beta, inverse)
            for place in group:
                agreed -= _squares(shared, logs[place], beta, inverse)
    excess, variance = agreed
    return bool(excess > ONE_SIDED * np.sqrt(variance))


def _squares(
    shared: Shared, log: LogInformation, beta: FloatArray, inverse: FloatArray
) -> FloatArray:
    """Σ_t s_tᵀ H⁻¹ s_t of a log, and its variance 2 Σ_t tr(H⁻¹ P_t H⁻¹ P_t) by white noise.

    Those of a sum of logs less those of each alone are A and its variance.
    """
    T, scores = scores_of(shared, log, beta)
    s = scores @ T
    shares = inverse @ (T.T @ log.S @ T)
    return np.array([np.sum((s @ inverse) * s), 2 * np.sum(shares * shares.swapaxes(1, 2))])
