"""Conventions of angles and torques: what each does to a log, and what no log can determine.

A log may have been recorded under another convention than algid's: signs, order of the joints, θ2
from the horizontal, another zero, angles of the motors, a second motor that stands at the base. Or
it was read under another one, and is plain. Each such mistake is a linear map of (θ, τ), so each is
tried: the log is mapped back and eq. (1), with friction and offsets, fitted in its weak form.

**Zeros are linear.** With θ1 + δ1 and θ2 + δ2 in the place of the angles, k4 cos θ1 becomes k4 cos
δ1 cos θ1 − k4 sin δ1 sin θ1; likewise k2 with δ1 + δ2, and k1 with δ2. Each of the three has
therefore a second column, a quarter turn on, and one pass over the log serves every zero. Signs,
order and drive of the torques are linear in the torques. A second motor at the base turns θ1 + θ2
and does the work τ_m1 θ̇1 + τ_m2 (θ̇1 + θ̇2): the torque at joint 1 is the sum of both. Only order,
relative sign, reference and scale of the angles need a pass of their own.

**What no log can determine** (tests prove each):

- θ → −θ, τ → −τ, δ1 → π − δ1, δ2 → −δ2: the arm seen from behind. All signs flipped is the same as
  θ1 from the other horizontal, the constants are the same, and half of the conventions need not be
  tried. With zeros that hang it is no mistake at all.
- τ → a τ, and t → a t: a common gain, a clock that runs fast. The constants scale, no equation is
  broken.
- θ2 → θ2 + π turns k1 and k2 round. Only k1 k2 = m2² g l1 lc2² ≥ 0 is demanded by physics; that k1
  and k2 themselves are positive says that link 2's centre of gravity lies on link 2's side of its
  joint, which no counterweight spoils.
- Without gravity, every δ1.

======  ==================================================================  ==================
symbol  name                                                                shape
======  ==================================================================  ==================
G       products of the moments of q columns and of both torques as they    (2, q + 2, q + 2)
        were recorded, by joint, summed over windows
B       torques at the joints by those that were recorded                   (2, 2)
c       coefficients under one convention's zeros                           (p,), p ≤ 12
T       c's place among the columns, for the zeros δ1 and δ2                (q, p)
======  ==================================================================  ==================
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import pi, remainder

import numpy as np

from algid.arm import FloatArray
from algid.base.criteria import AT_REST
from algid.estimators import weak
from algid.estimators.modulating_functions import OVERLAP, Windows
from algid.estimators.problem import OF_A_WINDOW, Problem, Source, TooShortError, WeakSettings
from algid.model import Model
from algid.physics.terms.coulomb import COULOMB
from algid.physics.terms.offset import OFFSET
from algid.physics.terms.phases import PHASES
from algid.physics.terms.rotor import ROTOR
from algid.signals.segments import Segment

MODEL = Model((COULOMB.name, OFFSET.name, ROTOR.name, PHASES.name), coulomb_speed=0.1)
WINDOW = 0.4  # s
_LEAST_POWER = 1e-280  # (N m)²: the square of a torque of denormal numbers is zero
_FLOOR = 1e-9  # of a torque's power: a residual below it is rounding


@dataclass(frozen=True)
class Convention:
    """What has to be done to angles and torques as they were read; by default nothing.

    The angles of the joints change places, are divided by `scale`, multiplied by `signs`, θ1 is
    taken off an `absolute` θ2, and `zero` is added. The torques change places, are multiplied by
    `torque_signs`, and τ2 is added to τ1 where the second motor stands at the `base`. Of a θ2 that
    was read as absolute and is not, or a motor read as one at the base, these are -1.
    """

    swapped: bool = False
    scale: tuple[float, float] = (1.0, 1.0)
    signs: tuple[int, int] = (1, 1)
    absolute: int = 0
    zero: tuple[float, float] = (0.0, 0.0)
    torques_swapped: bool = False
    torque_signs: tuple[int, int] = (1, 1)
    base: int = 0

    def angles(self, theta: FloatArray) -> FloatArray:
        """Angles (2, N) in rad under algid's convention out of those that were read."""
        A = np.diag(np.divide(self.signs, self.scale))
        A[1] -= self.absolute * A[0]
        return (A[:, ::-1] if self.swapped else A) @ theta + np.array(self.zero)[:, None]

    @property
    def drive(self) -> FloatArray:
        """B, by which torques at the joints are those that were read."""
        B = np.diag(self.torque_signs).astype(np.float64)
        B[0] += self.base * B[1]
        return B[:, ::-1] if self.torques_swapped else B

    def mirrored(self) -> Convention:
        """The same arm seen from behind: another convention with the same constants."""
        turn = (remainder(pi - self.zero[0], 2 * pi), remainder(-self.zero[1], 2 * pi))
        return replace(
            self,
            signs=(-self.signs[0], -self.signs[1]),
            torque_signs=(-self.torque_signs[0], -self.torque_signs[1]),
            zero=turn,
        )


