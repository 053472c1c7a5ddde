"""After how long a logged torque acts."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class TorqueShift:
    """Half a sample where the torque is `held` from each sample to the next, and a `delay` in s."""

    held: bool = False
    delay: float = 0.0

    def at(self, dt: float) -> float:
        """The time in s where samples are `dt` s apart."""
        return (0.5 * dt if self.held else 0.0) + self.delay

    def later(self, delay: float) -> TorqueShift:
        """The same with `delay` s on top."""
        return replace(self, delay=self.delay + delay)


AT_ONCE = TorqueShift()
"""A torque that acts when it is stamped, and moves evenly from sample to sample."""
