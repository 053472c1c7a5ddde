"""A design's `report.html`: one file that opens offline."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from algid import __version__
from algid.base.text import file_name, significant
from algid.designs.campaign import SECOND, Design
from algid.designs.figures import motion
from algid.designs.tables import bound_table, limit_table, verdict
from algid.notices import Notice
from algid.report.arm import ArmDrawing
from algid.report.document import Document, Section
from algid.report.figures import shares_of_time
from algid.report.render import page


def page_html(design: Design, source: str, doubts: Sequence[Notice] = ()) -> str:
    """The page's text."""
    return page(design_document(design, source, doubts))


def design_document(design: Design, source: str, doubts: Sequence[Notice] = ()) -> Document:
    """The report of a design for the arm that `source` describes."""
    campaign, name = design.campaign, file_name(source)
    information = shares_of_time(design.names, design.shares, SECOND)
    return Document(
        title=f"Design for {name}",
        verdict=verdict(design, doubts),
        sections=(
            Section("numbers", "Numbers", (bound_table(design), limit_table(design))),
            Section("motion", "The motion", (motion(design),)),
            Section("information", "Information by time", (information,)),
        ),
        kicker="a planned identification",
        name=name,
        facts=f"{significant(campaign.duration, 4)} s under position control · logged at "
        f"{significant(campaign.experiment.rate, 4)} Hz · prior {name}",
        made=f"Made by algid {__version__}.",
        arm=_arm(design),
    )


def _arm(design: Design) -> ArmDrawing | None:
    """The arm's drawing; nothing where its lengths are not known."""
    limits = design.campaign.limits
    if not np.all(np.isfinite(limits.lengths)):
        return None
    l1, l2 = limits.lengths.tolist()
    payload = ""
    if design.campaign.experiment.runs[1]:
        mass = float(design.campaign.belief.mean[list(design.names).index("m_p")])
        payload = f"payload of {significant(mass, 3)} kg"
    reading = "Play the motion: is the space around the arm free? The grey line is the tip's path"
    height = limits.height if np.isfinite(limits.height) else None
    if height is not None:
        reading += ", the red one its limit"
    return ArmDrawing(l1, l2, design.t, design.motion.theta, f"{reading}.", payload, height)
