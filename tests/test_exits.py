"""One table of exit codes: help, README and guide say what the code says."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from algid.api.guide import text_of
from algid.base.exits import MEANINGS, OF_COMMAND, WHAT_TO_DO, Exit, epilog, exit_of, rows
from tests.cli.commands import NAMES, app

README = Path(__file__).parents[1] / "README.md"


def test_a_failure_counts_more_than_lost_data() -> None:
    assert exit_of(failed=False, lost=False) is Exit.OK
    assert exit_of(failed=False, lost=True) is Exit.DATA_LOST
    assert exit_of(failed=True, lost=True) is Exit.FAILED


def test_every_code_has_a_meaning_and_every_command_its_codes() -> None:
    assert set(MEANINGS) == set(WHAT_TO_DO) == set(Exit)
    assert set(OF_COMMAND) <= set(NAMES)


def test_readme_and_guide_hold_the_table() -> None:
    for cells in rows():
        line = f"| {' | '.join(cells)} |\n"
        assert line in text_of("batch")
        assert line in README.read_text(encoding="utf-8")


@pytest.mark.parametrize("command", NAMES)
def test_help_ends_with_the_codes_of_the_command(command: str) -> None:
    shown = CliRunner().invoke(app, [command, "--help"], env={"COLUMNS": "200"}).output
    words = " ".join(shown.split())
    assert " ".join(epilog(command).split()) in words.replace("│", "").replace("  ", " ")
