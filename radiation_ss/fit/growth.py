"""Where descents start: the modes of the damping side by side, or a smaller model with new states beside it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from radiation_ss.arrays import FloatArray
from radiation_ss.fit.descent import minimise, misfit_of
from radiation_ss.fit.port import Port, port_of
from radiation_ss.fit.problem import Problem
from radiation_ss.fit.rational import response_of
from radiation_ss.fit.start import passive_numerator, sanathanan_koerner, spread

Start = tuple[Port, FloatArray]
"""A form and its parameters."""


def modal(problem: Problem, order: int, motions: int, rng: np.random.Generator, slight: float = 1e-2) -> Start:
    """Return the modes of the damping, each fitted alone, side by side.

    They are disturbed by `slight`: couplings that are exactly zero may have no slope.
    """
    K, weight = problem.whole(problem.K), problem.whole(problem.weight)
    U = np.linalg.eigh(K.real.sum(axis=0))[1][:, ::-1][:, :motions]
    parts = []
    for k in range(motions):
        mode = replace(problem.along(U[:, [k]]), weight=np.sqrt((weight**2 @ U[:, k] ** 2) @ U[:, k] ** 2)[:, None])
        size = float(np.abs(mode.K).max())
        mode = replace(mode, K=mode.K / size, K_points=mode.K_points / size)
        form, theta = alone(mode, order, rng, tried=2 if motions > 1 else 4)
        e1, e2, G, _ = form.unpack(theta)
        parts.append((e1, e2, G, np.sqrt(size) * form.realise(theta)[1][:form.n1] @ U[:, [k]].T))
    form, theta = beside(parts, problem.zero)
    return form, theta + slight * rng.normal(size=theta.size)


def alone(problem: Problem, order: int, rng: np.random.Generator, tried: int, steps: int = 10,
          slight: float = 1e-3) -> Start:
    """Return the model of one motion that is best after `steps` from each of the best `tried` rational starts."""
    rational = sorted(_rational(problem, order), key=lambda run: run[0])[:tried]
    forms = [beside([port_of(den, num)], problem.zero) for _, den, num in rational]
    runs = [(form, *minimise(misfit_of(form, problem), theta + slight * rng.normal(size=theta.size), steps))
            for form, theta in forms]
    form, theta, _ = min(runs, key=lambda run: run[2])
    return form, theta


def _rational(problem: Problem, order: int) -> Iterator[tuple[float, FloatArray, FloatArray]]:
    """Yield (misfit, den, num) of passive Q / P from Sanathanan-Koerner passes of two starts."""
    for first in (None, spread(problem.x, order)):
        runs = sanathanan_koerner(problem.x, problem.K[:, 0], problem.weight[:, 0], order, zero=problem.zero,
                                  first=first)
        for _, den, num in (runs[2], min(runs, key=lambda run: run[0])):
            passive = passive_numerator(den, num, problem.zero)
            yield problem.misfit(response_of(den, passive, problem.x)[:, None]), den, passive


def beside(parts: Sequence[tuple[FloatArray, FloatArray, FloatArray, FloatArray]], zero: bool) -> Start:
    """Return models (roots of D1, roots of D2, G, B1) side by side; `zero`: with the states that hold K(0) = 0."""
    e1, e2, W = (np.concatenate([part[k] for part in parts]) for k in (0, 1, 3))
    G = block_diag(*[part[2] for part in parts])
    lossless = min(W.shape[1], *G.shape) if zero else 0
    if lossless:
        rising = np.argsort(e2, kind="stable")
        e2, G = e2[rising], G[:, rising]
        W = np.linalg.lstsq(G[:, :lossless], W, rcond=1e-6)[0]
    form = Port(G.shape[0], G.shape[1], W.shape[1], lossless)
    return form, form.pack(e1, e2, G, W)


def grown(smaller: Start, more: int, top: float, rng: np.random.Generator, loose: float, second: bool = False) -> Start:
    """Return a model with `more` states more, resonances up to `top` coupled to the smaller one by `loose`.

    An odd state goes into the first half, or into the `second`.
    """
    small, theta = smaller
    e1, e2, G, W = small.unpack(theta)
    n1 = min(small.n1 + more, max(small.n1, (small.states + more + 1 - second) // 2))
    n2 = small.states + more - n1
    H = loose * top * rng.normal(size=(n1, n2))
    H[:small.n1, :small.n2] = G
    for k in range(min(n1 - small.n1, n2 - small.n2)):
        H[small.n1 + k, small.n2 + k] = top * np.exp(rng.uniform(np.log(0.08), np.log(0.9)))
    V = loose * rng.normal(size=(small.lossless or n1, small.m))
    V[:W.shape[0]] = W
    form = replace(small, n1=n1, n2=n2)
    return form, form.pack(np.r_[e1, np.full(n1 - small.n1, 0.5)], np.r_[e2, np.full(n2 - small.n2, 0.5)], H, V)
