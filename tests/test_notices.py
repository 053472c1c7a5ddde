"""Notices are codes with numbers.

Remedies are written for a command line, a profile and Python alike.
"""

from __future__ import annotations

import json
import re

import pytest

from algid.notices import (
    Notice,
    Remedy,
    code_of_now,
    merged,
    message,
    messages,
)
from algid.options import BY_SET
from algid.profile import Profile, with_settings
from algid.results.verdict import CAUSES
from tests.cli.commands import profile_from

REMEDIES = (
    Remedy({"zero": "hanging"}),
    Remedy({"tau1.sign": -1, "tau2.sign": -1}),
    Remedy({"joints": ["elbow", "shoulder"]}),
    Remedy({"offsets": [0.2, -0.3], "drive": "base"}),
    Remedy({"theta2.unwrap": True}),
    Remedy({"angle_unit": "deg"}),
    Remedy({"accept": "LOST_SAMPLES"}),
)


def flags_as_given(remedy: Remedy) -> dict[str, object]:
    """What the command line makes of a remedy's flags."""
    given: dict[str, object] = {}
    several: list[str] = []
    for flag, text in zip(remedy.flags[::2], remedy.flags[1::2], strict=True):
        if flag == "--set":
            several.append(text)
        else:
            given[flag.removeprefix("--").replace("-", "_")] = text
    return given | ({"set": several} if several else {})


@pytest.mark.parametrize("remedy", REMEDIES, ids=lambda one: one.words)
def test_flags_and_keywords_of_a_remedy_mean_the_same(remedy: Remedy) -> None:
    by_flags = profile_from(flags_as_given(remedy))
    if "angle_unit" not in remedy.settings:
        by_keywords = with_settings(Profile(), remedy.settings)
        assert by_keywords.model_dump() == by_flags.model_dump()


def test_what_only_the_user_knows_is_left_open() -> None:
    remedy = Remedy({"tau1.source": None}, "name the measured torque")
    assert not remedy.complete
    assert remedy.words == "--set tau1.source=NAME"
    assert Notice("EFFORT_ZERO", "zero", remedies=(remedy, REMEDIES[0])).remedy == REMEDIES[0]


def test_every_cause_has_its_text() -> None:
    for cause in CAUSES:
        code, _, case = cause.partition(":")
        text = message(code)["text"]
        assert text if not case else case in text


def test_every_code_of_an_earlier_version_has_one_of_now() -> None:
    earlier = [old for one in messages() for old in one["was"]]
    assert len(set(earlier)) == len(earlier)
    assert not set(earlier) & {one["code"] for one in messages()}
    assert code_of_now("CUT_OFF") == "CUT_OFF"
    assert code_of_now(earlier[0]) in {one["code"] for one in messages()}


def test_every_entry_is_whole() -> None:
    """A code has a cause; its notes and losses name cases, and its text flags, that there are."""
    by_set = {f"--{name.replace('_', '-')}" for name in BY_SET}
    for one in messages():
        assert not by_set & set(re.findall(r"--[a-z][a-z0-9-]+", str(one))), one
        assert one["cause"], one
        for forms in re.findall(r":~?([^{}]*[|][^{}]*)}", str(one)):  # of one, and of several
            assert len({form.count("#") for form in forms.split("|")}) == 1, forms
        for cases in (one["note"], one["lossy"]):
            assert isinstance(cases, bool) or set(cases) <= set(one["text"]), one


def test_equal_notices_of_several_logs_become_one_and_each_loss_stays() -> None:
    jitter = [
        Notice("UNEVEN_STAMPS", f"by {place} ms", logs=(f"{place}.csv",)) for place in range(5)
    ]
    lost = [
        Notice("NOT_FINITE", f"{place} samples", lossy=True, logs=("0.csv",)) for place in range(2)
    ]
    found = merged([*jitter, *lost])
    assert [one.code for one in found] == ["UNEVEN_STAMPS", "NOT_FINITE", "NOT_FINITE"]
    assert found[0].logs == ("0.csv", "1.csv", "2.csv", "3.csv", "4.csv")
    assert found[0].sentence == "0.csv, 1.csv, 2.csv and 2 more: by 0 ms"


def test_a_notice_is_plain_data() -> None:
    one = Notice("WRONG_ZERO", numbers={"turn": -90.0}, remedies=(REMEDIES[0],))
    assert (
        one.clause
        == "gravity is turned by about -90°: θ1 is not from the horizontal: --zero hanging"
    )
    assert json.dumps(dict(one.numbers)) == '{"turn": -90.0}'


@pytest.mark.parametrize(
    ("code", "numbers", "text"),
    [
        ("FLEET_CHANGE", {"case": "drift", "count": 2000, "names": ["k6"]}, "2,000 drifts: k6"),
        ("NOT_IDENTIFIABLE", {"names": ["k5"]}, "k5 is not identifiable"),
        ("NOT_IDENTIFIABLE", {"names": ["k3", "k5"]}, "k3 and k5 are not identifiable"),
        ("CUT_OFF", {"case": "end"}, "the file breaks off behind its last whole record"),
        (
            "DAMAGED",
            {"case": "row", "count": 1, "why": "zeros", "missing": 0},
            "1 damaged row left out; the first: zeros",
        ),
        (
            "DAMAGED",
            {"case": "chunk", "count": 2, "why": "zeros", "missing": 1200},
            "2 damaged chunks left out; the first: zeros; 1,200 messages are missing",
        ),
        (
            "DEGREES",
            {"case": "reach", "largest": 90.0, "unit": "rad"},
            "angles reach 90: few arms turn that far in rad; they are taken for rad as stated",
        ),
        (
            "OPEN_DIRECTION",
            {"case": "several", "names": ["k1", "k3", "k5"], "count": 2, "why": ""},
            "k1, k3 and k5 only in 2 combinations",
        ),
        (
            "GAPS",
            {"case": "gaps", "count": 1, "seconds": 2.0, "accepted": True, "looked_at": 30},
            (
                "1 gap, the longest 2 s; no window spans one (accepted by --accept) "
                "(in its first 30 s)"
            ),
        ),
    ],
)
def test_cases_and_parts_of_a_text_follow_the_numbers(
    code: str, numbers: dict[str, object], text: str
) -> None:
    assert Notice(code, numbers=numbers).text == text


def test_an_unknown_case_is_refused() -> None:
    with pytest.raises(ValueError, match="CUT_OFF"):
        Notice("CUT_OFF", numbers={"case": "elsewhere"})
