"""The forest plot: intervals on one scale, at the places that the numbers ask for."""

from __future__ import annotations

import re

import pytest

from algid.report.drawings import EDGE, WIDTH, bars, forest
from algid.results import Estimate

GROUP = {
    "k1": Estimate(estimate=2.0, std=0.1, ci95=(1.8, 2.2), unit="kg m^2"),  # ± 10 %
    "k2": Estimate(estimate=-4.0, std=0.5, ci95=(-5.0, -3.0), unit="N m"),  # ± 25 %
    "k3": Estimate(estimate=None, std=None, ci95=(None, None), unit="kg m^2"),
    "k4": Estimate(estimate=1.0, std=None, ci95=None, unit="N m"),
}


def reach(drawing: str) -> tuple[float, float]:
    found = re.search(r'class="reach" x1="([-\d.]+)" y1="[\d.]+" x2="([-\d.]+)"', drawing)
    assert found is not None
    return float(found[1]), float(found[2])


def test_intervals_share_one_round_scale() -> None:
    drawn = forest(GROUP)
    assert drawn.limit == 50.0  # 25 % and room
    assert set(drawn.rows) == {"k1", "k2"}
    half = WIDTH / 2 - EDGE
    for name, share in (("k1", 0.2), ("k2", 0.5)):
        left, right = reach(drawn.rows[name])
        assert left == pytest.approx(WIDTH / 2 - share * half, abs=0.06)
        assert right == pytest.approx(WIDTH / 2 + share * half, abs=0.06)


def test_the_truth_and_each_log_stand_where_they_belong() -> None:
    drawing = forest(GROUP, {"k1": 2.2}, {"k1": [1.0, 1.8, 9.0]}).rows["k1"]
    ring = re.search(r'class="truth" cx="([\d.]+)"', drawing)
    assert ring is not None
    # the upper end of the interval
    assert float(ring[1]) == pytest.approx(reach(drawing)[1], abs=0.06)
    dots = [float(x) for x in re.findall(r'class="log" cx="([\d.]+)"', drawing)]
    assert dots == pytest.approx([EDGE, reach(drawing)[0]], abs=0.06)
    assert f'class="log beyond" cx="{WIDTH - 2.5:g}"' in drawing  # 9.0 lies beyond the scale


def test_one_wild_row_does_not_hide_the_others() -> None:
    steady = {
        f"k{place}": Estimate(estimate=1.0, std=0.01, ci95=(0.98, 1.02), unit="m")
        for place in range(5)
    }
    wild = {"k9": Estimate(estimate=1.0, std=0.4, ci95=(0.2, 1.8), unit="m")}
    drawn = forest(steady | wild)
    assert drawn.limit == 10.0  # 4 times 2 %, rounded up
    assert 'class="end"' in drawn.rows["k9"]
    assert 'class="end"' not in drawn.rows["k0"]


def test_estimates_about_zero_do_not_flatten_the_others() -> None:
    known = {f"k{n}": Estimate(estimate=1.0, ci95=(0.96, 1.04), unit="m") for n in range(3)}
    nothing = {f"o{n}": Estimate(estimate=0.001, ci95=(-1.0, 1.0), unit="m") for n in range(9)}
    drawn = forest(known | nothing)
    assert drawn.limit == 5.0  # 4 % and room
    assert 'class="end"' in drawn.rows["o0"]
    left, right = reach(drawn.rows["k0"])
    assert right - left > WIDTH / 2


def test_bars_stand_on_the_side_of_their_sign_and_share_a_scale() -> None:
    drawn = bars({"coulomb": -50.0, "offset": 25.0, "gain": 0.0})
    sizes = {
        name: float(re.findall(r'width="([-\d.]+)" height="10"', drawing)[0])
        for name, drawing in drawn.items()
    }
    assert sizes["coulomb"] == pytest.approx(2 * sizes["offset"], abs=0.1)
    assert sizes["gain"] == 0.0
    assert 'class="less"' in drawn["coulomb"]
    assert 'class="more"' in drawn["offset"]


def test_an_interval_beyond_the_scale_ends_in_arrows() -> None:
    wide = {"m_p": Estimate(estimate=0.01, std=1.0, ci95=(-2.0, 2.02), unit="kg")}
    nothing = {"m_p": Estimate(estimate=0.0, std=1.0, ci95=(-2.0, 2.0), unit="kg")}
    assert forest(wide).limit == 100.0
    for group in (wide, nothing):
        assert 'class="end"' in forest(group).rows["m_p"]
        assert reach(forest(group).rows["m_p"]) == pytest.approx((EDGE, WIDTH - EDGE))
    assert 'class="end"' not in forest(GROUP).rows["k2"]
