"""A design's `report.html`: one file that opens offline."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from algid import __version__
from algid.design.campaign import Design
from algid.design.figures import figures
from algid.design.tables import bound_table, limit_table, sentence
from algid.report.arm import ArmDrawing, arm_html, arm_script
from algid.report.frame import bullets, figures_html, framed, links_of, section
from algid.report.html import table_html
from algid.report.text import file_name, significant
from algid.report.verdict import Level, Verdict

_READING = "Play the motion: is the space around the arm free? The grey line is the tip's path, the red one its limit."


def page_html(design: Design, source: str, warnings: Sequence[str]) -> str:
    """The page's text."""
    drawn = figures(design)
    campaign = design.campaign
    facts = (
        f"{significant(campaign.duration, 4)} s under {campaign.drive} control · logged at "
        f"{significant(campaign.experiment.rate, 4)} Hz · prior {file_name(source)}"
    )
    body = [
        table_html(bound_table(design)),
        table_html(limit_table(design)),
        _arm(design),
        *figures_html(drawn),
        *section("warnings", "Warnings", [], bullets(warnings, "") if warnings else ""),
    ]
    return framed(
        "a planned identification",
        file_name(source),
        facts,
        _verdict(design),
        [("arm", "The arm"), *links_of(drawn)] if body[2] else links_of(drawn),
        body,
        drawn,
        f"Made by algid {__version__}.",
        tab=f"Design for {file_name(source)}",
        scripts=[arm_script()],
    )


def _verdict(design: Design) -> Verdict:
    level: Level = "reservations" if design.open_parameters else "good"
    return Verdict(level, sentence(design))


def _arm(design: Design) -> str:
    """The arm's drawing; nothing where its lengths are not known."""
    limits, experiment = design.campaign.limits, design.campaign.experiment
    if not np.all(np.isfinite(limits.lengths)):
        return ""
    l1, l2 = limits.lengths.tolist()
    value = dict(zip(design.names, design.campaign.belief.mean.tolist(), strict=True))
    payload = f"payload of {significant(value['m_p'], 3)} kg" if experiment.runs[1] else ""
    arm = ArmDrawing("arm", l1, l2, design.t, design.motion.theta, payload=payload, height=limits.height)
    return arm_html(arm, "The arm", _READING)
