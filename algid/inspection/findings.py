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
SATURATED_EFFORT      no       a torque that stands at its limit
CLIPPED_TORQUE        no       a torque that a sensor or a drive cuts off, by the motion
HELD_EFFORT           no       a torque that holds its value for samples while the angle moves
DEAD_EFFORT           no       a torque that keeps one value where others change all the time
LOST_SAMPLES          no       steps twice as long as usual, though the stamps are even
RESTS                 no       the arm stands still before it moves, or after
GAPS                  no       samples are missing
JITTER                no       uneven stamps
SLOW_SAMPLING         no       fewer than ten samples in a period of the motion
SHORT_LOG             no       less than a second
NEAR_STAMPS           no       samples that stand all but on top of one another
GRAVITY_COMPENSATED   no       torques do not carry the arm's weight
WRONG_CONVENTION      no       physics contradicts the convention, and one other is right
ZERO_OFFSET           no       the zeros of the angles are a little off
FLIPPED_SIGN          no       gravity pulls upwards: a sign is wrong
WRONG_ZERO            no       gravity pulls sideways: θ1 is not from the horizontal
====================  =======  ==========================================================
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from algid.notices import Notice, Remedy

REFUSED = ("EFFORT_ZERO", "EFFORT_DENORMAL", "EFFORT_CONSTANT", "WRAPPED_ANGLE", "DEGREES")
"""The checks that refuse a log unless they are accepted."""

CONTRADICTIONS = ("WRONG_CONVENTION", "FLIPPED_SIGN", "WRONG_ZERO")
"""Findings that say that a log was read by a wrong convention."""


def yielding(notice: Notice, accepted: Collection[str]) -> Notice:
    """A refusal with what overrides it, or as a warning where its code is in `accepted`.

    Else the same.
    """
    if not notice.refuse:
        return notice
    if notice.code in accepted:
        numbers = {**notice.numbers, "accepted": True}
        return replace(notice, refuse=False, remedies=(), text="", numbers=numbers)
    override = Remedy({"accept": notice.code}, "to use it nevertheless")
    return replace(notice, remedies=(*notice.remedies, override))
