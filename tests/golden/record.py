"""Write what the suite expects: `make golden`.

The commit that does so says which numbers moved, and why.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

from tests.golden.cases import SHARED, cases

EXPECTED = Path(__file__).parent / "expected.json"


def main() -> None:
    """Run every case; those of recorded logs keep what they had where the logs are absent."""
    before = json.loads(EXPECTED.read_text(encoding="utf-8")) if EXPECTED.is_file() else {}
    found = {}
    for case in cases():
        if case.real and not SHARED.is_dir():
            found[case.name] = before[case.name]
            continue
        with tempfile.TemporaryDirectory() as folder:
            found[case.name] = case.run(Path(folder))
    text = json.dumps(found, indent=None, separators=(",", ":"), ensure_ascii=False)
    EXPECTED.write_text(text.replace('},"', '},\n"') + "\n", encoding="utf-8")
    print(f"{len(found)} cases in {EXPECTED.name}")


if __name__ == "__main__":
    main()
