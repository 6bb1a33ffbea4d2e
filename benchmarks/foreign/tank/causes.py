"""The catalogue of causes: what each does to the truth at a strength, where it can be seen, and the names that are right.

A cause is drawn by a function (ctx, rng) -> Cause; `put(truth, s)` puts it in with strength s between `low` and `high`, a
number made so that 1 is a force or motion as large as the linear one. `tell(s)` gives the parameters in SI for the label.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import simulate as sim
from simulate import Effect

from tests import Setup

WATER = ("Surge", "Sway", "Heave")
GAIN, DELAY, BIAS = ["sensor_gain", "excitation_gain"], ["sensor_delay", "excitation_delay", "clock_offset"], [
    "constant_force", "sensor_bias"]
DRAGS = ["quadratic_drag", "morison_drag", "crossflow_drag"]
SAME = {"hysteresis": ["hysteresis", "bouc_wen"], "parametric_stiffness": ["parametric_stiffness", "wave_stiffness"]}


@dataclass
class Cause:
    """A drawn cause."""

    name: str
    dof: str
    low: float
    high: float
    accept: list
    put: Callable
    tell: Callable
    outside: bool = False


@dataclass
class Context:
    """Where a cause is to act: set-up, kinds of tests and columns in the seen records, elevation's standard deviation."""

    setup: Setup
    kinds: set
    columns: set
    speeds: int
    wave: float
    longest: float
    irregular: bool

    def __post_init__(self) -> None:
        b = self.setup.true
        self.n, self.dofs, self.X, self.w = b.n, b.dofs, self.setup.lively, self.setup.natural
        self.k, self.T = np.diag(b.C), 2 * np.pi / self.w
        self.m = self.k / self.w**2

    def dof(self, rng, among: tuple | None = None) -> int:
        return int(rng.choice([i for i, d in enumerate(self.dofs) if among is None or d in among]))


def named(name: str, ctx: Context, common: bool = False) -> list:
    """Return a name and the ones that mean the same; of one degree of freedom (or all) also the common ones."""
    names = next((list(g) for g in (GAIN, DELAY, BIAS, DRAGS) if name in g), SAME.get(name, [name]))
    return names + [f"common_{c}" for c in names] if (ctx.n == 1 or common) and names[0] in (GAIN[0], DELAY[0]) else names


def forceful(kind: int, name: str, ctx: Context, i: int, low: float, high: float, p: Callable, words: tuple,
             series: Callable | None = None, accept: list | None = None, outside: bool = False, curve=None) -> Cause:
    """Return a cause that is an effect of the integrator with parameters p(s)."""
    def put(truth, s):
        truth.effects.append(lambda test: Effect(kind, i, p(s), None if series is None else series(test),
                                                 np.zeros(2) if curve is None else curve))
    return Cause(name, ctx.dofs[i], low, high, named(name, ctx) if accept is None else accept, put,
                 lambda s: dict(zip(words, map(float, p(s)))), outside)


def matrix(name: str, ctx: Context, which: str, i: int, j: int, low: float, high: float, unit: float,
           accept: list | None = None) -> Cause:
    """Return a cause that adds s * unit to a matrix, on both sides of the diagonal."""
    def put(truth, s):
        change = np.zeros((ctx.n, ctx.n))
        change[i, j] = change[j, i] = s * unit
        setattr(truth, which, getattr(truth, which) + change)
    return Cause(name, ctx.dofs[i], low, high, named(name, ctx) if accept is None else accept, put,
                 lambda s: {which: float(s * unit)})


def outer(name: str, ctx: Context, i: int, low: float, high: float, shape: Callable, accept: list,
          outside: bool = False) -> Cause:
    """Return a cause that is a force s * k X * shape(test) from outside."""
    unit = ctx.k[i] * ctx.X[i]

    def put(truth, s):
        def force(test):
            F = np.zeros_like(test.force)
            F[:, i] = s * unit * shape(test)
            return F
        truth.outer.append(force)
    return Cause(name, ctx.dofs[i], low, high, accept, put, lambda s: {"force": float(s * unit)}, outside)


