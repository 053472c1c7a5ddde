"""Sine parts of the three moments: centres of mass off the links' lines, and angle offsets.

The moments are phasors, K = k + i k_s: the columns of the sine parts are those of k1, k2 and k4
with the angle a quarter turn on. With centres of mass turned by δ off the links' lines and encoder
zeros off by ε, arg K1 = δ2 + ε2 and arg K2 = δ2 + ε1 + ε2.
"""

from algid.physics.parameters import INERTIA, MOMENT, Parameter
from algid.physics.signals import C2, NOTHING, S1, S2, S12, W1, W2
from algid.physics.terms.base import PriorSpread, Term, TorqueColumn

PHASES = Term(
    name="phases",
    title="centres of mass off the links' lines, or zeros that are off",
    equation="k1, k2, k4 as phasors: k1s, k2s, k4s with the angle a quarter turn on",
    parameters=(
        Parameter(
            "k1s",
            "k₁ₛ",
            "kg m^2",
            "sine part of k1: centre of mass of link 2 across its line",
            INERTIA,
        ),
        Parameter(
            "k2s",
            "k₂ₛ",
            "N m",
            "sine part of k2, the gravity moment of link 2",
            MOMENT,
            weighs=True,
        ),
        Parameter(
            "k4s",
            "k₄ₛ",
            "N m",
            "sine part of k4, the gravity moment of link 1",
            MOMENT,
            weighs=True,
        ),
    ),
    columns=(
        TorqueColumn(
            "k1s",
            s=(C2, NOTHING),
            p=(-2 * S2 * W1, -S2 * W1),
            f=(NOTHING, C2 * W1 * W1 + C2 * W1 * W2),
        ),
        TorqueColumn("k2s", f=(-S12, -S12)),
        TorqueColumn("k4s", f=(-S1, NOTHING)),
    ),
    inertial=True,
    sines=(("k1s", "k1"), ("k2s", "k2"), ("k4s", "k4")),
    # rad: a bent gripper; most arms have an encoder's error
    spread=PriorSpread(0.5, "cosine", 0.02),
)
