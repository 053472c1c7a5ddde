"""A C99 file that needs nothing but the mathematical library, and a Python module that needs nothing but Python.

Both are made of the torque in expressions that the two languages read alike, written out for the model's own terms
only. In them c1, c2, s2, c12 are cosines and sines of θ1, θ2 and θ1 + θ2, w1 and w2 velocities, t1 and t2
tanh(ω / ω_s); constants have the names of `algid.model.COLUMN_NAMES` in capitals.
"""

from __future__ import annotations

from string import Template

from algid.export.description import Description, header, lacking

HELD = frozenset({"coulomb", "offset", "rotor", "stribeck", "asymmetry", "load", "gain", "zero"})
_SMOOTH = frozenset({"coulomb", "stribeck", "asymmetry"})  # terms of a joint's own velocity with tanh(ω / ω_s)
_RIGID = {
    "M11": "K5 + K3 + 2 * K1 * c2",
    "M12": "K3 + K1 * c2",
    # n of both joints: the load L = M θ̈ + n less its inertial part
    "N1": "-K1 * s2 * (2 * w1 + w2) * w2 + K4 * c1 + K2 * c12",
    "N2": "K1 * s2 * w1 * w1 + K2 * c12",
}


def c99(arm: Description) -> str:
    """The arm's dynamics as C functions; without the bodies where ``ARM_DECLARATIONS_ONLY`` is defined."""
    text = "\n".join(f" * {line}".rstrip() for line in header(arm, lacking(arm, HELD))).replace("*/", "* /")
    constants = "".join(f"static const double {name} = {value!r};\n" for name, value in _constants(arm).items())
    return _written(arm, _C, _C_BY_TERM, text, constants)


def python_module(arm: Description) -> str:
    """The arm's dynamics as functions of pairs of floats."""
    text = "\n".join(header(arm, lacking(arm, HELD))).replace("\\", "/").replace('"""', "'''")
    named = _constants(arm)
    functions = ["cos", *(["exp"] if "STRIBECK_SPEED" in named else []), "sin"]
    functions += ["tanh"] if "COULOMB_SPEED" in named else []
    constants = "".join(f"{name} = {value!r}\n" for name, value in named.items())
    return _written(arm, _PYTHON, _PYTHON_BY_TERM, text, f"from math import {', '.join(functions)}\n\n{constants}")


def _constants(arm: Description) -> dict[str, float]:
    """Constants of the module by their names."""
    model, value = arm.coefficients.model, arm.coefficients.value
    found = {f"K{number}": value[f"k{number}"] for number in range(1, 8)}
    found |= {name.upper(): value[name] for name in model.names if name[0] != "k" and name != "lag"}
    if "gain" in model.terms:
        found["GAIN2"] = 1 + value["gain2"]
    if (_SMOOTH | {"load"}) & set(model.terms):
        found["COULOMB_SPEED"] = model.coulomb_speed
    if "stribeck" in model.terms:
        found["STRIBECK_SPEED"] = model.stribeck_speed
    return found


def _written(arm: Description, form: str, by_term: dict[str, str], text: str, constants: str) -> str:
    """A language's form with the constants, and with what its parts are for the model's terms."""
    terms, names = arm.coefficients.model.terms, arm.coefficients.model.names

    def friction(joint: int) -> str:
        """What a joint loses by its own velocity, and its offset."""
        w, t = f"w{joint}", f"t{joint}"
        found = {
            "coulomb": f"F{joint} * {t}",
            "stribeck": f"S{joint} * {t} * exp(-({w} / STRIBECK_SPEED) * ({w} / STRIBECK_SPEED))",
            "asymmetry": f"A{joint} * {t} * {t}",
            "offset": f"O{joint}",
        }
        return " + ".join([f"K{joint + 5} * {w}", *(part for term, part in found.items() if term in terms)])

    second = by_term["second"] + (" + J2 * alpha[1]" if "rotor" in terms else "")
    parts = {
        **_RIGID,
        **{f"ANGLE{n + 1}": f"theta[{n}]" + f" + ZERO{n + 1}" * (f"zero{n + 1}" in names) for n in range(2)},
        "TEXT": text,
        "CONSTANTS": constants,
        "ROTOR": " + J2" if "rotor" in terms else "",
        "SIGNS": by_term["signs"] if _SMOOTH & set(terms) else "",
        "FRICTION1": friction(1),
        "FRICTION2": friction(2),
        "LOAD": by_term["load"] if "load" in terms else "",
        "SECOND": f"GAIN2 * ({second})" if "gain" in terms else second,
        "GAIN": " / GAIN2" if "gain" in terms else "",
    }
    parts["SOLVED"] = Template(by_term["solved with load" if "load" in terms else "solved"]).substitute(parts)
    return Template(form).substitute(parts)


