"""A log too short for any window beside a good one: the good one's result, its pages included."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import algid
from algid.identification.identify import identify
from algid.settings import Settings
from algid.synth.sensors import Sensors


def test_a_log_too_short_beside_a_good_one_still_gives_a_report(tmp_path: Path) -> None:
    log, _ = algid.synthesise("case1", duration=2.0, torque="wide", sensors=Sensors(1e-3, 1e-2))
    short = replace(
        log, stamp_ns=log.stamp_ns[:30], theta=log.theta[:, :30], tau=log.tau[:, :30], omega=None
    )
    result = identify(
        [log, short], settings=Settings(estimator="weak", model="plain"), out=tmp_path, name="both"
    )
    assert result.parameters["k1"].status == "OK"
    page = (tmp_path / "both.algid/report.html").read_text(encoding="utf-8")
    assert 'id="torque"' in page
    assert 'id="information"' not in page
