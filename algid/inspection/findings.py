"""What the named checks of a log may find, and whether that forbids its use.

====================  =======  ==========================================================
code                  refused  seen
====================  =======  ==========================================================
EFFORT_ZERO           yes      a torque is zero throughout
EFFORT_DENORMAL       yes      a torque below 1e-6 N m throughout, as from unset memory
EFFORT_CONSTANT       yes      a torque that never changes
WRAPPED_ANGLE         yes      an angle jumps by 2π between two samples
DEGREES               yes      angles or velocities are 57.3 times what the others say
ANGLE_CONSTANT        no       an angle that never changes
STUCK_SENSOR          no       an angle freezes in motion and jumps when it comes back
SPIKES                no       single samples far off their neighbours
SATURATED_EFFORT      no       a torque clipped at its limit
DEAD_EFFORT           no       a torque that keeps one value where others change all the time
LOST_SAMPLES          no       steps twice as long as usual, though the stamps are even
RESTS                 no       the arm stands still before it moves, or after
GAPS                  no       samples are missing
JITTER                no       uneven stamps
SLOW_SAMPLING         no       fewer than ten samples in a period of the motion
SHORT_LOG             no       less than a second
NEAR_STAMPS           no       samples that stand all but on top of one another
GRAVITY_COMPENSATED   no       torques do not carry the arm's weight
WRONG_CONVENTION      no       physics contradicts signs, order, reference or zeros, and one other convention is right
ZERO_OFFSET           no       the zeros of the angles are a little off
FLIPPED_SIGN          no       gravity pulls upwards: a sign is wrong
WRONG_ZERO            no       gravity pulls sideways: θ1 is not from the horizontal
====================  =======  ==========================================================
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

REFUSED = ("EFFORT_ZERO", "EFFORT_DENORMAL", "EFFORT_CONSTANT", "WRAPPED_ANGLE", "DEGREES")
"""The checks that refuse a log unless they are accepted."""


@dataclass(frozen=True)
class Finding:
    """One thing seen: its code, what it means, whether the log is refused for it, and the flags that mend it.

    `note` tells that it may be right as it is, and is no reason to doubt a result.
    """

    code: str
    text: str
    refuse: bool = False
    flags: tuple[str, ...] = ()
    note: bool = False

    def yielding(self, accepted: Collection[str]) -> Finding:
        """A refusal with what overrides it named, or as a warning where its code is in `accepted`; else the same."""
        if not self.refuse:
            return self
        if self.code in accepted:
            return replace(self, refuse=False, text=f"{self.text}; used nevertheless, as accept says")
        override = f'--accept {self.code} (profile: accept = ["{self.code}"])'
        return replace(self, text=f"{self.text}; to use it nevertheless: {override}")