def quadratic_drag(ctx, rng):
    i = ctx.dof(rng)
    unit = 2 * ctx.k[i] / ctx.w[i] / (0.85 * ctx.w[i] * ctx.X[i])  # equivalent damping ratio s (energy over a cycle)
    return forceful(sim.DRAG, "quadratic_drag", ctx, i, 0.003, 1.0, lambda s: (s * unit,), ("c",))


def morison_drag(ctx, rng):
    i = ctx.dof(rng, WATER)
    unit = 2 * ctx.k[i] / ctx.w[i] / (0.85 * ctx.w[i] * ctx.X[i])
    return forceful(sim.DRAG, "morison_drag", ctx, i, 0.003, 1.0, lambda s: (s * unit,), ("c",), lambda t: t.water[:, i])


def crossflow_drag(ctx, rng):
    i, j = ctx.dofs.index("Heave"), ctx.dofs.index("Pitch")
    length = 6 * ctx.setup.true.size
    unit = 2 * ctx.k[i] / ctx.w[i] / (0.85 * ctx.w[i] * ctx.X[i]) / length
    return forceful(sim.STRIPS, "crossflow_drag", ctx, i, 0.003, 1.0, lambda s: (s * unit, length, j),
                    ("c per length", "length", "pitch"))


def linear_damping(ctx, rng):
    i = ctx.dof(rng)
    return matrix("linear_damping", ctx, "D", i, i, 0.003, 0.6, 2 * ctx.k[i] / ctx.w[i], ["linear_damping", "viscous_memory"])


def relative_damping(ctx, rng):
    i = ctx.dof(rng, WATER)
    cause = matrix("relative_damping", ctx, "D", i, i, 0.003, 0.6, 2 * ctx.k[i] / ctx.w[i])
    own = cause.put

    def put(truth, s):
        own(truth, s)
        unit = np.eye(ctx.n)[i] * s * 2 * ctx.k[i] / ctx.w[i]
        truth.outer.append(lambda test: np.outer(test.water[:, i], unit))
    cause.put = put
    return cause


def viscous_memory(ctx, rng):
    i = ctx.dof(rng)
    unit = 2 * ctx.k[i] / ctx.w[i] / ctx.w[i] ** 0.5  # Basset (1888)
    return forceful(sim.BASSET, "viscous_memory", ctx, i, 0.005, 0.5, lambda s: (s * unit,), ("c",),
                    accept=["viscous_memory", "linear_damping"])


def lift_damping(ctx, rng):
    i = ctx.dof(rng, ("Roll", "Heave", "Pitch"))
    unit = 2 * ctx.k[i] / ctx.w[i] / np.sqrt(9.81 * ctx.setup.true.size)  # Ikeda, Himeno & Tanaka (1978): linear in U
    change = np.zeros((ctx.n, ctx.n))
    change[i, i] = unit
    return Cause("lift_damping", ctx.dofs[i], 0.005, 0.6, ["lift_damping"], lambda truth, s: truth.by_speed.append(s * change),
                 lambda s: {"D per speed": float(s * unit)})


def coulomb_friction(ctx, rng):
    i = ctx.dof(rng)
    unit, slow = ctx.k[i] * ctx.X[i], 0.01 * ctx.w[i] * ctx.X[i]
    return forceful(sim.COULOMB, "coulomb_friction", ctx, i, 0.002, 0.25, lambda s: (s * unit, slow), ("force", "smooth"),
                    lambda t: np.ones(2 * t.steps + 1))


def hysteresis(ctx, rng):
    i = ctx.dof(rng)
    unit, give, sharp = ctx.k[i] * ctx.X[i], rng.uniform(0.1, 0.4) * ctx.X[i], rng.uniform(1, 3)
    return forceful(sim.BOUC_WEN, "hysteresis", ctx, i, 0.005, 0.3, lambda s: (s * unit, give, sharp),
                    ("force", "yield", "exponent"))


def linear_stiffness(ctx, rng):
    i = ctx.dof(rng)
    accept = ["linear_stiffness", "added_inertia"] if ctx.kinds == {"decay"} and ctx.n == 1 else None
    return matrix("linear_stiffness", ctx, "C", i, i, 0.02, 0.5, ctx.k[i] * (1 if rng.random() < 0.8 else -0.5), accept)