_C = """/*
$TEXT
 */

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

$CONSTANTS
void gravity(const double theta[2], double tau[2])
{
    const double q1 = $ANGLE1, q2 = $ANGLE2;
    tau[1] = K2 * cos(q1 + q2);
    tau[0] = K4 * cos(q1) + tau[1];
}

void inertia(const double theta[2], double matrix[2][2])
{
    const double c2 = cos($ANGLE2);
    matrix[0][0] = $M11;
    matrix[0][1] = matrix[1][0] = $M12;
    matrix[1][1] = K3$ROTOR;
}

/* Coriolis, centrifugal and weight's torques. */
static void rest(const double theta[2], const double omega[2], double n[2])
{
    const double q1 = $ANGLE1, q2 = $ANGLE2, w1 = omega[0], w2 = omega[1];
    const double c1 = cos(q1), s2 = sin(q2), c12 = cos(q1 + q2);
    n[0] = $N1;
    n[1] = $N2;
}

/* Torques of the joints' friction and offsets. */
static void friction(const double omega[2], double r[2])
{
    const double w1 = omega[0], w2 = omega[1];
$SIGNS    r[0] = $FRICTION1;
    r[1] = $FRICTION2;
}

void inverse_dynamics(const double theta[2], const double omega[2], const double alpha[2], double tau[2])
{
    const double c2 = cos($ANGLE2);
    double n[2], r[2], load1, load2;
    rest(theta, omega, n);
    friction(omega, r);
    load1 = ($M11) * alpha[0] + ($M12) * alpha[1] + n[0];
    load2 = ($M12) * alpha[0] + K3 * alpha[1] + n[1];
$LOAD    tau[0] = load1 + r[0];
    tau[1] = $SECOND;
}

void forward_dynamics(const double theta[2], const double omega[2], const double tau[2], double alpha[2])
{
    const double c2 = cos($ANGLE2), m11 = $M11, m12 = $M12, m22 = K3;
    double n[2], r[2], left1, left2;
    rest(theta, omega, n);
    friction(omega, r);
    left1 = tau[0] - r[0];
    left2 = tau[1]$GAIN - r[1];
$SOLVED}

#endif
"""
_C_BY_TERM = {
    "signs": "    const double t1 = tanh(w1 / COULOMB_SPEED), t2 = tanh(w2 / COULOMB_SPEED);\n",
    "load": """    load1 += E1 * fabs(load1) * tanh(omega[0] / COULOMB_SPEED);
    load2 += E2 * fabs(load2) * tanh(omega[1] / COULOMB_SPEED);
""",
    "second": "load2 + r[1]",
    "solved": """    const double b1 = left1 - n[0], b2 = left2 - n[1], d = m22$ROTOR, det = m11 * d - m12 * m12;
    alpha[0] = (d * b1 - m12 * b2) / det;
    alpha[1] = (m11 * b2 - m12 * b1) / det;
""",
    "solved with load": """\
    const double e1 = E1 * tanh(omega[0] / COULOMB_SPEED), e2 = E2 * tanh(omega[1] / COULOMB_SPEED);
    int up1 = left1 > 0, up2 = left2 > 0;
    for (int trial = 0; trial < 4; trial++) { /* friction grows with the load, whose signs must turn out as assumed */
        const double d1 = 1 + (up1 ? e1 : -e1), d2 = 1 + (up2 ? e2 : -e2);
        const double a = d1 * m11, b = d1 * m12, c = d2 * m12, d = d2 * m22$ROTOR;
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
""",
}
_PYTHON = '''"""$TEXT
"""

$CONSTANTS

def gravity(theta):
    """Torques in N m that hold the arm's weight at the angles theta in rad."""
    q1, q2 = $ANGLE1, $ANGLE2
    return K4 * cos(q1) + K2 * cos(q1 + q2), K2 * cos(q1 + q2)


def inertia(theta):
    """Inertia matrix in kg m^2 at the angles theta in rad, as two rows."""
    c2 = cos($ANGLE2)
    return ($M11, $M12), ($M12, K3$ROTOR)


def _rest(theta, omega):
    """Coriolis, centrifugal and weight's torques."""
    q1, q2 = $ANGLE1, $ANGLE2
    w1, w2 = omega
    c1, s2, c12 = cos(q1), sin(q2), cos(q1 + q2)
    return $N1, $N2


def _friction(omega):
    """Torques of the joints' friction and offsets."""
    w1, w2 = omega
$SIGNS    return $FRICTION1, $FRICTION2


def inverse_dynamics(theta, omega, alpha):
    """Torques in N m that give the accelerations alpha in rad/s^2 at theta in rad and omega in rad/s."""
    c2 = cos($ANGLE2)
    n1, n2 = _rest(theta, omega)
    r1, r2 = _friction(omega)
    load1 = ($M11) * alpha[0] + ($M12) * alpha[1] + n1
    load2 = ($M12) * alpha[0] + K3 * alpha[1] + n2
$LOAD    return load1 + r1, $SECOND


def forward_dynamics(theta, omega, tau):
    """Accelerations in rad/s^2 under the torques tau in N m at theta in rad and omega in rad/s."""
    c2 = cos($ANGLE2)
    n1, n2 = _rest(theta, omega)
    r1, r2 = _friction(omega)
    left1, left2 = tau[0] - r1, tau[1]$GAIN - r2
    m11, m12, m22 = $M11, $M12, K3
$SOLVED'''
_PYTHON_BY_TERM = {
    "signs": "    t1, t2 = tanh(w1 / COULOMB_SPEED), tanh(w2 / COULOMB_SPEED)\n",
    "load": """    load1 += E1 * abs(load1) * tanh(omega[0] / COULOMB_SPEED)
    load2 += E2 * abs(load2) * tanh(omega[1] / COULOMB_SPEED)
""",
    "second": "load2 + r2",
    "solved": """    b1, b2, d = left1 - n1, left2 - n2, m22$ROTOR
    det = m11 * d - m12 * m12
    return (d * b1 - m12 * b2) / det, (m11 * b2 - m12 * b1) / det
""",
    "solved with load": """    e1, e2 = E1 * tanh(omega[0] / COULOMB_SPEED), E2 * tanh(omega[1] / COULOMB_SPEED)
    up1, up2 = left1 > 0, left2 > 0
    for _ in range(4):  # friction grows with the load, whose signs must turn out as assumed
        d1, d2 = 1 + (e1 if up1 else -e1), 1 + (e2 if up2 else -e2)
        a, b, c, d = d1 * m11, d1 * m12, d2 * m12, d2 * m22$ROTOR
        b1, b2 = left1 - d1 * n1, left2 - d2 * n2
        det = a * d - b * c
        alpha1, alpha2 = (d * b1 - b * b2) / det, (a * b2 - c * b1) / det
        new1, new2 = m11 * alpha1 + m12 * alpha2 + n1 > 0, m12 * alpha1 + m22 * alpha2 + n2 > 0
        if (new1, new2) == (up1, up2):
            break
        up1, up2 = new1, new2
    return alpha1, alpha2
""",
}
