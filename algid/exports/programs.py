"""A C99 file with the mathematical library only, and a Python module with nothing but Python.

Both are written out of the model's columns, in expressions that the two languages read alike:
inertia, what is left of the torque at zero acceleration, and how terms act on the torque. In them
q1, q2, w1, w2 are angles and velocities, s1 … c12 sines and cosines of θ1, θ2 and θ1 + θ2, t1 and
t2 tanh(ω / ω_s); parameters have their names in capitals.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from string import Template

from algid.exports.description import Description, comment, header, lacking
from algid.model import TERMS, Model, Weighted, attributes
from algid.physics.expressions import Atom, Product
from algid.physics.motion import Widths

HELD = frozenset(name for name, term in TERMS.items() if term.timing is None)
_FUNCTIONS = ("cos", "exp", "sin", "tanh")


def c99(arm: Description) -> str:
    """The arm's dynamics as C functions.

    Without the bodies where ``ARM_DECLARATIONS_ONLY`` is defined.
    """
    text = comment(arm, lacking(arm, HELD), " * ")
    constants = ""
    for name, value in _constants(arm).items():
        constants += f"static const double {name} = {value!r};\n"
    parts = {"TEXT": text.replace("*/", "* /"), "CONSTANTS": constants}
    return _written(arm, _C, _C_BY_TERM, parts)


def python_module(arm: Description) -> str:
    """The arm's dynamics as functions of pairs of floats."""
    text = "\n".join(header(arm, lacking(arm, HELD))).replace("\\", "/").replace('"""', "'''")
    constants = ""
    for name, value in _constants(arm).items():
        constants += f"{name} = {value!r}\n"
    body = _written(arm, _PYTHON, _PYTHON_BY_TERM, {"CONSTANTS": constants})
    used = [name for name in _FUNCTIONS if re.search(rf"\b{name}\(", body)]
    return f'"""{text}\n"""\n\nfrom math import {", ".join(used)}\n\n{body}'


def _constants(arm: Description) -> dict[str, float]:
    """Constants of the module by their names."""
    model, value = arm.coefficients.model, arm.coefficients.value
    constants = {name.upper(): value[name] for name in model.names if name != model.lag_name}
    shapes: set[str] = set()
    for term in model.terms:
        shapes.update(TERMS[term].shapes)
    for width in fields(Widths):
        if width.name in shapes:
            constants[width.name.upper()] = getattr(model, width.name)
    return constants


def _source(model: Model, weighted: Weighted) -> str:
    """An expression that is linear in the parameters, as text; "" where it is nothing."""
    text = ""
    for product, pairs in weighted.items():
        for place, factor in pairs:
            sign = "-" if factor < 0 else "+"
            if text:
                text += f" {sign} "
            else:
                text = sign.removeprefix("+")
            factors = [model.names[place].upper()]
            factors += [atom.name for atom in product]
            if abs(factor) != 1:
                factors.insert(0, f"{abs(factor):g}")
            text += " * ".join(factors)
    return text


def _definitions(expressions: list[Weighted], form: str) -> str:
    """Lines that define what the expressions hold, each in a language's `form`."""
    atoms: set[Atom] = set()
    for expression in expressions:
        for product in expression:
            atoms.update(product)
    named, defined = "", ""
    for atom in sorted(atoms):
        named += f"{atom.name} "
        if atom.source:
            defined += form.format(f"{atom.name} = {atom.source}")
    states = ""
    for letter, name in (("q", "theta"), ("w", "omega")):
        for number in (1, 2):
            if re.search(rf"\b{letter}{number}\b", named + defined):
                states += form.format(f"{letter}{number} = {name}[{number - 1}]")
    return states + defined


@dataclass(frozen=True, eq=False)
class _Expressions:
    """The model's expressions: M and n of the joints' load, and the part of the other terms."""

    model: Model

    @cached_property
    def others(self) -> list[int]:
        """Places of the columns that are no load."""
        compiled = self.model.compiled
        return sorted(set(range(len(compiled.names))) - set(compiled.loads))

    def inertia(self, places: list[int]) -> dict[tuple[int, int], Weighted]:
        """What multiplies the accelerations, of the columns at `places`."""
        compiled = self.model.compiled
        own = {}
        for entry, weighted in compiled.inertia.items():
            own[entry] = compiled.only(weighted, places)
        return own

    def rest(self, places: list[int]) -> list[Weighted]:
        """The torque at zero acceleration, of the columns at `places`."""
        return [self.model.compiled.only(weighted, places) for weighted in self.model.compiled.rest]

    def gravity(self, places: list[int]) -> list[Weighted]:
        """The load at rest: products without a velocity."""
        at_rest: list[Weighted] = []
        for weighted in self.rest(places):
            still = {product: pairs for product, pairs in weighted.items() if not _moves(product)}
            at_rest.append(still)
        return at_rest


def _moves(product: Product) -> bool:
    """Whether a product has a velocity in it."""
    slopes: list[str] = []
    for atom in product:
        slopes += atom.slopes()
    return any("omega" in name for name in slopes)


