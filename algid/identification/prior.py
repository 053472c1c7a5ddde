"""What CAD, read from URDF, or an earlier result says of k1 … k5: a prior beside evidence of logs.

Masses m, centres of mass l_c, inertias I and link 1's length of a drawing are wrong by independent
shares. With D the derivatives of the constants by them and σ their errors, by Table 1,

    k1 = m2 l1 lc2   k2 = g m2 lc2   k3 = I2 + m2 lc2²
    k4 = g (m1 lc1 + m2 l1)          k5 = I1 + m1 lc1² + m2 l1²
    P = D diag(σ²) Dᵀ,   σ_m = e m,   σ_I = e I,   σ_lc = e max(|lc|, √(I / m)),   σ_l1 = 0.01 l1

A balanced link's centre may be off as well, by as large a share of its radius of gyration.

**A drawing** is a URDF file. Two joints about one direction move; what is fixed to a link counts to
it. θ1 is the angle of the line from joint 1 to joint 2 over the horizontal, θ2 that of link 2's
line: to the tip, which is the last frame fixed to it, or, without one, to its centre of mass.

**Logs and prior.** With W the covariance of the logs' estimates c of these constants and B a basis
of the combinations that they determine, their information is J, and both together say

    J = B (Bᵀ W B)⁻¹ Bᵀ,   V = (J + P⁻¹)⁻¹,   k = m + V J (c − m)

Other parameters follow by their covariance with c. A constant is from the prior where the logs
leave it open or doubtful, or where V is more than half of P: the logs tell less of it than the
prior does. The logs are expected to move k from m by P − V, and contradict the prior beyond that.

======  =====================================  =======
symbol  name                                   shape
======  =====================================  =======
m, P    the prior's mean, its covariance       (n, n)
e       relative error of a drawing            scalar
c, W    the logs' estimates, their covariance  (n, n)
k, V    what both say, its covariance          (n, n)
======  =====================================  =======
"""

from __future__ import annotations

import cmath
import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from algid.arm import CONSTANT_NAMES, Arm, FloatArray
from algid.base.criteria import SAME_LENGTH, STILL
from algid.base.errors import ResultError, SettingError
from algid.base.files import read_text
from algid.base.names import outside, places_outside, vector, within
from algid.base.significance import LEVEL, chance
from algid.base.text import counted
from algid.estimators.combine import likelihood, scaled_pinv
from algid.estimators.fit import Fit
from algid.estimators.identifiability import SHARE, open_directions
from algid.identification.known import covariance_of, values_of, with_error_bar
from algid.identification.recordings import Role
from algid.identification.series import Predictor
from algid.model import F1, F2, RIGID, SINES, UNITS, Model
from algid.notices import Notice
from algid.options import flag
from algid.physics.effort import absent
from algid.profile import Profile
from algid.results import read_result
from algid.settings import Settings

ERROR = 20.0
"""Per cent by which a drawing is wrong where nothing else is said."""
_HALF = 0.5  # of the prior's variance: what is wider is more the prior's than the logs'
_UNMOVED = 1e-3  # of the prior's standard deviation: a smaller expected move contradicts nothing


@dataclass(frozen=True, eq=False)
class Statement:
    """What a file says of constants: its name, theirs, their mean (n,) and covariance (n, n)."""

    file: str
    names: tuple[str, ...]
    mean: FloatArray
    covariance: FloatArray


def statement_of(settings: Settings) -> Statement | None:
    """What the settings' prior says of k1 … k5; None without one.

    Raises
    ------
    ResultError
        If its file is neither a URDF of such an arm nor a result with error bars.
    SettingError
        If an error is given for a result, which has its own.
    """
    if settings.prior is None:
        return None
    file, error = settings.prior, settings.prior_error
    if Path(file).suffix.lower() == ".urdf":
        arm = replace(arm_of(Path(file))[0], g=settings.gravity)
        covariance = drawn_covariance(arm, (ERROR if error is None else error) / 100)
        return Statement(file, RIGID, arm.constants()[: len(RIGID)], covariance)
    if error is not None:
        raise SettingError(
            f"{flag('prior_error')}: {file} is a result, which has error bars; leave it out"
        )
    try:
        result = read_result(file)
    except ResultError as wrong:
        raise ResultError(f"{flag('prior')}: no URDF by its name, and {wrong}") from wrong
    names = with_error_bar(result, RIGID)
    if not names:
        raise ResultError(f"{file}: the result has no error bars of k1 … k5; give another one")
    mean = vector(names, values_of(result))
    return Statement(file, names, mean, covariance_of(result, names, names))


