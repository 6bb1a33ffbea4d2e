"""The true body and its instruments with causes in place, and what it does in a test."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from hydro import kernel
from simulate import march

from tests import Setup, Test


@dataclass
class Truth:
    """What causes change. Lists hold functions of the test: effects of the integrator, forces on half steps."""

    setup: Setup
    M: np.ndarray
    C: np.ndarray
    D: np.ndarray
    K: np.ndarray
    effects: list = field(default_factory=list)
    outer: list = field(default_factory=list)
    by_speed: list = field(default_factory=list)  # D per m/s of speed
    gain: np.ndarray | None = None  # of the exciting force
    delay: np.ndarray | None = None
    most: float = np.inf  # of an actuator's force, as a part of what it is told at most
    read_gain: np.ndarray | None = None  # of the sensors, matrix
    read_delay: np.ndarray | None = None
    read_bias: np.ndarray | None = None
    clock: float = 0.0

    @classmethod
    def plain(cls, s: Setup, K: np.ndarray) -> Truth:
        """Return the true body without causes."""
        b, n = s.true, s.true.n
        return cls(s, b.M + b.A_inf, b.C.copy(), b.D.copy(), K, gain=np.ones(n), delay=np.zeros(n), read_gain=np.eye(n),
                   read_delay=np.zeros(n), read_bias=np.zeros(n))

    def lost(self, end: float) -> float:
        """Return how much of a record's end a clock or a delay leaves without data."""
        back = -min(0.0, self.read_delay.min(), self.delay.min())
        return back + max(0.0, end - end / (1 + self.clock))


def memory(s: Setup, body) -> np.ndarray:
    """Return the kernel of a body on half steps."""
    return kernel(body, s.h / 2, 14 * 2 * np.pi / np.median(body.omega))


def shifted(t: np.ndarray, y: np.ndarray, by: float) -> np.ndarray:
    """Return y(t - by)."""
    return np.interp(t - by, t, y)


def acting(truth: Truth, test: Test) -> np.ndarray:
    """Return the outer force on half steps."""
    F = test.force.copy()
    if test.kind == "forced":
        F = np.clip(F, -truth.most * abs(F).max(), truth.most * abs(F).max())
    for i in range(F.shape[1]):
        if truth.delay[i]:
            F[:, i] = shifted(test.half, F[:, i], truth.delay[i])
    F *= truth.gain
    for make in truth.outer:
        F += make(test)
    return F


def run(truth: Truth, test: Test) -> tuple:
    """Return t, x, v, a and the force it takes (prescribed), all as they are in truth."""
    n, N = truth.setup.true.n, test.steps
    made = [m(test) for m in truth.effects]
    kinds, dof = np.array([e.kind for e in made], np.int64), np.array([e.i for e in made], np.int64)
    par, long = np.zeros((len(made), 8)), max([len(e.curve) for e in made], default=2)
    series, curves = np.zeros((len(made), 2 * N + 1)), np.zeros((len(made), long))
    for k, e in enumerate(made):
        par[k, : len(e.p)] = e.p
        series[k] = 0.0 if e.series is None else e.series
        curves[k] = np.interp(np.linspace(0, 1, long), np.linspace(0, 1, len(e.curve)), e.curve)
    D = truth.D + sum(truth.by_speed) * (test.speed or 0.0) if truth.by_speed else truth.D
    x, v, a, E = (np.zeros((N + 1, n)) for _ in range(4))
    if test.guide:
        x[:], v[:], a[:] = test.guide
    march(test.h, N, test.x0.astype(float), test.v0.astype(float), truth.M, truth.C, D, truth.K, acting(truth, test),
          kinds, dof, par, series, curves, x, v, a, E, test.guide is not None)
    return np.arange(N + 1) * test.h, x, v, a, E


def read(truth: Truth, test: Test, moved: tuple) -> dict:
    """Return what the instruments say, without noise: displacement, velocity, acceleration, force of a prescribed test."""
    t, x, v, a, E = moved
    said = {}
    for name, y in (("x", x), ("v", v), ("a", a)):
        y = y @ truth.read_gain.T + (truth.read_bias if name == "x" else 0.0)
        for i in range(y.shape[1]):
            if truth.clock or truth.read_delay[i]:
                y[:, i] = np.interp(t * (1 + truth.clock) - truth.read_delay[i], t, y[:, i])
        said[name] = y
    said["f"] = E
    return said


def target(test: Test, said: dict) -> np.ndarray:
    """Return what a model has to predict in this test, after the part that is cut."""
    y = said["f"] if test.kind == "prescribed" else said["x"]
    return y[int(test.cut / test.h):]
