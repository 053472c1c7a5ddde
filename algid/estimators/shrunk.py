"""Parameters where no likelihood of white noise holds: every term of the torque is shrunk.

The windows of the weak form are gathered with the columns of all terms, linearised where they are
not linear, and weighed by each joint's residual, log by log; `algid.estimators.shrinkage` finds
parameters and spreads. A joint that stands is held by dry friction, which is any torque up to f
there: its windows are left out.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.criteria import AT_REST
from algid.base.names import within
from algid.estimators import weak
from algid.estimators.combine import LogInformation, Prior
from algid.estimators.fit import Fit
from algid.estimators.modulating_functions import OVERLAP, Known, row_weights
from algid.estimators.parametrisation import Shared
from algid.estimators.repeats import Groups, grouped, merged, shared_out
from algid.estimators.shrinkage import Expected, dispersion, divided, joined, shrink
from algid.estimators.shrunk_fit import concluded
from algid.estimators.weak import Normal, Source, WeakSettings
from algid.model import EVERY_TERM, K3, SINES, TERMS

_DELAYS = tuple(name for name, term in EVERY_TERM.items() if term.delays)
_ROUNDS = 3
_REWEIGHTINGS = 4
_MOST_KEPT = 1 << 20  # samples of all logs whose moments stay in memory, some 40 bytes each


def fit(
    unloaded: Sequence[Source],
    loaded: Sequence[Source] = (),
    settings: WeakSettings | None = None,
    lengths: Mapping[str, float] | None = None,
    known: Prior | None = None,
) -> Fit:
    """Parameters of the arm, of every term and of its payload where there are loaded logs.

    Parameters
    ----------
    unloaded, loaded : sequences of callables
        Each gives a fresh iterable of `Segment`, the stretches of one log in time; called a few
        times.
    settings : WeakSettings
        Window, bandwidth, hold and delay; its model's gravity and shapes of friction. With a delay
        that is not zero none is estimated.
    lengths : mapping of "l1", "l2" to m, where known
    known : Prior
        What an earlier result knows of the arm and of its terms; unloaded logs are not needed then.

    Raises
    ------
    ValueError
        If no log is long enough for a window, or there is neither an unloaded log nor `known`.
    """
    settings = settings or WeakSettings()
    logs = _Logs(tuple(unloaded), tuple(loaded))
    held: tuple[str, ...] = ()
    if known is not None:
        held = known.names
    first = logs.normals(_with_terms(settings, ()), {})
    logs = logs.remembering([normal for _, normal in first])
    terms = offered([normal for _, normal in first], held)
    estimates_delay = settings.estimate_delay or settings.shift.delay == 0
    settings = replace(_with_terms(settings, terms), estimate_delay=estimates_delay)
    settings = resting(unloaded, loaded, settings)
    shared = Shared(settings.model, estimates_delay, bool(loaded), dict(lengths or {}))
    moved = np.max([normal.moved for _, normal in first], axis=0)
    return _estimated(logs, shared, settings, known, held, moved)


def resting(
    unloaded: Sequence[Source], loaded: Sequence[Source], settings: WeakSettings
) -> WeakSettings:
    """The settings with the speeds below which a joint of these logs stands."""
    rest = AT_REST * weak.speeds(list(unloaded) + list(loaded), settings)
    return replace(settings, rest=(float(rest[0]), float(rest[1])))


def offered(normals: Sequence[Normal], held: Sequence[str] = ()) -> tuple[str, ...]:
    """Terms that logs can determine: no gain without a motor; a lag is a delay to first order."""
    driven = all(normal.gram[:, :, -1, -1].any(axis=0).all() for normal in normals)
    terms = []
    for name, term in TERMS.items():
        free = term.spread is not None and (driven or not term.gains)
        if free or not set(term.names).isdisjoint(held):
            terms.append(name)
    return tuple(terms)


def _with_terms(settings: WeakSettings, terms: Sequence[str]) -> WeakSettings:
    """The settings with these terms and no delay to estimate."""
    model = replace(settings.model, terms=tuple(terms))
    return replace(settings, model=model, estimate_delay=False)


@dataclass(frozen=True, eq=False)
class _Logs:
    """Logs, and what all passes over each of them have in common, where that is little."""

    unloaded: tuple[Source, ...]
    loaded: tuple[Source, ...]
    known: tuple[dict[Hashable, Known], ...] = ()

    def remembering(self, normals: Sequence[Normal]) -> _Logs:
        """The logs of `normals`, whose moments are kept unless they have too many samples."""
        if sum(normal.samples for normal in normals) > _MOST_KEPT:
            return self
        return replace(self, known=tuple({} for _ in self.unloaded + self.loaded))

    def normals(
        self, settings: WeakSettings, at: Mapping[bool, FloatArray]
    ) -> list[tuple[bool, Normal]]:
        """Normal equations of each log that is long enough, and whether it is loaded."""
        return [(kind, normal) for _, kind, normal in self.placed(settings, at)]

    def groups(self, places: Sequence[int]) -> Groups:
        """Which of the logs at `places`, those that are long enough, repeat each other."""
        groups = []
        for group in grouped(self.unloaded, self.loaded):
            long_enough = tuple(map(places.index, within(group, places)))
            if long_enough:
                groups.append(long_enough)
        return tuple(groups)

    def placed(
        self, settings: WeakSettings, at: Mapping[bool, FloatArray]
    ) -> Iterator[tuple[int, bool, Normal]]:
        """The same with the place of each log."""
        for place, source in enumerate(self.unloaded + self.loaded):
            kind = place >= len(self.unloaded)
            known = self.known[place] if self.known else None
            normal = weak.normal_equations(source, settings, at.get(kind), known)
            if normal is not None:
                yield place, kind, normal


def _estimated(
    logs: _Logs,
    shared: Shared,
    settings: WeakSettings,
    known: Prior | None,
    held: Sequence[str],
    moved: FloatArray,
) -> Fit:
    base, columns = settings.shift.delay, len(settings.model.names)
    placed = list(logs.placed(settings, {}))
    normals = [(kind, normal) for _, kind, normal in placed]
    bare = [normal for loaded, normal in normals if not loaded]
    burdened = [normal for loaded, normal in normals if loaded]
    beta, _ = weak.first_estimate(shared, bare, burdened, known)
    first = bare + burdened
    driven = _driven(bare) + _driven(burdened)
    groups = logs.groups([place for place, _, _ in placed])
    share: FloatArray = np.ones(0)
    for number in range(_ROUNDS):
        if number:
            at = {}
            for kind, _ in normals:
                at[kind] = shared.coefficients(beta, kind)[:columns]
            if shared.delay:
                base = float(beta[columns])
                settings = settings.delayed(base)
            normals = logs.normals(settings, at)
        expected = expectation(shared, first, settings, beta, held)
        if number == 0:
            share = np.ones(len(expected.names))
        for _ in range(_REWEIGHTINGS):
            likelihoods = []
            for (kind, normal), moved_by in zip(normals, driven, strict=True):
                likelihoods.append(_weighed(shared, normal, kind, beta, base, moved_by))
            likelihoods = shared_out(likelihoods, groups)
            phi = dispersion(shared, merged(likelihoods, groups), beta)
            scaled = divided(likelihoods, phi)
            beta, share = shrink(shared, scaled, beta, expected, share, known)
    own = expected.prior(share)
    return concluded(shared, scaled, beta, joined(known, own), own, moved, groups)


_HARDLY = 0.2
"""Share of the most torque that a joint has in any log of a kind: with less it is hardly driven."""


def _driven(normals: Sequence[Normal]) -> list[NDArray[np.bool_]]:
    """Which joints (2,) of each log of one kind are driven, those without a motor among them.

    What moves a joint that is hardly driven is what the model lacks, and its equation is solved by
    constants near nothing: the better, the more it would weigh. An arm without its payload may need
    a fifth of the torque and is driven nevertheless.
    """
    torques: list[FloatArray] = []
    for normal in normals:
        squares = normal.gram[:, :, -1, -1].sum(axis=0)
        torques.append(np.sqrt(squares / np.maximum(normal.rows, 1)))
    most = np.max(torques, axis=0, initial=0.0)
    return [(torque >= _HARDLY * most) for torque in torques]


def _weighed(
    shared: Shared,
    normal: Normal,
    loaded: bool,
    beta: FloatArray,
    base: float,
    driven: NDArray[np.bool_],
) -> LogInformation:
    """A log's likelihood with the weights of its residual at `beta` (Q,) of the `driven` joints.

    The delay's column is that of a change from `base`, in s.
    """
    c0 = shared.coefficients(beta, loaded)
    c = c0.copy()
    if shared.delay:
        c[-1] -= base
    weights = row_weights(normal.gram.sum(axis=0), np.append(-c, 1.0), normal.rows)
    weights = np.where(driven, weights, 0.0)
    # Overlapping rows repeat each other: a window's worth of rows counts as two.
    gram = np.einsum("a,baxy->bxy", weights * (2.0 / OVERLAP), normal.gram)
    S = gram[:, :-1, :-1]
    return LogInformation(loaded, c0, S, gram[:, :-1, -1] - S @ c)


def expectation(
    shared: Shared,
    normals: Sequence[Normal],
    settings: WeakSettings,
    beta: FloatArray,
    held: Sequence[str] = (),
) -> Expected:
    """Prior of the terms of logs whose torque has the size of `normals`, except those `held`."""
    squares, rows = np.zeros(2), np.zeros(2)
    for normal in normals:
        squares += normal.gram[:, :, -1, -1].sum(axis=0)
        rows += normal.rows
    torque = np.sqrt(squares / np.maximum(rows, 1.0))
    # a joint without a motor carries a load like the other's
    torque = np.where(torque > 0, torque, torque.max())
    value = dict(zip(shared.names, np.abs(beta).tolist(), strict=True))
    names, terms, means, spreads, usual = [], [], [], [], []
    offered_terms = shared.model.terms
    if shared.delay:
        offered_terms += _DELAYS
    for term in offered_terms:
        spread = EVERY_TERM[term].spread
        if spread is None:
            continue
        mean = 0.0
        if term in _DELAYS and not settings.shift.held:
            mean = 0.5 * normals[0].dt  # of a torque that a digital controller holds
        for name in EVERY_TERM[term].names:
            if name in held or name not in shared.names:
                continue
            unit = 1.0
            if spread.of == "inertia":
                unit = value[K3]
            elif spread.of == "torque":
                unit = float(torque[int(name.endswith("2"))])
            elif spread.of == "cosine":
                unit = value[SINES[name]]
            names.append(name)
            terms.append(term)
            means.append(mean)
            spreads.append(spread.size * unit)
            usual.append(spread.usual)
    return Expected(tuple(names), tuple(terms), np.array(means), np.array(spreads), np.array(usual))
