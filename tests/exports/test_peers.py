"""Exported models in the hands of others: MuJoCo, Pinocchio, a C compiler and Python."""

from __future__ import annotations

import ctypes
import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from algid.arm import Arm, FloatArray, inverse_dynamics
from algid.exports.description import describe
from algid.exports.formats import exported
from algid.model import Model, Motion, acceleration, torque
from tests.estimators.test_model import FULL, VALUES
from tests.exports.arms import ODD, UNIFORM, result_of, states, values_of

CLOSE = (
    1e-9  # of the largest torque: some hundred roundings of 2e-16 and of the numbers' decimal form
)
THETA, OMEGA, ALPHA = states()
ROTOR = values_of(ODD, j2=0.004)


def text_of(to: str, value: dict[str, float], model: Model | None = None, **known: float) -> str:
    """What algid exports of an arm with these coefficients."""
    return exported(result_of(value, model), "arm.algid", to, known)[0]


def wanted(value: dict[str, float], model: Model, omega: FloatArray | None = None) -> FloatArray:
    """Torques (2, N) of algid's model at the random states, or at other velocities."""
    c = np.array([value[name] for name in model.names])
    return torque(model, c, Motion(THETA, OMEGA if omega is None else omega, ALPHA))


def assert_close(found: FloatArray, expected: FloatArray, tolerance: float) -> None:
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * np.abs(expected).max())


KNOWN: list[dict[str, float]] = [
    {},
    {"l2": 0.35},
    {"m1": 2.5},
    {"m2": 0.9, "l2": 0.2},
    {"m1": 2.0, "m2": 0.7, "rotor1": 0.01},
    {"rotor1": 0.02},
]


def by_mujoco(text: str) -> FloatArray:
    """Torques (2, N) that MuJoCo wants at the random states."""
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    found = []
    for data.qpos[:], data.qvel[:], data.qacc[:] in zip(THETA.T, OMEGA.T, ALPHA.T, strict=True):
        mujoco.mj_inverse(model, data)
        found.append(data.qfrc_inverse.copy())
    return np.array(found).T


def by_pinocchio(text: str) -> FloatArray:
    """Torques (2, N) that Pinocchio wants at the random states: its inverse dynamics, and the
    damping that it read.
    """
    pin = pytest.importorskip("pinocchio")
    model = pin.buildModelFromXML(text)
    data = model.createData()
    damping, model.damping = np.array(model.damping), np.zeros(2)
    found = []
    for theta, omega, alpha in zip(THETA.T, OMEGA.T, ALPHA.T, strict=True):
        q = np.stack([np.cos(theta), np.sin(theta)], axis=1).ravel()  # joints without limits
        found.append(pin.rnea(model, data, q, omega, alpha) + damping * omega)
    return np.array(found).T


BENT = Model(("phases",))
PLACES = (("k1", 0), ("k2", 1), ("k4", 3))


def bent(turn: float = 0.0, **more: float) -> dict[str, float]:
    """Coefficients of `ODD` with centres 10° and -25° off the lines, θ1's zero off by `turn`.

    Zeros turn K1 by θ2's, K2 and K4 by θ1's too.
    """
    arm = Arm(**{**vars(ODD), "delta1": np.radians(10), "delta2": np.radians(-25)})
    k = arm.phasors()
    moments = {name: complex(k[place], k[7 + sine]) for sine, (name, place) in enumerate(PLACES)}
    moments["k2"] *= np.exp(1j * turn)
    moments["k4"] *= np.exp(1j * turn)
    value = values_of(ODD) | {name: K.real for name, K in moments.items()}
    return value | {f"{name}s": K.imag for name, K in moments.items()} | more


ARMS = {
    "uniform": values_of(UNIFORM),
    "odd": values_of(ODD),
    **{f"bent, {turn} rad": bent(turn) for turn in (0.0, 0.2, -0.6)},
}


@pytest.mark.parametrize("known", KNOWN, ids=str)
@pytest.mark.parametrize("arm", ARMS)
def test_simulators_want_algids_torque(arm: str, known: dict[str, float]) -> None:
    """MuJoCo, which has rotors, and Pinocchio, whatever the zero of θ1 against gravity."""
    value = ARMS[arm] | {"j2": 0.004}
    terms = BENT.terms if "k1s" in value else ()
    for to, by, rotor in (("mjcf", by_mujoco, ("rotor",)), ("urdf", by_pinocchio, ())):
        model = Model((*terms, *rotor))
        assert_close(by(text_of(to, value, model, **known)), wanted(value, model), CLOSE)


def test_bent_links_in_a_plane_and_of_a_length_that_is_given() -> None:
    model = Model(("phases",), gravity=0.0)
    value = bent() | {"k2": 0.0, "k2s": 0.0, "k4": 0.0, "k4s": 0.0}
    assert_close(by_mujoco(text_of("mjcf", value, model, l1=0.4)), wanted(value, model), CLOSE)
    assert_close(by_pinocchio(text_of("urdf", value, model, l1=0.4)), wanted(value, model), CLOSE)
    value = bent(0.1)
    found = describe(result_of(value, BENT), "arm", {"l1": 0.41}, links=False)
    K1, K2 = (complex(found.value[name], found.value[f"{name}s"]) for name in ("k1", "k2"))
    assert 9.81 * abs(K1) == pytest.approx(0.41 * abs(K2), rel=1e-14)
    text = text_of("mjcf", value, BENT, l1=0.41)
    assert_close(by_mujoco(text), wanted(dict(found.value), BENT), CLOSE)


