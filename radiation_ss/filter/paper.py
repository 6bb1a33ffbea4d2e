"""The dual ensemble Kalman filter as the paper prints it (14)-(34).

Two ensembles take turns (section 3.2, Fig. 3): force i is corrected by the acceleration, through the equation of motion
at state i; then state and parameters of member i by displacement and velocity. Everything inside is in the paper's
units.
"""

from typing import NamedTuple

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.filter.kernels import (
    analyse,
    fill_gaussian,
    fill_three_point,
    moments,
    net_force,
    product,
    project,
    rk4,
    rk4_single,
    working_space,
)
from radiation_ss.filter.members import Members
from radiation_ss.filter.plan import MotionPlan, Outcome, SampleBlock, Units
from radiation_ss.filter.settings import FilterSettings
from radiation_ss.jit import jit


class Noise(NamedTuple):
    """Standard deviations at each step, of the system and of the observations."""

    theta: FloatArray         # (n_theta,)
    state: FloatArray         # (m + 2 n,)
    force: FloatArray         # (n,)
    motion: FloatArray        # (2 n + n_points,): displacement, velocity, pseudo-observations
    acceleration: FloatArray  # (n,)


class Ensembles(NamedTuple):
    """The two ensembles, moved in place; columns are members."""

    theta: FloatArray  # (n_theta, members)
    z: FloatArray      # (m + 3 n, members): radiation states, displacement, velocity; the force's ensemble


class Variant(NamedTuple):
    """What the paper leaves open, or what can be done in its place."""

    perturbed: bool    # perturbed observations (34); otherwise the square-root analysis
    force_first: bool  # the force's analysis before that of state and parameters, as section 3.2 has it
    three_point: bool  # three-point draws in place of Gaussian ones
    inflation: float   # factor on the spread of state and parameters after their analysis


