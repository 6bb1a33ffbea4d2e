"""Causes in what is measured: the exciting force, sensors, clocks, and the actuator; see causes.py."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from causes import Cause, named


def changes(name: str, ctx, dof: str, low: float, high: float, common: bool, put: Callable, unit: str) -> Cause:
    """Return a cause in the force's or the motion's measurement."""
    return Cause(name, dof, low, high, named(name, ctx, common), put, lambda s: {unit: float(s)})


def excitation_gain(ctx, rng):
    sign, common, i = rng.choice([-1, 1]), rng.random() < 0.7, ctx.dof(rng)
    which = np.arange(ctx.n) == i if not common else np.ones(ctx.n, bool)
    return changes("excitation_gain", ctx, "all" if common else ctx.dofs[i], 0.04, 0.5, common,
                   lambda truth, s: setattr(truth, "gain", truth.gain * (1 + sign * s * which)), "relative change")


def excitation_delay(ctx, rng):
    T, sign = ctx.T.min(), rng.choice([1, 1, -1])

    def put(truth, s):
        truth.delay = truth.delay + sign * s * T
    return changes("excitation_delay", ctx, "all", 0.008, 0.2, True, put, f"part of {sign * T:.4g} s")


def sensor_gain(ctx, rng):
    i, sign = ctx.dof(rng), rng.choice([-1, 1])

    def put(truth, s):
        truth.read_gain = np.diag(1 + sign * s * (np.arange(ctx.n) == i)) @ truth.read_gain
    return changes("sensor_gain", ctx, ctx.dofs[i], 0.04, 0.4, False, put, "relative change")


def sensor_delay(ctx, rng):
    i, T = ctx.dof(rng), ctx.T.min()
    return changes("sensor_delay", ctx, ctx.dofs[i], 0.008, 0.2, False,
                   lambda truth, s: setattr(truth, "read_delay", truth.read_delay + s * T * (np.arange(ctx.n) == i)),
                   f"part of {T:.4g} s")


def clock_offset(ctx, rng):
    T, sign = ctx.T.min(), rng.choice([-1, 1])
    return changes("clock_offset", ctx, "all", 0.008, 0.2, True,
                   lambda truth, s: setattr(truth, "read_delay", truth.read_delay + sign * s * T), f"part of {sign * T:.4g} s")


def clock_drift(ctx, rng):
    sign = rng.choice([-1, 1])
    return changes("clock_drift", ctx, "all", 2e-4, 5e-3, False, lambda truth, s: setattr(truth, "clock", sign * s), "rate")


def sensor_bias(ctx, rng):
    i, sign = ctx.dof(rng), rng.choice([-1, 1])

    def put(truth, s):
        truth.read_bias = truth.read_bias + sign * s * ctx.X[i] * (np.arange(ctx.n) == i)
    return changes("sensor_bias", ctx, ctx.dofs[i], 0.02, 0.6, False, put, f"part of {sign * ctx.X[i]:.4g}")


def cross_axis(ctx, rng):
    i, j = rng.choice(ctx.n, 2, replace=False)
    leak = np.zeros((ctx.n, ctx.n))
    leak[i, j] = ctx.X[i] / ctx.X[j] * rng.choice([-1, 1])

    def put(truth, s):
        truth.read_gain = truth.read_gain + s * leak
    return changes("cross_axis", ctx, ctx.dofs[i], 0.02, 0.35, False, put, f"part of {leak[i, j]:.4g} of {ctx.dofs[j]}")


def actuator_saturation(ctx, rng):
    return changes("actuator_saturation", ctx, "all", 0.05, 0.8, False,
                   lambda truth, s: setattr(truth, "most", 1 - s), "one minus limit over greatest command")
