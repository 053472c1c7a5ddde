"""The lane of other processors' kernels never runs the one that the quick tests ran already."""

import pytest

from pipelines.kernels import other_kernels, processor_features

AVX2 = {"sse4_2", "avx", "avx2"}


@pytest.mark.parametrize(
    ("default", "features", "expected"),
    [
        ("SkylakeX", AVX2 | {"avx512f"}, ["Haswell", "Nehalem"]),
        ("Haswell", AVX2 | {"avx512f"}, ["Nehalem", "SkylakeX"]),
        ("Haswell", AVX2, ["Nehalem", "Sandybridge"]),
        ("Zen", AVX2, ["Haswell", "Nehalem"]),
        ("Nehalem", {"sse4_2"}, []),
        ("armv8", set(), []),
    ],
)
def test_other_kernels_differ_from_the_default(
    default: str, features: set[str], expected: list[str]
) -> None:
    assert other_kernels(default, features) == expected


def test_features_come_from_the_line_of_flags() -> None:
    text = "processor\t: 0\nmodel name\t: Some avx512f\nflags\t\t: fpu sse4_2 avx\nbugs\t: none\n"
    assert processor_features(text) == {"fpu", "sse4_2", "avx"}
