"""The command line: one file a command; errors become one line and an exit code in one place."""

from __future__ import annotations

import signal
import sys
from types import FrameType

EXIT_FAILED = 1
EXIT_USAGE = 2
EXIT_INCOMPLETE = 3


def main() -> None:
    """Run algid; the entry point of the console script."""
    if sys.platform == "win32":
        print("algid: it runs on Linux and macOS; on Windows, run it in WSL", file=sys.stderr)
        sys.exit(EXIT_USAGE)
    from algid.cli.streams import harden_streams
    from algid.runtime import bound_by_environment

    def stop(number: int, _frame: FrameType | None) -> None:
        """Leave by an exception, so that what is half-written is taken away."""
        raise _StoppedError(128 + number)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
    harden_streams()
    bound_by_environment()  # before anything loads numpy
    from algid.cli.app import called
    from algid.errors import AlgidError

    try:
        called(sys.argv[1:])()
    except AlgidError as error:
        # control characters from foreign names are made visible: they would break the line
        line = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in str(error))
        print(f"algid: {line}", file=sys.stderr)
        sys.exit(EXIT_USAGE)
    except _StoppedError:
        print("algid: stopped; nothing half-written is left", file=sys.stderr)
        raise


class _StoppedError(SystemExit):
    """A signal ends algid. typer hands it on, where it would make a `KeyboardInterrupt` an exit without a word."""