AS_READ = Convention()


@dataclass(frozen=True, eq=False)
class ConventionSums:
    """Sums over the windows of logs whose angles were mapped.

    G, how many windows that do not overlap it holds for each joint, the joints' RMS speeds (2,) in
    rad/s, and how long the logs move, in s.
    """

    gram: FloatArray
    independent: FloatArray
    speed: FloatArray
    seconds: float


def thinned(theta: FloatArray, tau: FloatArray, dt: float, rate: float, longest: float) -> Segment:
    """Means over as many samples as leave `rate` Hz, of the first `longest` s."""
    width = max(1, round(1 / (rate * dt)))
    count = min(theta.shape[1], round(longest / dt)) // width
    signals = np.stack([theta, tau])[:, :, : count * width]
    return Segment(0.0, width * dt, *signals.reshape(2, 2, count, width).mean(axis=3))


def summed(angles: Convention, logs: Sequence[Segment], model: Model) -> ConventionSums:
    """Sums over the windows of logs of one arm for angles so mapped.

    Where a joint is slower than `AT_REST` of its RMS speed in all of them, dry friction may hold
    it, and no equation of motion holds.

    Raises
    ------
    TooShortError
        If no log is long enough for a window.
    """

    def torques(piece: Segment, windows: Windows) -> FloatArray:
        return np.stack([windows.torque_moments(piece.tau)] * 2)

    sources: list[Source] = [
        partial(list, [replace(log, theta=angles.angles(log.theta))]) for log in logs
    ]
    settings = WeakSettings(model, WINDOW)
    speed = weak.speeds(sources, settings)
    rest = (AT_REST * speed[0], AT_REST * speed[1])
    problem = Problem(sources, settings=replace(settings, rest=rest))
    normals = weak.normals_of(problem, beside=torques)
    if not normals:
        raise TooShortError(f"no {OF_A_WINDOW}")
    gram = np.sum([normal.total for normal in normals], axis=0)
    rows = np.stack([normal.rows for normal in normals])
    seconds = WINDOW / OVERLAP * np.sum(rows.max(axis=1) + OVERLAP)
    return ConventionSums(gram[:, :-1, :-1], rows.sum(axis=0) / OVERLAP, speed, seconds)


def solved(
    sums: ConventionSums, families: Sequence[Convention], T: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Weighted least squares of n fits: for families with one T (1, q, p), or for one with n.

    Gives c (n, p), shares left (n, 2) and covariances (n, p, p). Where a joint has no torque
    what is left is a share of what acts on it, summed over the columns, as constants near nothing
    leave nothing of it.
    """
    q, p = T.shape[1:]
    drives = np.stack([family.drive for family in families])
    M = np.zeros((max(len(drives), len(T)), 2, q + 2, p + 1))
    M[..., :q, :p] = T[:, None]
    M[..., q:, p] = drives
    gram = M.swapaxes(-1, -2) @ sums.gram @ M
    own = np.stack([replace(family, base=0).drive for family in families])
    power = np.einsum("faj,ajj->fa", own**2, sums.gram[:, q:, q:])
    power = np.broadcast_to(np.maximum(power, _LEAST_POWER), (len(M), 2))
    motorless = power == _LEAST_POWER
    ridge = 1e-12 * np.eye(p)

    def solve(weights: FloatArray, _: tuple[FloatArray, ...]) -> tuple[FloatArray, ...]:
        normal = np.einsum("za,zaxy->zxy", weights, gram)
        size = np.sqrt(np.maximum(np.einsum("zii->zi", normal[:, :p, :p]), 1e-140))
        scale = size[:, :, None] * size[:, None, :]
        inverse = np.linalg.inv(normal[:, :p, :p] / scale + ridge) / scale
        c = np.einsum("zij,zj->zi", inverse, normal[:, :p, p])
        acting = np.einsum("zaii,zi->za", gram[..., :p, :p], c**2)
        share = np.where(motorless, np.maximum(acting, _LEAST_POWER), power)
        v = np.append(-c, np.ones((len(c), 1)), 1)
        squares = np.einsum("zi,zaij,zj->za", v, gram, v)
        return c, np.maximum(squares, _FLOOR * share), share, inverse

    def weigh(state: tuple[FloatArray, ...]) -> FloatArray:
        return sums.independent / state[1]

    start: tuple[FloatArray, ...] = (power, np.where(motorless, power[:, ::-1], power))
    (c, squares, share, inverse), _ = weak.reweighted(weigh, solve, start)
    return c, squares / share, inverse