SETS = [
    Model(),
    Model(("coulomb",)),
    Model(("coulomb", "stribeck", "asymmetry", "rotor")),
    Model(("offset", "gain", "phases")),
    Model(("load",), coulomb_speed=0.5),
    FULL,
    Model(("coulomb", "load", "rotor", "gain"), gravity=0.0),
]


@pytest.mark.parametrize("model", SETS, ids=lambda model: "+".join(model.terms) or "plain")
@pytest.mark.parametrize("to", ["python", "c"])
def test_modules_of_both_languages_are_algids(to: str, model: Model, tmp_path: Path) -> None:
    text = text_of(to, VALUES, model)
    arm = compiled(text, tmp_path) if to == "c" else imported(text)
    c = np.array([VALUES[name] for name in model.names])
    tau = torque(model, c, Motion(THETA, OMEGA, ALPHA))
    assert_close(each(arm.inverse_dynamics, THETA, OMEGA, ALPHA), tau, 1e-12)
    left = acceleration(model, c, THETA, OMEGA, tau)
    # condition of M: some hundred
    np.testing.assert_allclose(left, ALPHA, rtol=0, atol=1e-10 * np.abs(ALPHA).max())
    np.testing.assert_allclose(
        each(arm.forward_dynamics, THETA, OMEGA, tau), left, rtol=0, atol=1e-10 * 60
    )
    assert ("lacks first-order low-pass" in text) == ("lag" in model.terms)


@pytest.mark.parametrize("to", ["python", "c"])
def test_gravity_and_inertia_of_both_languages(to: str, tmp_path: Path) -> None:
    model = Model(("rotor",))
    text = text_of(to, ROTOR, model)
    arm = compiled(text, tmp_path) if to == "c" else imported(text)
    still = np.zeros_like(THETA)
    held = inverse_dynamics(ODD.constants(), THETA, still, still)
    assert_close(each(arm.gravity, THETA), held, 1e-12)
    matrix = np.array([arm.inertia(theta) for theta in THETA.T.tolist()])
    pushed = np.einsum("nji,in->jn", matrix, ALPHA)
    assert_close(pushed + held, wanted(ROTOR, model, still), 1e-12)


def each(function: Any, *arguments: FloatArray) -> FloatArray:
    """A function of pairs at every state: (2, N)."""
    return np.array(
        [
            function(*pairs)
            for pairs in zip(*(argument.T.tolist() for argument in arguments), strict=True)
        ]
    ).T


def imported(text: str) -> SimpleNamespace:
    """The Python module of that text."""
    content: dict[str, Any] = {}
    exec(compile(text, "arm.py", "exec"), content)
    return SimpleNamespace(**content)


def compiled(text: str, folder: Path) -> SimpleNamespace:
    """The functions of a C file, built strictly and called by ctypes.

    It stands beside a file that declares them.
    """
    (folder / "arm.c").write_text(text)
    (folder / "user.c").write_text(
        '#define ARM_DECLARATIONS_ONLY\n#include "arm.c"\nvoid (*used)() = gravity;\n'.replace(
            "()", "(const double[2], double[2])"
        )
    )
    flags = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-O2", "-ffp-contract=off"]
    subprocess.run(
        ["cc", *flags, "-shared", "-fPIC", "-o", "arm.so", "arm.c", "user.c", "-lm"],
        cwd=folder,
        check=True,
    )
    library = ctypes.CDLL(str(folder / "arm.so"))
    pair = ctypes.c_double * 2

    def function(name: str, result: Any) -> Any:
        def called(*pairs: list[float]) -> list[Any]:
            found = result()
            getattr(library, name)(*(pair(*one) for one in pairs), found)
            return [list(row) if isinstance(row, ctypes.Array) else row for row in found]

        return called

    names = ("gravity", "inverse_dynamics", "forward_dynamics")
    return SimpleNamespace(
        **{name: function(name, pair) for name in names}, inertia=function("inertia", pair * 2)
    )


def test_sdf_tells_the_same_links() -> None:
    value = values_of(ODD, f1=0.4, f2=0.3)
    root = ET.fromstring(text_of("sdf", value, Model(("coulomb",)), l2=0.3))

    def number(path: str) -> float:
        found = root.findtext(path)
        assert found is not None, path
        return float(found.split()[0])

    link = "model/link[@name='link{}']/".format
    arm = Arm(
        m1=number(link(1) + "inertial/mass"),
        m2=number(link(2) + "inertial/mass"),
        lc1=number(link(1) + "inertial/pose"),
        lc2=number(link(2) + "inertial/pose"),
        l1=number(link(2) + "pose"),
        l2=number("model/frame/pose"),
        I1=number(link(1) + "inertial/inertia/iyy"),
        I2=number(link(2) + "inertial/inertia/iyy"),
        b1=number("model/joint[@name='joint1']/axis/dynamics/damping"),
        b2=number("model/joint[@name='joint2']/axis/dynamics/damping"),
    )
    np.testing.assert_allclose(arm.constants(), ODD.constants(), rtol=1e-12)
    assert number("model/joint[@name='joint2']/axis/dynamics/friction") == 0.3
    assert root.findtext("model/joint[@name='joint1']/axis/xyz") == "0 -1 0"
