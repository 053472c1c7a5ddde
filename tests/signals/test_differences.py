import numpy as np
import pytest

from algid.signals.differences import POINTS, Stencil


@pytest.mark.parametrize("shift", [0.0, 0.5e-3, 3.3e-3, -1.2e-3])
def test_polynomials_come_out_exactly(shift: float) -> None:
    stencil = Stencil(1e-3, shift)
    t = np.arange(40) * 1e-3
    coefficients = np.random.default_rng(0).standard_normal(POINTS)
    polynomial = np.polynomial.Polynomial(coefficients, domain=[0, 0.04], window=[-1, 1])
    value, slope, bend = stencil.differences(np.stack([polynomial(t), polynomial(t)]))
    at = t[stencil.torques(t.size)] + shift
    assert np.allclose(value[0], polynomial(at), atol=1e-12)  # rounding alone
    assert np.allclose(slope[0], polynomial.deriv(1)(at), atol=1e-8)
    assert np.allclose(bend[1], polynomial.deriv(2)(at), atol=1e-4)


def test_acceleration_converges_with_eighth_order() -> None:
    errors = []
    for dt in (0.04, 0.02):  # finer steps drown in rounding
        t = np.arange(0, 2, dt)
        stencil = Stencil(dt)
        _, _, bend = stencil.differences(np.stack([np.sin(8 * t), np.cos(8 * t)]))
        errors.append(np.abs(bend[0] + 64 * np.sin(8 * t[stencil.torques(t.size)])).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(8, abs=0.1)  # the order claimed
