"""What is chosen where the constants leave masses free, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from algid.arm import Arm
from algid.base.errors import AlgidError, SettingError
from algid.base.significance import NORMAL
from algid.exports.description import describe
from algid.exports.formats import exported
from algid.exports.links import Link, links_of
from algid.model import Model
from algid.results import Result
from tests.exports.arms import ODD, UNIFORM, result_of, values_of

POSITIVE = st.floats(0.05, 20)


def constants_of(links: tuple[Link, Link], rotor: float, arm: Arm) -> list[float]:
    """k1 … k7 of two links, by Table 1."""
    (first, second), inertia = links, links[0].inertia + rotor
    made = Arm(
        first.mass,
        second.mass,
        first.centre,
        second.centre,
        first.length,
        second.length,
        inertia,
        second.inertia,
        arm.b1,
        arm.b2,
        arm.g,
    )
    return list(made.constants())


@given(
    POSITIVE,
    POSITIVE,
    st.floats(-1, 2),
    st.floats(-1, 2),
    POSITIVE,
    POSITIVE,
    POSITIVE,
    st.booleans(),
)
def test_every_possible_arm_gets_possible_links(
    m1: float, m2: float, lc1: float, lc2: float, l1: float, I1: float, I2: float, long: bool
) -> None:
    assume(abs(lc2) > 0.01)
    arm = Arm(m1, m2, lc1, lc2, l1, 0.5, I1, I2, 0.1, 0.1)
    links = links_of(values_of(arm), 9.81, l1, {"l2": 0.5} if long else {}, "arm")
    for link in links:
        along, across, other = link.tensor
        assert min(link.mass, link.length, along) > 0
        assert across <= along + other
        assert along <= across + other
    k = arm.constants()
    np.testing.assert_allclose(constants_of(links, 0, arm), k, rtol=0, atol=1e-9 * np.abs(k).max())


def test_nearest_is_nearest() -> None:
    """The masses chosen have less divergence, by its definition from the matrices, than all others
    on a grid.
    """

    def divergence(link: Link) -> float:
        m, length = link.mass, link.length
        s, h = m * link.centre, link.inertia + m * link.centre**2
        P = np.array([[h, s], [s, m]])
        masses = np.geomspace(m / 30, 30 * m, 20001)
        U = np.array([[length**2 / 3, length / 2], [length / 2, 1]])
        ratio = np.linalg.solve(U, P)
        every = np.trace(ratio) / masses - np.log(np.linalg.det(ratio) / masses**2) - 2
        return float(every.min())

    k = values_of(ODD)
    chosen = sum(map(divergence, links_of(k, 9.81, ODD.l1, {"l2": 0.3}, "arm")))
    others = []
    for m2 in np.linspace(0.4, 0.9, 26):
        for m1 in np.linspace(0.8, 4, 33):
            try:
                pair = links_of(k, 9.81, ODD.l1, {"l2": 0.3, "m1": m1, "m2": m2}, "arm")
            except SettingError:
                continue
            others.append(sum(map(divergence, pair)))
    assert len(others) > 100
    assert chosen <= min(others) + 1e-6


@pytest.mark.parametrize("gravity", [0.0, 9.81])
@pytest.mark.parametrize("known", [{}, {"m1": UNIFORM.m1}, {"m2": UNIFORM.m2}], ids=str)
def test_uniform_links_are_found_again(known: dict[str, float], gravity: float) -> None:
    value = values_of(Arm(**{**vars(UNIFORM), "g": gravity}))
    links = links_of(value, gravity, UNIFORM.l1, known, "arm")
    found = [(link.mass, link.length, link.centre, link.inertia) for link in links]
    true = UNIFORM
    expected = [(true.m1, true.l1, true.lc1, true.I1), (true.m2, true.l2, true.lc2, true.I2)]
    np.testing.assert_allclose(found, expected, rtol=1e-5)  # the search's


def test_a_given_length_moves_the_constants_as_their_covariance_says() -> None:
    g, l1 = 0.9, 0.405  # of a plane that is nearly level
    arm = Arm(**{**vars(ODD), "g": g})
    result = result_of(values_of(arm), Model(gravity=g), std=1e-2)
    found = describe(result, "arm", {"l1": l1}, links=False)
    c = np.array(arm.constants()[:2])
    assert found.value["k1"] * g / found.value["k2"] == pytest.approx(l1, rel=1e-12)
    weights = 1 / (1e-2 * c)
    line = np.array([l1 / g, 1.0]) * weights  # k1 = l1 k2 / g, weighted least squares along it
    k2 = line @ (c * weights) / (line @ line)
    assert found.value["k2"] == pytest.approx(k2, rel=1e-12)
    assert found.half["k1"] == pytest.approx(found.half["k2"] * l1 / g, rel=1e-9)
    assert found.half["k2"] == pytest.approx(NORMAL / math.sqrt(line @ line), rel=1e-9)
    assert found.value["k3"] == arm.constants()[2]
    # without error bars both moments are equally wrong
    bare = describe(result.model_copy(update={"fit": None}), "arm", {"l1": l1}, links=False)
    assert bare.value["k1"] / c[0] + bare.value["k2"] / c[1] == pytest.approx(2, abs=1e-4)


ARM = result_of(values_of(ODD))


def of(**values: float) -> Result:
    """The arm's result with other constants."""
    return result_of(values_of(ODD) | values)


def sure_of_weights() -> Result:
    """The arm's result with a k1 that it knows badly, so that a given l1 moves k1 alone."""
    assert ARM.fit is not None
    covariance = [list(row) for row in ARM.fit.covariance]
    covariance[0][0] = 1.0
    return ARM.model_copy(update={"fit": ARM.fit.model_copy(update={"covariance": covariance})})


NEGATIVE = "a mass or an inertia comes out negative; of link 2's masses"
POINT = {"l1": 0.4, "l2": 0.3}


@pytest.mark.parametrize(
    ("to", "result", "known", "message"),
    [
        ("urdf", ARM, {"m2": 5.0}, f"arm: with --set m2=5.0 {NEGATIVE} 0."),
        ("urdf", ARM, {"m1": 0.01}, f"arm: with --set m1=0.01 {NEGATIVE} none is left"),
        ("urdf", ARM, {"rotor1": 1.0}, f"arm: with --set rotor1=1.0 {NEGATIVE} none is left"),
        ("python", ARM, {"m1": 1.0}, "--set m1: python holds no such number; leave it out"),
        ("payload", ARM, {"l1": 1.0}, "--l1: payload holds no such number; leave it out"),
        ("payload", ARM, {}, "arm: the result has no payload; identify with --loaded LOG"),
        (
            "payload",
            result_of(values_of(ODD), payload={"m_p": -0.2} | POINT),
            {},
            "payload of -0.2 kg; check which log is the loaded one$",
        ),
        (
            "urdf",
            of(k2=-0.1),
            {},
            r"k1 .*, k2 .* and g 9\.81 make l1 = g k1 / k2 no positive length; give --l1",
        ),
        ("mjcf", result_of(values_of(ODD), Model(gravity=0.0)), {}, "g 0 make l1 = .*; give --l1"),
        ("c", of(k1=3.0), {}, "not positive definite .* identify it from more informative logs"),
        ("urdf", sure_of_weights(), {"l1": 1.6}, "not positive definite .* negative; check --l1"),
    ],
)
def test_what_no_arm_explains_is_refused(
    to: str, result: Result, known: dict[str, float], message: str
) -> None:
    with pytest.raises(AlgidError, match=message):
        exported(result, "arm", to, known)
