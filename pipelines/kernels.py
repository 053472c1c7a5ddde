"""OpenBLAS's kernels that this processor can run and does not choose by itself, one a line.

python -m pipelines.kernels
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

KERNELS = {"Haswell": "avx2", "Nehalem": "sse4_2", "SkylakeX": "avx512f", "Sandybridge": "avx"}
"""Kernels that sum in an order of their own, and the feature that a processor needs for each."""
WANTED = 2


def other_kernels(default: str, features: Collection[str]) -> list[str]:
    """Kernels other than the `default` that a processor with `features` can run, the first two."""
    runs = [kernel for kernel, feature in KERNELS.items() if feature in features]
    return [kernel for kernel in runs if kernel.lower() != default.lower()][:WANTED]


def processor_features(cpuinfo: str) -> set[str]:
    """What Linux's description of the processors lists as their features."""
    for line in cpuinfo.splitlines():
        name, _, value = line.partition(":")
        if name.strip() == "flags":
            return set(value.split())
    return set()


def default_kernel() -> str:
    """The kernel that OpenBLAS chooses here; empty where NumPy uses another library."""
    import numpy  # noqa: F401 (it loads the library that is asked)
    from threadpoolctl import threadpool_info

    names = [library.get("architecture", "") for library in threadpool_info()]
    return str(next(filter(None, names), ""))


if __name__ == "__main__":
    features = processor_features(Path("/proc/cpuinfo").read_text(encoding="utf-8"))
    print("\n".join(other_kernels(default_kernel(), features)))
