"""A Python module that needs nothing but Python."""

from __future__ import annotations

from algid.export import formulas as f
from algid.export.description import Description, header, lacking


def python_module(arm: Description) -> str:
    """The arm's dynamics as functions of pairs of floats."""
    text = "\n".join(header(arm, lacking(arm, f.HELD))).replace("\\", "/").replace('"""', "'''")
    constants = "".join(f"{name} = {value!r}\n" for name, value in f.constants(arm).items())
    names = ", ".join(["cos", *(["exp"] if "STRIBECK_SPEED" in f.constants(arm) else []), "sin"])
    signs = "    t1, t2 = tanh(w1 / COULOMB_SPEED), tanh(w2 / COULOMB_SPEED)\n" if "t1" in f.friction(arm, 1) else ""
    return (
        (
            f'"""{text}\n"""\n\nfrom math import {names}{", tanh" if f.smooth(arm) else ""}\n\n{constants}{_STATICS}'
            f"{_own(arm, signs)}{_inverse(arm)}{_forward(arm)}"
        )
        .replace("ANGLE1", f.angle(arm, 1, "theta[0]"))
        .replace("ANGLE2", f.angle(arm, 2, "theta[1]"))
        .replace("ROTOR", f.rotor(arm))
    )


_STATICS = f'''

def gravity(theta):
    """Torques in N m that hold the arm's weight at the angles theta in rad."""
    q1, q2 = ANGLE1, ANGLE2
    return K4 * cos(q1) + K2 * cos(q1 + q2), K2 * cos(q1 + q2)


def inertia(theta):
    """Inertia matrix in kg m^2 at the angles theta in rad, as two rows."""
    c2 = cos(ANGLE2)
    return ({f.M11}, {f.M12}), ({f.M12}, K3ROTOR)


def _rest(theta, omega):
    """Coriolis, centrifugal and weight's torques."""
    q1, q2 = ANGLE1, ANGLE2
    w1, w2 = omega
    c1, s2, c12 = cos(q1), sin(q2), cos(q1 + q2)
    return {f.MOTION[0]}, {f.MOTION[1]}

'''


def _own(arm: Description, signs: str) -> str:
    return f'''
def _friction(omega):
    """Torques of the joints' friction and offsets."""
    w1, w2 = omega
{signs}    return {f.friction(arm, 1)}, {f.friction(arm, 2)}

'''


def _inverse(arm: Description) -> str:
    load = (
        "    load1 += E1 * abs(load1) * tanh(omega[0] / COULOMB_SPEED)\n"
        "    load2 += E2 * abs(load2) * tanh(omega[1] / COULOMB_SPEED)\n"
        if f.loaded(arm)
        else ""
    )
    second = "load2 + r2" + (" + J2 * alpha[1]" if f.rotor(arm) else "")
    return f'''
def inverse_dynamics(theta, omega, alpha):
    """Torques in N m that give the accelerations alpha in rad/s^2 at theta in rad and omega in rad/s."""
    c2 = cos(ANGLE2)
    n1, n2 = _rest(theta, omega)
    r1, r2 = _friction(omega)
    load1 = ({f.M11}) * alpha[0] + ({f.M12}) * alpha[1] + n1
    load2 = ({f.M12}) * alpha[0] + K3 * alpha[1] + n2
{load}    return load1 + r1, {f"GAIN2 * ({second})" if f.gained(arm) else second}

'''


def _forward(arm: Description) -> str:
    return f'''
def forward_dynamics(theta, omega, tau):
    """Accelerations in rad/s^2 under the torques tau in N m at theta in rad and omega in rad/s."""
    c2 = cos(ANGLE2)
    n1, n2 = _rest(theta, omega)
    r1, r2 = _friction(omega)
    left1, left2 = tau[0] - r1, tau[1]{" / GAIN2" if f.gained(arm) else ""} - r2
    m11, m12, m22 = {f.M11}, {f.M12}, K3
{_LOADED if f.loaded(arm) else _UNLOADED}'''


_UNLOADED = """    b1, b2, d = left1 - n1, left2 - n2, m22ROTOR
    det = m11 * d - m12 * m12
    return (d * b1 - m12 * b2) / det, (m11 * b2 - m12 * b1) / det
"""
_LOADED = """    e1, e2 = E1 * tanh(omega[0] / COULOMB_SPEED), E2 * tanh(omega[1] / COULOMB_SPEED)
    up1, up2 = left1 > 0, left2 > 0
    for _ in range(4):  # friction grows with the load, whose signs must turn out as assumed
        d1, d2 = 1 + (e1 if up1 else -e1), 1 + (e2 if up2 else -e2)
        a, b, c, d = d1 * m11, d1 * m12, d2 * m12, d2 * m22ROTOR
        b1, b2 = left1 - d1 * n1, left2 - d2 * n2
        det = a * d - b * c
        alpha1, alpha2 = (d * b1 - b * b2) / det, (a * b2 - c * b1) / det
        new1, new2 = m11 * alpha1 + m12 * alpha2 + n1 > 0, m12 * alpha1 + m22 * alpha2 + n2 > 0
        if (new1, new2) == (up1, up2):
            break
        up1, up2 = new1, new2
    return alpha1, alpha2
"""