def drawn_covariance(arm: Arm, error: float) -> FloatArray:
    """Covariance P (5, 5) of k1 … k5 of a drawn arm, of which masses and more err by that share."""
    moves = []
    I1, I2 = max(arm.I1, 0.0), max(arm.I2, 0.0)  # a file may round them below nothing
    gyration = {"lc1": math.sqrt(I1 / arm.m1), "lc2": math.sqrt(I2 / arm.m2)}
    for name in ("m1", "m2", "lc1", "lc2", "I1", "I2", "l1"):
        value = getattr(arm, name)
        share = SAME_LENGTH if name == "l1" else error
        step = share * max(abs(value), gyration.get(name, 0.0))
        # the constants are polynomials of second order in each: central differences are exact
        more, less = (replace(arm, **{name: value + sign * step}) for sign in (1, -1))
        moves.append((more.constants() - less.constants())[: len(RIGID)] / 2)
    D = np.transpose(moves)
    return np.asarray(D @ D.T)


def with_prior(fit: Fit, said: Statement) -> Fit:
    """The fit with what a file says of k1 … k5, and the status FROM_PRIOR for what is its more.

    Where the logs contradict it by more than chance, the fit as it is, with a notice of that.

    Parameters
    ----------
    fit : Fit
        Of logs alone, with its doubts.
    said : Statement
    """
    names = within(said.names, outside(fit.names, fit.absent))
    if not fit.converged or not names:
        return fit
    kept = list(map(said.names.index, names))
    P, m = said.covariance[np.ix_(kept, kept)], said.mean[kept]
    places = list(map(fit.names.index, names))
    W, own = fit.covariance, np.ix_(places, places)
    # an arm at rest tells its weight: what noise makes of accelerations is no inertia
    weight = absent("gravity-compensated", RIGID) if (fit.moved < STILL).all() else RIGID
    doubtful = [fit.status[p] != "OK" or fit.names[p] not in weight for p in places]
    B = _determined(fit, places, doubtful)
    J = B @ scaled_pinv(B.T @ W[own] @ B) @ B.T
    V = scaled_pinv(J + scaled_pinv(P))
    k = m + V @ J @ (fit.values[places] - m)
    # P − V, how far logs are expected to move the constants
    expected = np.sqrt(np.maximum(np.diag(P - V), 0.0))
    std = np.sqrt(np.diag(P))
    known = expected > _UNMOVED * std
    distance = np.abs(k - m) / np.where(known, expected, np.inf)
    most = int(np.argmax(distance))
    if chance(float(distance[most]), len(places)) < LEVEL:
        numbers = {
            "case": "prior",
            "name": names[most],
            "file": said.file,
            "given": float(m[most]),
            "std": float(std[most]),
            "unit": UNITS[names[most]],
            "estimate": float(k[most]),
            "distance": float(distance[most]),
        }
        return fit.noted(Notice("OTHER_ARM", numbers=numbers))
    # A: how all parameters follow these; rest: the covariance that these leave the others
    A = W[:, places] @ J
    rest = W - A @ W[own] @ A.T
    rest[places] = rest[:, places] = 0.0
    A[places] = np.eye(len(places))
    values = fit.values + A @ (k - fit.values[places])
    status = list(fit.status)
    for place, vague, now, before in zip(places, doubtful, np.diag(V), np.diag(P), strict=True):
        if vague or now > _HALF * before:
            status[place] = "FROM_PRIOR"
    return replace(fit, values=values, covariance=rest + A @ V @ A.T, status=tuple(status))


def _determined(fit: Fit, places: list[int], doubtful: list[bool]) -> FloatArray:
    """Basis B (n, r) of the combinations of the parameters at n `places` that logs determine.

    They hold nothing of those that are `doubtful`.
    """
    information = likelihood(fit.shared, fit.logs, fit.values, fit.prior)[2]
    bounded = fit.absent + fit.shrunk
    null, size = open_directions(fit.names, fit.values, information, bounded)
    own = list(map(places_outside(fit.names, bounded).index, places))
    lost, share, _ = np.linalg.svd(np.hstack([null[own], np.diag(np.array(doubtful, float))]))
    return lost[:, np.count_nonzero(share > SHARE) :] / size[own][:, None]


