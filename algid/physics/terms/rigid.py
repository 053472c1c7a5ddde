"""Inertia, Coriolis torques and gravity of two links: eq. (1) and (2) of Páez-García et al.

2023.
"""

from algid.physics.parameters import INERTIA, MOMENT, Parameter
from algid.physics.signals import C1, C2, C12, NOTHING, Q1, Q2, S2, W1, W2
from algid.physics.terms.base import Term, TorqueColumn

RIGID = Term(
    name="rigid",
    title="inertia and gravity of the links",
    equation="eq. (1) less viscous friction",
    parameters=(
        Parameter(
            "k1", "k₁", "kg m^2", "inertia that couples the links, m2 l1 lc2", INERTIA, payload=2
        ),
        Parameter(
            "k2", "k₂", "N m", "gravity moment of link 2, m2 g lc2", MOMENT, weighs=True, payload=4
        ),
        Parameter(
            "k3",
            "k₃",
            "kg m^2",
            "inertia of link 2 about joint 2, I2 + m2 lc2²",
            INERTIA,
            payload=1,
        ),
        Parameter(
            "k4",
            "k₄",
            "N m",
            "gravity moment of link 1 with link 2 at its end, g (m1 lc1 + m2 l1)",
            MOMENT,
            weighs=True,
            payload=3,
        ),
        Parameter(
            "k5",
            "k₅",
            "kg m^2",
            "inertia about joint 1 less k3, I1 + m1 lc1² + m2 l1²",
            INERTIA,
            "+",
            payload=0,
        ),
    ),
    columns=(
        TorqueColumn(
            "k1",
            s=(S2, NOTHING),
            p=(2 * C2 * W1, C2 * W1),
            f=(NOTHING, S2 * W1 * W1 + S2 * W1 * W2),
        ),
        TorqueColumn("k2", f=(C12, C12)),
        TorqueColumn("k3", s=(Q1 + Q2, Q1 + Q2)),
        TorqueColumn("k4", f=(C1, NOTHING)),
        TorqueColumn("k5", s=(Q1, NOTHING)),
    ),
    inertial=True,
)
K1, K2, K3, K4, K5 = RIGID.names
