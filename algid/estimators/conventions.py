"""Conventions of angles and torques: what each does to a log, and what no log can determine.

A log may have been recorded under another convention than algid's: signs, order of the joints, θ2
from the horizontal, another zero, angles of the motors, a second motor that stands at the base. Or
it was read under another one, and is plain. Each such mistake is a linear map of (θ, τ), so each is
tried: the log is mapped back and eq. (1), with friction and offsets, fitted in its weak form.

**Zeros are linear.** With θ1 + δ1 and θ2 + δ2 in the place of the angles, k4 cos θ1 becomes k4 cos
δ1 cos θ1 − k4 sin δ1 sin θ1; likewise k2 with δ1 + δ2, and k1 with δ2. Each of the three has
therefore a second column, a quarter turn on, and one pass over the log serves every zero. Signs
and order of the torques are linear in b. A second motor at the base turns θ1 + θ2 and does the
work τ_m1 θ̇1 + τ_m2 (θ̇1 + θ̇2): its own equations are the difference of the joints' and the
second joint's. Only order, relative sign, reference and scale of the angles need a pass of their
own.

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
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi, remainder

import numpy as np

from algid.arm import FloatArray


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
        if self.swapped:
            theta = theta[::-1]
        first = theta[0] * (self.signs[0] / self.scale[0])
        second = theta[1] * (self.signs[1] / self.scale[1])
        second = second - self.absolute * first
        return np.stack([first, second]) + np.array(self.zero)[:, None]

    def torques(self, tau: FloatArray) -> FloatArray:
        """Torques (2, N) at the joints in N m out of those that were read."""
        if self.torques_swapped:
            tau = tau[::-1]
        first, second = self.torque_signs[0] * tau[0], self.torque_signs[1] * tau[1]
        return np.stack([first + self.base * second, second])

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