def added_inertia(ctx, rng):
    i = ctx.dof(rng)
    accept = ["linear_stiffness", "added_inertia"] if ctx.kinds == {"decay"} and ctx.n == 1 else None
    return matrix("added_inertia", ctx, "M", i, i, 0.02, 0.5, ctx.m[i], accept)


def coupling_inertia(ctx, rng):
    i, j = rng.choice(ctx.n, 2, replace=False)
    return matrix("coupling_inertia", ctx, "M", i, j, 0.02, 0.35, np.sqrt(ctx.m[i] * ctx.m[j]) * rng.choice([-1, 1]))


def cubic_stiffness(ctx, rng):
    i = ctx.dof(rng)
    unit = ctx.k[i] / ctx.X[i] ** 2 * (1 if rng.random() < 0.75 else -0.35)
    return forceful(sim.POLYNOMIAL, "cubic_stiffness", ctx, i, 0.03, 1.2, lambda s: (0.0, s * unit), ("k2", "k3"))


def quadratic_stiffness(ctx, rng):
    i = ctx.dof(rng)
    unit = ctx.k[i] / ctx.X[i] * rng.choice([-1, 1])
    return forceful(sim.POLYNOMIAL, "quadratic_stiffness", ctx, i, 0.03, 0.5, lambda s: (s * unit, 0.0), ("k2", "k3"))


def slack_mooring(ctx, rng):
    i, side = ctx.dof(rng), rng.choice([-1, 1])
    slack = rng.uniform(-0.1, 0.4) * ctx.X[i]
    accept = ["slack_mooring"] + ["end_stop"] * int(slack > 0.1 * ctx.X[i])  # a spring behind a gap
    return forceful(sim.STOP, "slack_mooring", ctx, i, 0.04, 3.0, lambda s: (s * ctx.k[i], slack, 0.0, side),
                    ("k", "slack", "damper", "side"), accept=accept)


def end_stop(ctx, rng):
    i, stiff = ctx.dof(rng), rng.uniform(2, 8)
    damper = rng.choice([0.0, 0.1]) * stiff * ctx.k[i] / ctx.w[i]
    return forceful(sim.STOP, "end_stop", ctx, i, 0.1, 1.05, lambda s: (stiff * ctx.k[i], (1.15 - s) * ctx.X[i], damper, 2),
                    ("k", "gap", "damper", "sides"))


def mooring_lines(ctx, rng):
    i = ctx.dof(rng, ("Surge", "Sway"))
    reach = 4 * ctx.X[i]
    deep = rng.uniform(1.5, 6) * ctx.X[i]
    tight = rng.uniform(0.5, 3)
    H = deep * np.geomspace(1e-3, 1e4, 4000)  # per weight; suspended catenary with the rest on the sea bed (Faltinsen 1990)
    far = -deep * np.sqrt(1 + 2 * H / deep) + H * np.arccosh(1 + deep / H)
    x = np.linspace(-reach, reach, 801) + np.interp(tight * deep, H, far)
    pull = np.interp(x, far, H)
    net = pull - pull[::-1] if rng.random() < 0.6 else pull - pull[400]
    net /= max(abs(net[200]), abs(net[600])) / 2
    fits = dict(linear_stiffness=1, quadratic_stiffness=2, cubic_stiffness=3)
    near, xn = net[300:501], np.linspace(-1, 1, 201)
    good = [n for n, q in fits.items()
            if 1 - np.sum((near - xn**q * (xn**q @ near) / (xn**q @ xn**q)) ** 2) / np.sum(near**2) > 0.97]
    return forceful(sim.TABLE, "mooring_lines", ctx, i, 0.02, 1.0, lambda s: (-reach, reach, s * ctx.k[i] * ctx.X[i]),
                    ("from", "to", "force at 2 X is 2 times"), accept=["mooring_lines", *good], curve=net)


def parametric_stiffness(ctx, rng):
    i = ctx.dof(rng)
    return forceful(sim.PARAMETRIC, "parametric_stiffness", ctx, i, 0.03, 0.7,
                    lambda s: (s * ctx.k[i] / (2 * ctx.wave),), ("k per metre",), lambda t: t.eta)