GRAVITY = 9.81
_PARALLEL = 1e-3  # sine of the angle between axes that count as one direction
_ROUNDING = 1e-12  # m: a link this long has no length
_ASTRAY = "there is no link {}, or none that it hangs on, or two"
_BESIDE = 1e-9  # rad: a centre of mass less off its link's line is on it


def arm_of(path: Path) -> tuple[Arm, tuple[float, ...]]:
    """The arm of a URDF file, and its joints' Coulomb friction in N m.

    Raises
    ------
    ResultError
        If it is no URDF of an arm with two joints about one direction.
    """
    try:
        return _arm(ET.fromstring(read_text(path)))
    except OSError as error:
        raise ResultError(
            f"{path}: cannot read it ({error.strerror}); expected a URDF file"
        ) from error
    except (ET.ParseError, UnicodeDecodeError) as error:
        raise ResultError(f"{path}: not XML ({error}); expected a URDF file") from error
    except ValueError as error:
        raise ResultError(
            f"{path}: expected a URDF of an arm with two parallel joints: {error}; mend the file"
        ) from error


def read_urdf(path: Path, profile: Profile | None = None) -> Predictor:
    """The model of a URDF file for logs of the arm without payload; raises as `arm_of`.

    A profile says under what gravity they were, and what of the torque they hold.
    """
    profile = profile or Profile()
    arm, friction = arm_of(path)
    arm = replace(arm, g=arm.g * profile.gravity / GRAVITY)  # g is of the share in its plane
    bent = max(abs(arm.delta1), abs(arm.delta2)) > _BESIDE
    terms = ("coulomb",) * any(friction) + ("phases",) * bent
    model = Model(terms, gravity=arm.g)
    numbers = [*arm.phasors(), *friction]
    value = dict(zip((*CONSTANT_NAMES, *SINES, F1, F2), numbers, strict=True))
    c = vector(model.names, value | dict.fromkeys(absent(profile.effort, model.names), 0.0))

    def coefficients(role: Role) -> FloatArray:
        if role == "loaded":
            raise ResultError(
                f"{path}: a URDF file tells no payload; judge it on logs of the arm without one"
            )
        return c

    return Predictor(model, coefficients)


