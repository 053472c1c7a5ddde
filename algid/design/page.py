"""A design's `report.html`: one file that opens offline."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from algid import __version__
from algid.design.campaign import Design
from algid.design.figures import figures
from algid.design.tables import bound_table, limit_table, sentence
from algid.report.arm import ArmDrawing, arm_html, arm_script
from algid.report.html import escaped, figure_html, script_json, table_html
from algid.report.page import document, drawing, section
from algid.report.text import file_name, significant

_READING = "Play the motion: is the space around the arm free? The grey line is the tip's path, the red one its limit."


def page_html(design: Design, source: str, warnings: Sequence[str]) -> str:
    """The page's text."""
    drawn = figures(design)
    campaign = design.campaign
    facts = (
        f"{significant(campaign.duration, 4)} s under {campaign.drive} control · logged at "
        f"{significant(campaign.experiment.rate, 4)} Hz · prior {file_name(source)}"
    )
    links = [("numbers", "Numbers"), ("arm", "The arm"), *((figure.key, figure.title) for figure in drawn)]
    listed = "".join(f'<li><a href="#{key}">{escaped(title)}</a></li>' for key, title in links)
    body = [
        f'<header><p class="kicker">algid · a planned identification</p><h1>{escaped(file_name(source))}</h1>',
        f'<p class="facts">{escaped(facts)}</p>',
        f"{_banner(design)}</header>",
        f'<nav aria-label="Contents"><ul>{listed}</ul></nav>',
        '<main id="numbers">',
        table_html(bound_table(design)),
        table_html(limit_table(design)),
        _arm(design),
        *map(figure_html, drawn),
        *section("warnings", "Warnings", [], _list(warnings)),
        "</main>",
        f"<footer>Made by algid {escaped(__version__)}.</footer>",
        '<noscript><p class="missing">The figures need JavaScript; all numbers stand without it.</p></noscript>',
    ]
    return document(
        f"Design for {file_name(source)}", "\n".join(body), script_json(drawing(drawn)), scripts=[arm_script()]
    )


def _banner(design: Design) -> str:
    level, sign = ("reservations", "!") if design.open_parameters else ("good", "✓")
    return (
        f'<div class="verdict {level}"><span class="sign" aria-hidden="true">{sign}</span>'
        f"<div><p>{escaped(sentence(design))}</p></div></div>"
    )


def _list(warnings: Sequence[str]) -> str:
    return f"<ul>{''.join(f'<li>{escaped(warning)}</li>' for warning in warnings)}</ul>" if warnings else ""


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
