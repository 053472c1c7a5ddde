"""The whole application, as `algid --help` shows it."""

from algid.cli.app import COMMANDS, gathered

app = gathered(COMMANDS)