def radiation_damping(ctx, rng):
    sign, form = rng.choice([1, 1, -0.45]), rng.choice(["scaled", "scaled", "slower"])

    def put(truth, s):
        if form == "scaled":
            truth.K = truth.K * (1 + sign * s)
        else:
            at, now = np.arange(len(truth.K)), np.arange(int(len(truth.K) * (1 + 0.5 * s)))
            truth.K = np.stack([np.interp(now / (1 + 0.5 * s), at, c) for c in truth.K.reshape(len(at), -1).T],
                               axis=-1).reshape(len(now), ctx.n, ctx.n)
    return Cause("radiation_damping", ctx.dofs[0] if ctx.n == 1 else "all", 0.06, 1.8, ["radiation_damping"], put,
                 lambda s: {form: float(1 + sign * s if form == "scaled" else 1 + 0.5 * s)})


def tank_resonance(ctx, rng):
    i = ctx.dof(rng)
    w, zeta = ctx.w[i] * rng.uniform(0.8, 1.3), rng.uniform(0.008, 0.05)
    cause = forceful(sim.TANK, "tank_resonance", ctx, i, 0.003, 0.15, lambda s: (s * ctx.m[i], w, zeta),
                     ("mass", "frequency", "damping ratio"))
    own = cause.put

    def put(truth, s):
        own(truth, s)
        truth.M = truth.M.copy()
        truth.M[i, i] -= s * ctx.m[i]  # the nominal model has it frozen in
    cause.put = put
    return cause


def delayed_feedback(ctx, rng):
    i, late = ctx.dof(rng), rng.uniform(0.1, 0.35)
    speed = rng.random() < 0.5

    def p(s):
        return (0.0, s * ctx.k[i] / ctx.w[i], late * ctx.T[i]) if speed else (s * ctx.k[i], 0.0, late * ctx.T[i])
    return forceful(sim.FEEDBACK, "delayed_feedback", ctx, i, 0.01, 0.35, p, ("gain x", "gain v", "delay"))


def water_on_deck(ctx, rng):
    i = ctx.dofs.index("Heave")
    board, drain = rng.uniform(0.3, 0.9) * 2 * ctx.wave, rng.uniform(0.4, 2.0) * ctx.T[i]
    unit = ctx.k[i] * ctx.X[i] / ctx.T[i] / (2 * ctx.wave) ** 1.5
    return forceful(sim.DECK, "water_on_deck", ctx, i, 0.03, 6.0, lambda s: (s * unit, board, drain, 1.0),
                    ("weight inflow", "freeboard", "drain", "one"), lambda t: t.eta)


def slamming(ctx, rng):
    i = ctx.dofs.index("Heave")
    high = rng.uniform(0.3, 0.8) * 2 * ctx.wave
    unit = ctx.k[i] * ctx.X[i] / (ctx.w[i] * 2 * ctx.wave) ** 2
    return forceful(sim.SLAM, "slamming", ctx, i, 0.05, 8.0, lambda s: (s * unit, high), ("c", "height"), lambda t: t.eta)


def constant_force(ctx, rng):
    sign = rng.choice([-1, 1])
    return outer("constant_force", ctx, ctx.dof(rng), 0.02, 0.6, lambda t: sign, BIAS)


def noise_of(rng, t, periods: float) -> np.ndarray:
    """Return slow noise of unit standard deviation: sines about a period, on half steps."""
    w = 2 * np.pi / (periods * rng.uniform(0.6, 2.5, 12))
    y = np.cos(np.outer(t.half, w) + 2 * np.pi * rng.random(12)).sum(axis=1)
    return y / 6**0.5


def slow_drift(ctx, rng):
    i, seed = ctx.dof(rng), int(rng.integers(2**31))
    period = max(rng.uniform(0.08, 0.25) * ctx.longest, 5 * ctx.T[i])

    def shape(t):
        return noise_of(np.random.default_rng([seed, t.seed]), t, period)
    return outer("slow_drift", ctx, i, 0.02, 0.8, shape, ["slow_drift"])


def wave_drift(ctx, rng):
    i = ctx.dof(rng)  # Newman (1974), transfer function constant: force with the square of the envelope
    return outer("wave_drift", ctx, i, 0.02, 1.0, lambda t: t.envelope**2 / (2 * ctx.wave**2), ["wave_drift", "slow_drift"])
