"""Write what the suite expects: `make golden`, or `python -m tests.golden.record NAME ...`.

With names only those cases are written.

The commit that does so says which numbers moved, and why.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

from tests.golden.cases import SHARED, cases

EXPECTED = Path(__file__).parent / "expected.json"


def main(names: list[str]) -> None:
    """Run the cases of these names, or all.

    Others keep what they had, and so do those of recorded logs where the logs are absent.
    """
    before = json.loads(EXPECTED.read_text(encoding="utf-8")) if EXPECTED.is_file() else {}
    found = {}
    for case in cases():
        if (names and case.name not in names) or (case.real and not SHARED.is_dir()):
            found[case.name] = before[case.name]
            continue
        with tempfile.TemporaryDirectory() as folder:
            found[case.name] = case.run(Path(folder))
        for name, (value, spread) in found[case.name].get("numbers", {}).items():
            old = before.get(case.name, {}).get("numbers", {}).get(name, [None, None])[0]
            if (
                old is not None
                and value is not None
                and spread
                and abs(value - old) > 1e-6 * spread
            ):
                print(
                    f"{case.name}: {name} {old:.6g} -> {value:.6g}, {(value - old) / spread:+.2g} σ"
                )
    text = json.dumps(found, indent=None, separators=(",", ":"), ensure_ascii=False)
    EXPECTED.write_text(text.replace('},"', '},\n"') + "\n", encoding="utf-8")
    print(f"{len(found)} cases in {EXPECTED.name}")


if __name__ == "__main__":
    main(sys.argv[1:])
