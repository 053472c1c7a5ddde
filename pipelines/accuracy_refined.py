"""The refined estimator alone against the Cramér-Rao bound: the part of `make accuracy` that wants
many draws.

    python -m pipelines.accuracy_refined --draws 100

The draws are those of `make accuracy`, at σ_θ = 1e-3 rad and with 12-bit encoders; errors over the
bound do not depend on σ_θ, as that command shows.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.estimators import refined
from pipelines import accuracy, accuracy_scenes


def draw(name: str, sigma: float, encoder: bool, seed: int) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Errors (8,) of k1 … k7 and m_p on one pair of logs, and which intervals (10,) hold the
    truth.
    """
    here = accuracy.scene_of(name)
    rng = np.random.default_rng([seed, sum(name.encode())])
    bare, loaded = (
        accuracy_scenes.noisy(log, sigma, 10 * sigma, encoder, rng)
        for log in (here.bare, here.burdened)
    )
    fit = accuracy.fit_pair(refined.fit, bare, loaded)
    return fit.values[:8] - here.truth[:8], here.held_by(fit)


def line(pool: ProcessPoolExecutor, name: str, sigma: float, encoder: bool, draws: int) -> str:
    """RMS error over the bound of each parameter, largest bias over σ, coverage: a row of
    Markdown.
    """
    drawn = list(pool.map(partial(draw, name, sigma, encoder), range(draws), chunksize=5))
    bound = sigma * accuracy.bound(name)[:8]
    errors = np.array([error for error, _ in drawn])
    rms = np.sqrt(np.mean(errors**2, axis=0)) / bound
    bias = np.abs(errors.mean(axis=0) / errors.std(axis=0)).max()
    coverage = 100 * np.mean([inside for _, inside in drawn])
    noise = "12 bit" if encoder else f"{sigma:g}"
    return (
        f"| {name} | {noise} | {' | '.join(f'{value:.2f}' for value in rms)} | {bias:.2f} | "
        f"{coverage:.1f} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--draws", type=int, default=100)
    draws = parser.parse_args().draws
    with ProcessPoolExecutor(2) as pool:
        accuracy.install(
            dict(
                zip(accuracy.SCENES, pool.map(accuracy_scenes.scene, accuracy.SCENES), strict=True)
            )
        )
    print("| arm | σ_θ | k1 | k2 | k3 | k4 | k5 | k6 | k7 | m_p | largest bias / σ | coverage % |")
    print("|---" * 12 + "|")
    encoder_noise = accuracy_scenes.ENCODER_STEP / np.sqrt(12)
    with ProcessPoolExecutor(2, initializer=accuracy.install, initargs=(accuracy._scenes,)) as pool:
        for sigma, encoder in ((1e-3, False), (encoder_noise, True)):
            for name in accuracy.SCENES:
                print(line(pool, name, sigma, encoder, draws), flush=True)


if __name__ == "__main__":
    main()