class PaperEngine:
    """The paper's filter with its state; measures are those of `Units`, points from `prior.conditions`."""

    def __init__(self, plan: MotionPlan, drawn: Members, measures: tuple[FloatArray, float, float],
                 points: tuple[FloatArray, FloatArray, FloatArray], settings: FilterSettings,
                 seed: np.random.SeedSequence) -> None:
        self.units, self.n, self.unstable = Units(*measures), plan.n, drawn.unstable
        self.gain, self.plan = self.units.parameters(plan), self.units.plan(plan)
        self.generator, s = np.random.Generator(np.random.SFC64(seed)), settings
        self.counter = seed.generate_state(1, np.uint64)
        H, y, scale = points
        # Pseudo-observations H theta = y (25)-(27): in units of |K P| the two parts of a row are of order one.
        self.constraint = H * self.gain / scale[:, None], y / scale
        variances = (s.Q_theta, s.Q_state, s.Q_force, s.R, s.R)
        sizes = (self.gain.size, plan.m + 2 * plan.n, plan.n, 2 * plan.n + y.size, plan.n)
        self.noise = Noise(*(np.full(size, np.sqrt(variance)) for size, variance in zip(sizes, variances)))
        self.noise.theta[~drawn.theta.any(axis=1)] = 0.0        # a coefficient that is zero is no parameter: K(0) = 0
        self.variant = Variant(s.analysis == "stochastic", s.order == "force-first", s.draws == "three-point",
                               float(s.inflation))
        self.state = Ensembles(np.ascontiguousarray(drawn.theta / self.gain[:, None]),
                               np.zeros((plan.m + 3 * plan.n, drawn.theta.shape[1])))

    def advance(self, samples: SampleBlock) -> Outcome:
        """Take samples; known forces are not used."""
        units, out = self.units, Outcome.empty(samples.dts.size, self.n, self.gain.size)
        scaled = SampleBlock(np.ascontiguousarray(samples.y[:, :3 * self.n] / units.motion), samples.dts / units.time,
                         samples.steps)
        zero = (0.0,) * self.plan.m if self.n == len(self.plan.pairs) == 1 else None
        paper_loop((self.plan, self.noise, self.constraint, self.variant), zero, self.state,
                   (self.generator, self.counter), scaled, out)
        for part, unit in zip(out, (units.force, units.force, self.gain, self.gain)):
            part *= unit
        out.taken[:, :3 * self.n] = np.isfinite(scaled.y)
        return out

    def settle(self) -> tuple[FloatArray, FloatArray]:
        """Refuse: the paper takes no sample twice."""
        raise InputError("settle: only the default filter takes samples again; use preset=None")

    def members(self) -> FloatArray:
        """Return the ensemble of parameters."""
        return self.state.theta * self.gain[:, None]

    drawn = members

    def projected(self) -> tuple[FloatArray, dict[str, int]]:
        """Return the ensemble as it is: the paper repairs nothing after the start."""
        return self.members(), {"repaired": self.unstable}

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the state."""
        bits = self.generator.bit_generator.state["state"]["state"]
        return self.state._asdict() | {"generator": bits, "counter": self.counter}

    def restore(self, arrays: dict[str, np.ndarray]) -> None:
        """Take a state back."""
        self.state = Ensembles(*(np.ascontiguousarray(arrays[key]) for key in Ensembles._fields))
        bits, self.counter = self.generator.bit_generator, np.ascontiguousarray(arrays["counter"])
        bits.state = {**bits.state, "state": {"state": np.ascontiguousarray(arrays["generator"])}}


@jit
def paper_loop(rules, zero, ensembles, random, samples, out):  # type: ignore[no-untyped-def]
    """Run the paper's filter over samples (nt, 3 n); zero as `rk4_single` takes it, None for several subsystems."""
    (plan, noise, constraint, variant), (theta, z) = rules, ensembles
    n, m, members, n_theta = plan.inverse.shape[0], plan.m, theta.shape[1], theta.shape[0]
    base, p = m + 2 * n, noise.motion.size
    motion, force, system = z[:base], z[base:], n_theta + base + n
    draws = np.empty((system + (p + n if variant.perturbed else 0), members))
    flat, none = draws.reshape(-1), np.empty((0, 2, 2))
    buffers, net = np.empty((2, base, members)), np.empty((n, members))
    y, Y, D, gains = np.empty(p), np.empty((p, members)), np.empty((p, members)), np.empty(p + 1)
    work, space = (Y, D, np.empty((p, p)), np.empty((p, 2)), np.empty(p, dtype=np.int64)), working_space(m)
    for c in range(2 * n, p):  # a loop: an assignment of slices takes seconds to compile
        y[c] = constraint[1][c - 2 * n]
    for t in range(samples.y.shape[0]):
        if variant.three_point:
            fill_three_point(random[1], flat)
        else:
            fill_gaussian(random[0], flat)
        for _ in range(samples.steps[t]):
            dt = samples.dts[t] / samples.steps[t]
            if zero is None:  # only one of the two is compiled
                rk4(plan, none, theta, motion, force, dt, buffers, net)
            else:
                rk4_single(zero, plan, theta, motion, force, dt, space)
        shake(theta, 0, noise.theta, draws, 0)
        shake(z, 0, noise.state, draws, n_theta)
        shake(z, base, noise.force, draws, n_theta + base)
        for c in range(2 * n):
            y[c] = samples.y[t, c]
        for forces in (variant.force_first, not variant.force_first):
            if forces:  # force by acceleration
                net_force(plan, z, z, base, 1, net)
                for i in range(n):
                    project(plan.inverse, i, net, Y, i)
                seen, std, row = samples.y[t, 2 * n:], noise.acceleration, system + p
            else:       # state and parameters by displacement, velocity and points
                for c in range(2 * n):
                    for e in range(members):
                        Y[c, e] = z[m + c, e]
                for c in range(2 * n, p):
                    project(constraint[0], c - 2 * n, theta, Y, c)
                seen, std, row = y, noise.motion, system
            nis, used = innovate(seen, std, draws, row, variant, work)
            for part in range(1 if forces else 2):
                E, first, rows = (theta, 0, n_theta) if part else (z, base, n) if forces else (z, 0, base)
                analyse(E, first, rows, Y, D, used, gains)
                if not forces:
                    inflate(E, rows, variant.inflation)
            out.nis[t] += nis
        report(theta, 0, out.theta, out.theta_std, t)
        report(z, base, out.force, out.force_std, t)


