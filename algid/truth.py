"""What travels with a synthetic log: the true arm and payload, and sums that betray changed values.

Written as one JSON object named "algid": an MCAP metadata record, a Parquet key, or a file ``LOG.truth.json``
beside a CSV log.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from algid.arm import Arm
from algid.log import Truth

KEY = "algid"


@dataclass(frozen=True)
class Companion:
    """The JSON object: truth, and by column name the sum of its 64-bit words modulo 2^64."""

    truth: Truth | None
    sums: Mapping[str, int]

    def dumps(self) -> str:
        """As JSON text; sums as decimal text, since JSON numbers stop at 2^53."""
        content: dict[str, Any] = {"sums": {name: str(value) for name, value in self.sums.items()}}
        if self.truth is not None:
            content |= {
                "arm": asdict(self.truth.arm),
                "payload": self.truth.payload,
                "case": self.truth.case,
            }
            if self.truth.schedule:
                content["schedule"] = [list(change) for change in self.truth.schedule]
        return json.dumps({**content, "crc32": _checksum(content)})


def loads(text: str | bytes) -> Companion:
    """The companion that `Companion.dumps` wrote.

    Raises
    ------
    ValueError
        If the text is not such an object.
    """
    try:
        content = json.loads(text)
        if content.pop("crc32") != _checksum(content):
            raise ValueError("its checksum is wrong")
        sums = {str(name): int(value) for name, value in content["sums"].items()}
        if "arm" not in content:
            return Companion(None, sums)
        arm = Arm(**{name: float(value) for name, value in content["arm"].items()})
        case = None if content["case"] is None else str(content["case"])
        schedule = tuple((float(time), float(mass)) for time, mass in content.get("schedule", ()))
        return Companion(Truth(arm, float(content["payload"]), case, schedule), sums)
    except (KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError(f"not the truth of a synthetic log: {error!r}") from error


def _checksum(content: dict[str, Any]) -> int:
    return zlib.crc32(json.dumps(content, sort_keys=True).encode())


def word_sum(values: NDArray[Any]) -> int:
    """Sum of the 64-bit words of `values` (N,), float64 or int64, modulo 2^64."""
    return int(np.ascontiguousarray(values).view(np.uint64).sum(dtype=np.uint64))


def add(one: int, other: int) -> int:
    """Two sums of words as one."""
    return (one + other) % (1 << 64)