def _written(arm: Description, form: str, by_term: Mapping[str, str], parts: dict[str, str]) -> str:
    """A language's form with the constants, and with what its parts are for the model's terms."""
    model = arm.coefficients.model
    own, loads = _Expressions(model), list(model.compiled.loads)
    M, X = own.inertia(loads), own.inertia(own.others)
    n, r, g = own.rest(loads), own.rest(own.others), own.gravity(loads)
    define = by_term["definition"]
    parts = parts | {
        "DEFINE_GRAVITY": _definitions(g, define),
        "DEFINE_INERTIA": _definitions(list(M.values()) + list(X.values()), define),
        "DEFINE_LOAD": _definitions(list(M.values()), define),
        "DEFINE_REST": _definitions(n, define),
        "DEFINE_FRICTION": _definitions(r, define),
    }
    for joint in range(2):
        number = joint + 1
        parts[f"GRAVITY{number}"] = _source(model, g[joint]) or "0.0"
        parts[f"N{number}"] = _source(model, n[joint]) or "0.0"
        parts[f"R{number}"] = _source(model, r[joint]) or "0.0"
        gain = ungain = extra = ""
        for name in _of_joint(model, "gains", joint):
            gain += f"(1 + {name}) * "
            ungain += f" / (1 + {name})"
        for other in range(2):
            parts[f"M{number}{other + 1}"] = _source(model, M[joint, other]) or "0.0"
            parts[f"X{number}{other + 1}"] = ""
            text = _source(model, X[joint, other])
            if text:
                parts[f"X{number}{other + 1}"] = f" + {text}"
                extra += f" + ({text}) * alpha[{other}]"
        sign = by_term["sign"].format(joint)
        shares = [f"{name} * {sign}" for name in _of_joint(model, "by_load", joint)]
        parts |= {
            f"GAIN{number}": gain,
            f"UNGAIN{number}": ungain,
            f"EXTRA{number}": extra,
            f"SHARE{number}": " + ".join(shares) or "0.0",
        }
    load, solved = "", by_term["solved"]
    if attributes(model, "by_load"):
        load, solved = by_term["load"], by_term["solved with load"]
    parts["LOAD"] = Template(load).substitute(parts)
    parts["SOLVED"] = Template(solved).substitute(parts)
    return Template(form).substitute(parts)


def _of_joint(model: Model, attribute: str, joint: int) -> list[str]:
    """Constants of the module that act on a joint in the way of `attribute`."""
    return [name.upper() for name, one in attributes(model, attribute) if one == joint]