@jit(inner=True)
def shake(E, first, std, draws, row):  # type: ignore[no-untyped-def]
    """Add noise of the given standard deviations to rows of E from `first` on, by rows of draws from `row` on."""
    for i in range(std.size):
        for e in range(E.shape[1]):
            E[first + i, e] += std[i] * draws[row + i, e]


@jit(inner=True)
def innovate(y, std, draws, row, variant, work):  # type: ignore[no-untyped-def]
    """Turn predictions Y of what is there of y into anomalies; find what the analysis multiplies them by, D.

    With S = cov(Y) + cov(noise) = L L' (31)-(33), D is S^-1 (y + w - Y), perturbations w by rows of draws from `row`
    on; of the square root S^-1 (y - mean Y) - L'^-1 (L + std)^-1 (Y - mean Y) (Whitaker and Hamill 2002, eq. 10).
    Return the squared normalised innovations and their number.
    """
    (Y, D, S, seen, place), members, p, nis = work, work[0].shape[1], 0, 0.0
    for c in range(y.size):
        if np.isfinite(y[c]):
            mean, spread = moments(Y, c, members)
            innovation = y[c] - mean
            place[p], seen[p, 0] = c, innovation
            nis += innovation**2 / (spread + std[c] ** 2)
            for e in range(members):
                Y[p, e] = Y[c, e] - mean
                D[p, e] = Y[p, e]
            p += 1
    for i in range(p):
        k, s, innovation, total = row + place[i], std[place[i]], seen[i, 0], 0.0
        if variant.perturbed:
            for e in range(members):
                D[i, e] = innovation + s * draws[k, e] - Y[i, e]
                total += draws[k, e]
            seen[i, 1] = total
        for j in range(i + 1):
            noise = members - 1.0 if i == j else 0.0
            if variant.perturbed:
                noise = product(draws, k, draws, row + place[j], members) - total * seen[j, 1] / members
            S[i, j] = (product(Y, i, Y, j, members) + s * std[place[j]] * noise) / (members - 1)
    factor(S, p)
    if not variant.perturbed:
        for i in range(p):
            for j in range(i):
                seen[i, 0] -= S[i, j] * seen[j, 0]
            seen[i, 0] /= S[i, i]
            S[i, i] += std[place[i]]
    divide(S, D, p, False)
    if not variant.perturbed:
        for i in range(p):
            S[i, i] -= std[place[i]]
            innovation = seen[i, 0]
            for e in range(members):
                D[i, e] = innovation - D[i, e]
    divide(S, D, p, True)
    return nis, p


@jit(inner=True)
def factor(S, p):  # type: ignore[no-untyped-def]
    """Write the Cholesky factor of the leading p x p block into its lower triangle."""
    for i in range(p):
        for j in range(i + 1):
            total = S[i, j]
            for k in range(j):
                total -= S[i, k] * S[j, k]
            S[i, j] = np.sqrt(total) if i == j else total / S[j, j]


@jit(inner=True)
def divide(L, D, p, transposed):  # type: ignore[no-untyped-def]
    """Write L^-1 D, or L'^-1 D if transposed, over the first p rows of D."""
    for step in range(p):
        i = p - 1 - step if transposed else step
        first, last = (i + 1, p) if transposed else (0, i)
        for k in range(first, last):
            share = L[k, i] if transposed else L[i, k]
            for e in range(D.shape[1]):
                D[i, e] -= share * D[k, e]
        scale = 1.0 / L[i, i]
        for e in range(D.shape[1]):
            D[i, e] *= scale


@jit(inner=True)
def inflate(E, rows, factor):  # type: ignore[no-untyped-def]
    """Multiply the spread of the first rows of E about their means by a factor."""
    for r in range(rows if factor != 1.0 else 0):
        mean = moments(E, r, E.shape[1])[0]
        for e in range(E.shape[1]):
            E[r, e] = mean + factor * (E[r, e] - mean)


@jit(inner=True)
def report(E, first, mean, std, t):  # type: ignore[no-untyped-def]
    """Write means and standard deviations of rows of E from `first` on."""
    for i in range(mean.shape[1]):
        middle, variance = moments(E, first + i, E.shape[1])
        mean[t, i], std[t, i] = middle, np.sqrt(variance)
