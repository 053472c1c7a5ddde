"""A name of version 0.2 is answered in one line that says what to do instead."""

from __future__ import annotations

import pytest

import algid
from algid.api.guide import text_of
from algid.base.errors import AlgidError
from algid.moved import MOVED
from algid.options import BY_SET
from tests.cli.commands import call

NEVER = {"offsets", "signs", "time", "time_unit"}
"""Settings that never had a flag."""


@pytest.mark.parametrize("old", MOVED)
def test_what_has_moved_says_where(old: str) -> None:
    words = old.removeprefix("algid ").replace("=", " ").split()
    if old.startswith("--"):
        words = ["report", "x.algid", *words]
    done = call(*words)
    assert (done.code, done.out, done.err.count("\n")) == (2, "", 1)
    assert done.err == f"algid: {old} is not in this version; instead: {MOVED[old]}\n"
    assert f"| `{old}` | {MOVED[old]} |" in text_of("start")


@pytest.mark.parametrize("name", sorted(BY_SET - NEVER))
def test_a_flag_that_became_a_setting_says_so(name: str) -> None:
    old = f"--{name.replace('_', '-')}"
    done = call("identify", "log.csv", f"{old}=1")
    assert (done.code, done.out) == (2, "")
    assert done.err == f"algid: {old} is not in this version; instead: --set {name}=VALUE\n"


def test_a_keyword_that_there_is_not_is_an_error_of_algid() -> None:
    with pytest.raises(AlgidError, match="did you mean window"):
        algid.identify({}, windows=2.0)  # type: ignore[call-arg]
