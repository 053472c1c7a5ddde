from __future__ import annotations

from algid.signals.differences import AT_ONCE, TorqueShift


def test_a_held_torque_acts_half_a_sample_later_and_delays_add_up() -> None:
    assert AT_ONCE.at(0.01) == 0
    assert TorqueShift(held=True).at(0.01) == 0.005
    later = TorqueShift(held=True, delay=0.25).later(0.5)
    assert later.at(0.5) == 1.0
    assert later.held
