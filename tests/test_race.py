"""The contenders of the race: each reproduces an example whose answer is known, where it is
installed.
"""

from __future__ import annotations

import pytest

from pipelines.race_examples import EXAMPLES

NEEDS = {
    "MuJoCo sysid": "mujoco",
    "PySINDy weak form": "pysindy",
    "pinocchio regressors": "pinocchio",
}
SLOW = {"MuJoCo sysid", *(peer for peer in EXAMPLES if peer.startswith(("output", "IDIM")))}


@pytest.mark.parametrize(
    "peer",
    [pytest.param(peer, marks=pytest.mark.slow if peer in SLOW else ()) for peer in EXAMPLES],
)
def test_a_contender_reproduces_its_example(peer: str) -> None:
    if peer in NEEDS:
        pytest.importorskip(NEEDS[peer])
    if peer == "MuJoCo sysid" and not hasattr(pytest.importorskip("mujoco.sysid"), "ParameterDict"):
        pytest.skip("mujoco is here without its extra 'sysid'")
    example = EXAMPLES[peer]
    assert example.run() <= example.limit
