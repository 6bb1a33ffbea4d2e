"""Causes that no library of effects is likely to hold; the only right answer is that something unknown acts."""

from __future__ import annotations

import numpy as np
import simulate as sim
from causes import Cause, Context, forceful, outer


def drawn(seed: int, test) -> np.random.Generator:
    """Return a generator that is the same whenever a test is simulated again."""
    return np.random.default_rng([seed, test.seed])


def passing_ship(ctx: Context, rng) -> Cause:
    """A ship passes: pressure and suction, one after the other, once or twice a record."""
    seed, wide = int(rng.integers(2**31)), rng.uniform(0.7, 2.5) * ctx.T.max()

    def shape(test):
        r, y = drawn(seed, test), 0.0
        for _ in range(r.integers(1, 3)):
            z = (test.half - r.uniform(0.2, 0.8) * test.span) / wide
            y = y + r.choice([-1, 1]) * z * np.exp(-(z**2) / 2) * 1.65
        return y
    return outer("a passing ship", ctx, ctx.dof(rng), 0.05, 2.0, shape, [], True)


def wind_gusts(ctx: Context, rng) -> Cause:
    """Gusts that come at random times, rise fast and die away."""
    seed, long = int(rng.integers(2**31)), rng.uniform(0.5, 2.0) * ctx.T.max()

    def shape(test):
        r, y = drawn(seed, test), np.zeros(len(test.half))
        for _ in range(r.poisson(test.span / (6 * long)) + 1):
            z = np.clip((test.half - r.uniform(0, 1) * test.span) / long, 0, None)
            y += r.gamma(2, 0.5) * z * np.exp(1 - z)
        return y
    return outer("wind gusts", ctx, ctx.dof(rng), 0.05, 2.0, shape, [], True)


def floes(ctx: Context, rng) -> Cause:
    """Blows of drifting ice or timber, short, at random times, of random size and sign."""
    seed, short = int(rng.integers(2**31)), rng.uniform(0.03, 0.1) * ctx.T.min()

    def shape(test):
        r, y = drawn(seed, test), np.zeros(len(test.half))
        for _ in range(r.poisson(test.span / (8 * ctx.T.min())) + 2):
            y += r.normal() * np.exp(-0.5 * ((test.half - r.uniform(0.05, 1) * test.span) / short) ** 2)
        return y
    return outer("blows of floating ice", ctx, ctx.dof(rng), 0.1, 12.0, shape, [], True)


def cargo_shift(ctx: Context, rng) -> Cause:
    """Something heavy slides to one side in the middle of a record, and back in another."""
    seed = int(rng.integers(2**31))

    def shape(test):
        r = drawn(seed, test)
        return np.tanh((test.half - r.uniform(0.3, 0.7) * test.span) / (0.2 * ctx.T.min())) * r.choice([-1, 1]) + r.normal() * 0.3
    return outer("cargo that shifts", ctx, ctx.dof(rng), 0.03, 0.6, shape, [], True)


def sticking_bearing(ctx: Context, rng) -> Cause:
    """A bearing that sticks now and then: dry friction, switched on and off at random."""
    i, seed, often = ctx.dof(rng), int(rng.integers(2**31)), rng.uniform(1, 3)
    unit, slow = ctx.k[i] * ctx.X[i], 0.03 * ctx.w[i] * ctx.X[i]

    def gate(test):
        r = drawn(seed, test)
        y, at, on = np.zeros(len(test.half)), 0.0, False
        while at < test.span:
            more = r.exponential(often * ctx.T[i] * (0.5 if on else 1.5))
            y[(test.half >= at) & (test.half < at + more)] = on
            at, on = at + more, not on
        return y
    return forceful(sim.COULOMB, "a bearing that sticks now and then", ctx, i, 0.02, 0.6, lambda s: (s * unit, slow),
                    ("force", "smooth"), gate, [], True)


def snag(ctx: Context, rng) -> Cause:
    """An umbilical that catches once in every record, holds like a spring from there, and comes free."""
    i, seed, length = ctx.dof(rng), int(rng.integers(2**31)), rng.uniform(1.0, 4.0)

    def gate(test):
        start = drawn(seed, test).uniform(0.1, 0.6) * test.span
        return ((test.half > start) & (test.half < start + length * ctx.T[i])).astype(float)
    return forceful(sim.SNAG, "an umbilical that snags", ctx, i, 0.1, 6.0, lambda s: (s * ctx.k[i], 20 * ctx.w[i]),
                    ("k", "follow"), gate, [], True)


def vortex(ctx: Context, rng) -> Cause:
    """Vortices shed by a current, a van der Pol wake that locks in (Facchinetti, de Langre & Biolley 2004)."""
    i, w = ctx.dof(rng), rng.uniform(0.8, 1.2)
    unit = ctx.k[i] * ctx.X[i] / 2
    return forceful(sim.WAKE, "vortex-induced motion in a current", ctx, i, 0.01, 0.6,
                    lambda s: (4.0 / ctx.X[i], w * ctx.w[i], s * unit), ("coupling", "shedding frequency", "force"), None, [], True)


OUTSIDE = [passing_ship, wind_gusts, floes, cargo_shift, sticking_bearing, snag, vortex]