_C = """/*
$TEXT
 */

/* Angles in rad, velocities in rad/s, accelerations in rad/s^2, torques in N m, inertias in
 * kg m^2. In other files:
 * #define ARM_DECLARATIONS_ONLY, then #include this one. */
#ifndef ALGID_ARM_DECLARED
#define ALGID_ARM_DECLARED
void gravity(const double theta[2], double tau[2]);
void inertia(const double theta[2], double matrix[2][2]);
void inverse_dynamics(const double theta[2], const double omega[2], const double alpha[2],
                      double tau[2]);
void forward_dynamics(const double theta[2], const double omega[2], const double tau[2],
                      double alpha[2]);
#endif

#ifndef ARM_DECLARATIONS_ONLY
#include <math.h>

$CONSTANTS
void gravity(const double theta[2], double tau[2])
{
    (void)theta;
$DEFINE_GRAVITY    tau[0] = $GRAVITY1;
    tau[1] = $GRAVITY2;
}

void inertia(const double theta[2], double matrix[2][2])
{
    (void)theta;
$DEFINE_INERTIA    matrix[0][0] = $M11$X11;
    matrix[0][1] = $M12$X12;
    matrix[1][0] = $M21$X21;
    matrix[1][1] = $M22$X22;
}

/* Coriolis, centrifugal and weight's torques. */
static void rest(const double theta[2], const double omega[2], double n[2])
{
$DEFINE_REST    n[0] = $N1;
    n[1] = $N2;
}

/* Torques of the joints' friction and offsets. */
static void friction(const double theta[2], const double omega[2], double r[2])
{
    (void)theta;
    (void)omega;
$DEFINE_FRICTION    r[0] = $R1;
    r[1] = $R2;
}

void inverse_dynamics(const double theta[2], const double omega[2], const double alpha[2],
                      double tau[2])
{
$DEFINE_LOAD    double n[2], r[2], load1, load2;
    rest(theta, omega, n);
    friction(theta, omega, r);
    load1 = ($M11) * alpha[0] + ($M12) * alpha[1] + n[0];
    load2 = ($M21) * alpha[0] + ($M22) * alpha[1] + n[1];
$LOAD    tau[0] = ${GAIN1}(load1 + r[0]$EXTRA1);
    tau[1] = ${GAIN2}(load2 + r[1]$EXTRA2);
}

void forward_dynamics(const double theta[2], const double omega[2], const double tau[2],
                      double alpha[2])
{
$DEFINE_INERTIA    const double m11 = $M11, m12 = $M12, m21 = $M21, m22 = $M22;
    double n[2], r[2], left1, left2;
    rest(theta, omega, n);
    friction(theta, omega, r);
    left1 = tau[0]$UNGAIN1 - r[0];
    left2 = tau[1]$UNGAIN2 - r[1];
$SOLVED}

#endif
"""
_C_BY_TERM = {
    "definition": "    const double {};\n",
    "sign": "tanh(omega[{}] / COULOMB_SPEED)",
    "load": """    load1 += ($SHARE1) * fabs(load1);
    load2 += ($SHARE2) * fabs(load2);
""",
    "solved": """\
    const double a = m11$X11, b = m12$X12, c = m21$X21, d = m22$X22, det = a * d - b * c;
    const double b1 = left1 - n[0], b2 = left2 - n[1];
    alpha[0] = (d * b1 - b * b2) / det;
    alpha[1] = (a * b2 - c * b1) / det;
""",
    "solved with load": """\
    const double e1 = $SHARE1, e2 = $SHARE2;
    int up1 = left1 > 0, up2 = left2 > 0;
    /* friction grows with the load, whose signs must turn out as assumed */
    for (int trial = 0; trial < 4; trial++) {
        const double d1 = 1 + (up1 ? e1 : -e1), d2 = 1 + (up2 ? e2 : -e2);
        const double a = d1 * m11$X11, b = d1 * m12$X12, c = d2 * m21$X21, d = d2 * m22$X22;
        const double b1 = left1 - d1 * n[0], b2 = left2 - d2 * n[1], det = a * d - b * c;
        alpha[0] = (d * b1 - b * b2) / det;
        alpha[1] = (a * b2 - c * b1) / det;
        const int new1 = m11 * alpha[0] + m12 * alpha[1] + n[0] > 0;
        const int new2 = m21 * alpha[0] + m22 * alpha[1] + n[1] > 0;
        if (new1 == up1 && new2 == up2)
            break;
        up1 = new1;
        up2 = new2;
    }
""",
}
_PYTHON = '''$CONSTANTS

def gravity(theta):
    """Torques in N m that hold the arm's weight at the angles theta in rad."""
$DEFINE_GRAVITY    return $GRAVITY1, $GRAVITY2


def inertia(theta):
    """Inertia matrix in kg m^2 at the angles theta in rad, as two rows."""
$DEFINE_INERTIA    return ($M11$X11, $M12$X12), ($M21$X21, $M22$X22)


def _rest(theta, omega):
    """Coriolis, centrifugal and weight's torques."""
$DEFINE_REST    return $N1, $N2


def _friction(theta, omega):
    """Torques of the joints' friction and offsets."""
$DEFINE_FRICTION    return $R1, $R2


def inverse_dynamics(theta, omega, alpha):
    """Torques in N m for accelerations alpha in rad/s^2 at theta in rad and omega in rad/s."""
$DEFINE_LOAD    n1, n2 = _rest(theta, omega)
    r1, r2 = _friction(theta, omega)
    load1 = ($M11) * alpha[0] + ($M12) * alpha[1] + n1
    load2 = ($M21) * alpha[0] + ($M22) * alpha[1] + n2
$LOAD    return ${GAIN1}(load1 + r1$EXTRA1), ${GAIN2}(load2 + r2$EXTRA2)


def forward_dynamics(theta, omega, tau):
    """Accelerations in rad/s^2 under the torques tau in N m at theta in rad and omega in rad/s."""
$DEFINE_INERTIA    n1, n2 = _rest(theta, omega)
    r1, r2 = _friction(theta, omega)
    left1, left2 = tau[0]$UNGAIN1 - r1, tau[1]$UNGAIN2 - r2
    m11, m12, m21, m22 = $M11, $M12, $M21, $M22
$SOLVED'''
_PYTHON_BY_TERM = {
    "definition": "    {}\n",
    "sign": "tanh(omega[{}] / COULOMB_SPEED)",
    "load": """    load1 += ($SHARE1) * abs(load1)
    load2 += ($SHARE2) * abs(load2)
""",
    "solved": """    a, b, c, d = m11$X11, m12$X12, m21$X21, m22$X22
    b1, b2, det = left1 - n1, left2 - n2, a * d - b * c
    return (d * b1 - b * b2) / det, (a * b2 - c * b1) / det
""",
    "solved with load": """\
    e1, e2 = $SHARE1, $SHARE2
    up1, up2 = left1 > 0, left2 > 0
    for _ in range(4):  # friction grows with the load, whose signs must turn out as assumed
        d1, d2 = 1 + (e1 if up1 else -e1), 1 + (e2 if up2 else -e2)
        a, b, c, d = d1 * m11$X11, d1 * m12$X12, d2 * m21$X21, d2 * m22$X22
        b1, b2 = left1 - d1 * n1, left2 - d2 * n2
        det = a * d - b * c
        alpha1, alpha2 = (d * b1 - b * b2) / det, (a * b2 - c * b1) / det
        new1, new2 = m11 * alpha1 + m12 * alpha2 + n1 > 0, m21 * alpha1 + m22 * alpha2 + n2 > 0
        if (new1, new2) == (up1, up2):
            break
        up1, up2 = new1, new2
    return alpha1, alpha2
""",
}
