"""The guide has a page for each topic, and an entry for each code that the program knows."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

import algid
from algid.api.guide import text_of, topics
from algid.notices import messages
from tests.cli.commands import app

ROOT = Path(algid.__file__).parent
CALLS = re.compile(r"\b(?:Notice|Finding)\(\s*(?:\w+=)?\"([A-Z][A-Z0-9_]*)\"")
STATUS = re.compile(r'^    ([A-Z_]+) = "\1"$', re.MULTILINE)


def codes() -> set[str]:
    """The codes of notices, findings and statuses, out of the source."""
    found: set[str] = {one.code for one in messages()}
    for path in ROOT.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        found |= set(CALLS.findall(text)) | set(STATUS.findall(text))
    return found


def test_every_code_has_its_entry_in_the_guide() -> None:
    entries = set(re.findall(r"^### (\S+)$", text_of("warnings"), re.MULTILINE))
    assert len(entries) > 30
    assert codes() - entries == set()
    assert entries - codes() == set()


@pytest.mark.parametrize("topic", topics())
def test_every_topic_can_be_read(topic: str) -> None:
    shown = CliRunner().invoke(app, ["guide", topic])
    assert shown.exit_code == 0
    assert shown.stdout == text_of(topic)
    assert shown.stdout.startswith("# ")


def test_without_a_topic_all_topics_are_listed() -> None:
    shown = CliRunner().invoke(app, ["guide"])
    assert all(f"algid guide {topic}" in shown.stdout for topic in topics())
