"""How far a log's rows are from white: what the arm's model lacks makes neighbouring cells err alike.

Masses of neighbouring blocks of cells differ by 1/A + 1/A' in variance where rows are white. Slow errors
(friction that the model lacks, play, a gear's ripple) make long blocks differ by far more; the largest excess
over block lengths up to a second is what intervals and changes have to stand up to. Medians are taken, so that
a few changes of payload do not pass for errors.
"""

from __future__ import annotations

import numpy as np

from algid.arm import FloatArray

SPANS = (1, 2, 3, 5, 8, 12, 18, 25, 35, 50)  # cells: 0.02 to 1 s
LIGHTEST = 1e-6  # information of a block that tells anything, of the largest
FEWEST = 8  # pairs of blocks that tell a variance
_MEDIAN = 0.454936  # of a squared standard normal
_SPREAD = 2.33  # standard deviation of the median of n squares over _MEDIAN, times √n
_SURE = 4.0  # of those standard deviations: white rows pass once in 30,000 spans


def excess(A: FloatArray, B: FloatArray, T: FloatArray, covariance: FloatArray) -> float:
    """Variance of the masses of neighbouring blocks over what white rows would give; 1 where they pass for white.

    Parameters
    ----------
    A, B : (C,) float64
        Information of each cell and its score, less what is known of the mass.
    T : (C, p) float64
        How the scores shift with the arm's constants.
    covariance : (p, p) float64
        Of these constants: their errors are no excess.
    """
    return max([1.0, *(_told(A, B, T, covariance, span) for span in SPANS)])


def _told(A: FloatArray, B: FloatArray, T: FloatArray, covariance: FloatArray, span: int) -> float:
    count = A.size // span
    information, score, shift = (_blocks(x, count, span) for x in (A, B, T))
    heavy = information > LIGHTEST * information.max(initial=0.0)
    information, score, shift = information[heavy], score[heavy], shift[heavy]
    if information.size <= FEWEST:
        return 1.0
    J = np.diff(shift / information[:, None], axis=0)
    variance = 1 / information[1:] + 1 / information[:-1] + np.einsum("cx,xy,cy->c", J, covariance, J)
    ratio = float(np.median(np.diff(score / information) ** 2 / variance)) / _MEDIAN
    return ratio if ratio > 1 + _SURE * _SPREAD / np.sqrt(information.size - 1) else 1.0


def _blocks(x: FloatArray, count: int, span: int) -> FloatArray:
    return np.asarray(x[: count * span].reshape(count, span, *x.shape[1:]).sum(axis=1))
