"""The plotting library that pages carry: plotly.js with the traces of two axes alone, a third of
the whole.

Run by the build of a wheel and by `pip install -e .`. Where npm is not at hand the pages carry the
whole library out of the package `plotly`, and are one megabyte larger.
"""

from __future__ import annotations

import gzip
import hashlib
import shutil
import subprocess
import tarfile
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PACKAGE = "plotly.js-cartesian-dist-min"
VERSION = "4.1.1"
MEMBER = "package/plotly-cartesian.min.js"
SHA256 = "79542150855a52c567260e3137095dbe2b744e6d702a5cabe67da246942fba7a"
TARGET = "algid/report/assets/plotly.min.js.gz"
PATIENCE = 120.0  # s


# hatchling is installed in the build alone
class PlottingLibrary(BuildHookInterface[Any]):  # type: ignore[misc]
    """Puts the library among the page's assets before they are packed."""

    PLUGIN_NAME = "custom"

    # the names of the arguments are the interface's
    def initialize(self, version: str, build_data: dict[str, Any]) -> None:  # noqa: ARG002
        """Fetch the library unless it is there; a build without npm goes on without it."""
        target = Path(self.root) / TARGET
        if target.is_file():
            return
        try:
            content = fetched()
        except (
            OSError,
            subprocess.SubprocessError,
            tarfile.TarError,
            KeyError,
            ValueError,
        ) as error:
            self.app.display_warning(
                f"pages carry the whole of plotly: {PACKAGE} cannot be had ({error})"
            )
            return
        target.parent.mkdir(exist_ok=True)
        target.write_bytes(gzip.compress(content, 9, mtime=0))


def fetched() -> bytes:
    """The library's script as npm gives it.

    Raises
    ------
    FileNotFoundError
        If npm is missing.
    OSError, subprocess.SubprocessError
        If it fails.
    ValueError
        If it gives another script than the one that was tested.
    """
    npm = shutil.which("npm")
    if npm is None:
        raise FileNotFoundError("npm is not installed")
    with tempfile.TemporaryDirectory() as folder:
        command = [npm, "pack", f"{PACKAGE}@{VERSION}", "--silent", "--pack-destination", folder]
        subprocess.run(command, check=True, capture_output=True, timeout=PATIENCE, cwd=folder)
        archive = next(Path(folder).glob("*.tgz"))
        with tarfile.open(archive) as packed:
            member = packed.extractfile(MEMBER)
            content = member.read() if member else b""
    found = hashlib.sha256(content).hexdigest()
    if found != SHA256:
        raise ValueError(f"its SHA-256 is {found}, expected {SHA256}")
    return content