def _arm(robot: ET.Element) -> tuple[Arm, tuple[float, ...]]:
    """The arm, and its joints' Coulomb friction in N m.

    Raises
    ------
    ValueError
        If the robot is no such arm.
    """
    links = {_text(link, "", "name"): link for link in robot.findall("link")}
    joints: dict[str, ET.Element] = {}  # by the link that hangs on it
    parent: dict[str, str] = {}
    for one in robot.findall("joint"):
        child, parent_of = _text(one, "child", "link"), _text(one, "parent", "link")
        for name in (child, parent_of):
            if name not in links or child in joints:
                raise ValueError(_ASTRAY.format(name))
        joints[child], parent[child] = one, parent_of
    kind = {name: _text(one, "", "type") for name, one in joints.items()}
    names = [name for name, word in kind.items() if word != "fixed"]
    if len(names) != 2 or not {"fixed", "revolute", "continuous"}.issuperset(kind.values()):
        raise ValueError(f"found {counted(len(names), 'moving joint')}, or not all of them turn")
    # a link's frame in the base's where both angles are 0, and how many of the moving joints it is
    # behind
    frames, behind = dict[str, FloatArray](), dict[str, int]()
    for link in sorted(links):
        path = [link]
        frame: FloatArray = np.eye(4)
        while path[-1] in parent:
            frame = _origin(joints[path[-1]], "origin") @ frame
            path.append(parent[path[-1]])
            if len(path) > len(links):
                raise ValueError(_ASTRAY.format(link))
        frames[link], behind[link] = frame, len(within(names, path))
    names.sort(key=behind.__getitem__)
    if [behind[name] for name in names] != [1, 2]:
        raise ValueError("the joints do not follow one another")
    axes = []
    for name in names:
        direction = np.array(_numbers(joints[name], "axis", "xyz", "1 0 0", 3))
        size = np.linalg.norm(direction)
        if size == 0:
            raise ValueError("a joint's axis has no direction")
        axes.append(frames[name][:3, :3] @ direction / size)
    about = axes[0]
    # the plane of motion, counterclockwise about the axis, as complex numbers
    across = np.linalg.svd(about[None])[2][1]
    plane = across + 1j * np.cross(about, across)
    if np.linalg.norm(np.cross(*axes)) > _PARALLEL:
        raise ValueError("the joints' axes are not parallel")
    last, tip = {parent[name]: name for name in joints}, names[1]
    while tip in last:
        tip = last[tip]
    places = [frames[name][:3, 3] for name in (*names, tip)]
    numbers: dict[str, float] = {}
    for number, (name, joint) in enumerate(zip(names, places[:2], strict=True), start=1):
        mass, moment, inertia = 0.0, 0j, 0.0  # about the joint's axis
        for link, frame in frames.items():
            if behind[link] == number and links[link].find("inertial") is not None:
                own, second, m = _inertial(links[link])
                body = frame @ own
                axis, r = body[:3, :3].T @ about, complex((body[:3, 3] - joint) @ plane)
                inertia += float(axis @ second @ axis) + m * abs(r) ** 2
                mass, moment = mass + m, moment + m * r
        if mass <= 0:
            raise ValueError(f"link {name} has no mass")
        to_next = places[number] - joint
        line = complex(to_next @ plane)
        if number == 2 and not to_next.any():  # no frame is the tip: the centre of mass
            line = moment / mass
        length = abs(line)
        if length <= _ROUNDING:
            raise ValueError(f"link {name} has no length across its axis")
        centre = moment / mass * line.conjugate() / length
        # a centre behind the joint has a negative distance
        far = math.copysign(abs(centre), centre.real)
        numbers |= {
            f"m{number}": mass,
            f"l{number}": length,
            f"lc{number}": far,
            f"I{number}": inertia - mass * far**2,
            f"delta{number}": cmath.phase(centre * math.copysign(1.0, far)),
            f"b{number}": _numbers(joints[name], "dynamics", "damping", "0")[0],
        }
    tilt = math.hypot(*about[:2])
    friction = [_numbers(joints[name], "dynamics", "friction", "0")[0] for name in names]
    return Arm(**numbers, g=GRAVITY * tilt if tilt > _PARALLEL else 0.0), tuple(friction)


def _text(element: ET.Element, path: str, name: str, default: str | None = None) -> str:
    """An attribute of the part at `path`; raises `ValueError` where there is none."""
    part = element.find(path) if path else element
    text = default if part is None else part.get(name, default)
    if text is None:
        raise ValueError(f"<{element.tag}> {path} has no {name}")
    return text


def _numbers(
    element: ET.Element, path: str, name: str, default: str | None = None, count: int = 1
) -> list[float]:
    """An attribute's finite numbers; raises `ValueError` where there are no or other ones."""
    text = _text(element, path, name, default)
    numbers = list(map(float, text.split()))
    if len(numbers) != count or not np.isfinite(numbers).all():
        raise ValueError(f"expected {counted(count, 'finite number')}, found {text!r:.60}")
    return numbers


def _inertial(link: ET.Element) -> tuple[FloatArray, FloatArray, float]:
    """The frame (4, 4) of a link's centre of mass, the inertia (3, 3) about it, and its mass."""
    rows = (("ixx", "ixy", "ixz"), ("ixy", "iyy", "iyz"), ("ixz", "iyz", "izz"))
    inertia = [[_numbers(link, "inertial/inertia", name)[0] for name in row] for row in rows]
    (mass,) = _numbers(link, "inertial/mass", "value")
    return _origin(link, "inertial/origin"), np.array(inertia), mass


def _origin(element: ET.Element, path: str) -> FloatArray:
    """The origin (4, 4) at `path`: roll, pitch, yaw about fixed axes, and its place."""
    from scipy.spatial.transform import Rotation

    frame = np.eye(4)
    turned = Rotation.from_euler("xyz", _numbers(element, path, "rpy", "0 0 0", 3))
    frame[:3, :3] = turned.as_matrix()
    frame[:3, 3] = _numbers(element, path, "xyz", "0 0 0", 3)
    return frame
