"""A C99 file that needs nothing but the mathematical library."""

from __future__ import annotations

from algid.export import formulas as f
from algid.export.description import Description, header, lacking


def c99(arm: Description) -> str:
    """The arm's dynamics as C functions; without the bodies where ``ARM_DECLARATIONS_ONLY`` is defined."""
    text = "\n".join(f" * {line}".rstrip() for line in header(arm, lacking(arm, f.HELD))).replace("*/", "* /")
    constants = "".join(f"static const double {name} = {value!r};\n" for name, value in f.constants(arm).items())
    return (
        (f"/*\n{text}\n */\n{_DECLARATIONS}{constants}{_STATICS}{_own(arm)}{_inverse(arm)}{_forward(arm)}{_END}")
        .replace("ANGLE1", f.angle(arm, 1, "theta[0]"))
        .replace("ANGLE2", f.angle(arm, 2, "theta[1]"))
        .replace("ROTOR", f.rotor(arm))
    )


_DECLARATIONS = """
/* Angles in rad, velocities in rad/s, accelerations in rad/s^2, torques in N m, inertias in kg m^2. In other files:
 * #define ARM_DECLARATIONS_ONLY, then #include this one. */
#ifndef ALGID_ARM_DECLARED
#define ALGID_ARM_DECLARED
void gravity(const double theta[2], double tau[2]);
void inertia(const double theta[2], double matrix[2][2]);
void inverse_dynamics(const double theta[2], const double omega[2], const double alpha[2], double tau[2]);
void forward_dynamics(const double theta[2], const double omega[2], const double tau[2], double alpha[2]);
#endif

#ifndef ARM_DECLARATIONS_ONLY
#include <math.h>

"""
_END = "\n#endif\n"
_STATICS = f"""
void gravity(const double theta[2], double tau[2])
{{
    const double q1 = ANGLE1, q2 = ANGLE2;
    tau[1] = K2 * cos(q1 + q2);
    tau[0] = K4 * cos(q1) + tau[1];
}}

void inertia(const double theta[2], double matrix[2][2])
{{
    const double c2 = cos(ANGLE2);
    matrix[0][0] = {f.M11};
    matrix[0][1] = matrix[1][0] = {f.M12};
    matrix[1][1] = K3ROTOR;
}}

/* Coriolis, centrifugal and weight's torques. */
static void rest(const double theta[2], const double omega[2], double n[2])
{{
    const double q1 = ANGLE1, q2 = ANGLE2, w1 = omega[0], w2 = omega[1];
    const double c1 = cos(q1), s2 = sin(q2), c12 = cos(q1 + q2);
    n[0] = {f.MOTION[0]};
    n[1] = {f.MOTION[1]};
}}
"""


def _own(arm: Description) -> str:
    signs = (
        "    const double t1 = tanh(w1 / COULOMB_SPEED), t2 = tanh(w2 / COULOMB_SPEED);\n"
        if "t1" in f.friction(arm, 1)
        else ""
    )
    return f"""
/* Torques of the joints' friction and offsets. */
static void friction(const double omega[2], double r[2])
{{
    const double w1 = omega[0], w2 = omega[1];
{signs}    r[0] = {f.friction(arm, 1)};
    r[1] = {f.friction(arm, 2)};
}}
"""


def _inverse(arm: Description) -> str:
    load = (
        "    load1 += E1 * fabs(load1) * tanh(omega[0] / COULOMB_SPEED);\n"
        "    load2 += E2 * fabs(load2) * tanh(omega[1] / COULOMB_SPEED);\n"
        if f.loaded(arm)
        else ""
    )
    second = "load2 + r[1]" + (" + J2 * alpha[1]" if f.rotor(arm) else "")
    return f"""
void inverse_dynamics(const double theta[2], const double omega[2], const double alpha[2], double tau[2])
{{
    const double c2 = cos(ANGLE2);
    double n[2], r[2], load1, load2;
    rest(theta, omega, n);
    friction(omega, r);
    load1 = ({f.M11}) * alpha[0] + ({f.M12}) * alpha[1] + n[0];
    load2 = ({f.M12}) * alpha[0] + K3 * alpha[1] + n[1];
{load}    tau[0] = load1 + r[0];
    tau[1] = {f"GAIN2 * ({second})" if f.gained(arm) else second};
}}
"""


def _forward(arm: Description) -> str:
    return f"""
void forward_dynamics(const double theta[2], const double omega[2], const double tau[2], double alpha[2])
{{
    const double c2 = cos(ANGLE2), m11 = {f.M11}, m12 = {f.M12}, m22 = K3;
    double n[2], r[2], left1, left2;
    rest(theta, omega, n);
    friction(omega, r);
    left1 = tau[0] - r[0];
    left2 = tau[1]{" / GAIN2" if f.gained(arm) else ""} - r[1];
{_LOADED if f.loaded(arm) else _UNLOADED}}}
"""


_UNLOADED = """    const double b1 = left1 - n[0], b2 = left2 - n[1], d = m22ROTOR, det = m11 * d - m12 * m12;
    alpha[0] = (d * b1 - m12 * b2) / det;
    alpha[1] = (m11 * b2 - m12 * b1) / det;
"""
_LOADED = """    const double e1 = E1 * tanh(omega[0] / COULOMB_SPEED), e2 = E2 * tanh(omega[1] / COULOMB_SPEED);
    int up1 = left1 > 0, up2 = left2 > 0;
    for (int trial = 0; trial < 4; trial++) { /* friction grows with the load, whose signs must turn out as assumed */
        const double d1 = 1 + (up1 ? e1 : -e1), d2 = 1 + (up2 ? e2 : -e2);
        const double a = d1 * m11, b = d1 * m12, c = d2 * m12, d = d2 * m22ROTOR;
        const double b1 = left1 - d1 * n[0], b2 = left2 - d2 * n[1], det = a * d - b * c;
        alpha[0] = (d * b1 - b * b2) / det;
        alpha[1] = (a * b2 - c * b1) / det;
        const int new1 = m11 * alpha[0] + m12 * alpha[1] + n[0] > 0;
        const int new2 = m12 * alpha[0] + m22 * alpha[1] + n[1] > 0;
        if (new1 == up1 && new2 == up2)
            break;
        up1 = new1;
        up2 = new2;
    }
"""
