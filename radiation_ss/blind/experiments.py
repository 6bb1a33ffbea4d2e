"""The tests that a body is put through: what happens, and what the sensors write down."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.fft import next_fast_len

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.blind.bodies import Body
from radiation_ss.blind.causes import Hidden
from radiation_ss.blind.physics import integrate
from radiation_ss.records.record import Record

STEPS_PER_RADIAN = 50


@dataclass(frozen=True)
class Plan:
    """One test."""

    # name, kind: Kind as in Record
    name: str
    kind: str
    released: tuple[float, ...]  # Displacement at rest at time 0
    # height, peak: Significant height [m] and peak frequency [rad/s] of the sea; height 0 for a decay
    height: float
    peak: float
    seed: int  # Of the sea's phases
    # duration, cut: End [s] and the time at which the record begins
    duration: float
    cut: float = 0.0
    known: bool = True  # Whether the exciting force is recorded


@dataclass(frozen=True)
class Sensors:
    """How motion is recorded: rate [s], jitter (share of the step), noise (share of rms), channels, a drifting zero.

    The zero of a displacement sensor wanders by `drift` (share of rms) with a memory of `lasting` [s].
    """

    step: float
    jitter: float
    noise: float
    acceleration: bool
    missing: float
    drift: float = 0.0
    lasting: float = 1.0


@dataclass(frozen=True)
class Run:
    """What happened in a test, on the fine grid: motion as the sensors see it without noise, force, elevation."""

    time: FloatArray
    x: FloatArray
    v: FloatArray
    a: FloatArray
    force: FloatArray
    elevation: FloatArray


def sea(plan: Plan, body: Body, time: FloatArray, after: float = 4.0) -> tuple[FloatArray, FloatArray]:
    """Return elevation, shape (nt,), and exciting force of the body, shape (n, nt), of a JONSWAP sea that sets in.

    Waves grow over four peak periods. The force is X times the elevation at each frequency of the whole sea: waves that
    grow have side bands, for which X differs. The sea goes on for `after` peak periods after the test,
    since X sees a little ahead.
    """
    dt = float(time[1])
    ahead = int(after * 2.0 * np.pi / plan.peak / dt)
    a, ramped = components(plan.peak, plan.height, plan.seed, time.size + ahead, dt)
    elevation = (a @ ramped).real
    full = next_fast_len(2 * elevation.size, real=True)
    omega: FloatArray = np.asarray(2.0 * np.pi * np.fft.rfftfreq(full, dt))
    spectrum = np.asarray(np.fft.rfft(elevation, full))[:, None] * body.X(omega)
    return elevation[: time.size], np.fft.irfft(spectrum, full, axis=0)[: time.size].T


@lru_cache(maxsize=4)
def components(peak: float, height: float, seed: int, count: int, dt: float) -> tuple[ComplexArray, ComplexArray]:
    """Return complex amplitudes and the ramped exp(iwt) of a sea's components, shape (nw, nt)."""
    rng = np.random.default_rng(seed)
    time = np.arange(count) * dt
    omega = np.linspace(0.45, 2.6, 120) * peak
    width = np.where(omega <= peak, 0.07, 0.09)
    swell = 3.3 ** np.exp(-((omega / peak - 1.0) ** 2) / (2.0 * width**2))
    spectrum = omega**-5.0 * np.exp(-1.25 * (peak / omega) ** 4) * swell
    spectrum *= (height / 4.0) ** 2 / (spectrum.sum() * (omega[1] - omega[0]))
    size = np.sqrt(spectrum * (omega[1] - omega[0]))
    a = size * (rng.normal(size=omega.size) + 1j * rng.normal(size=omega.size))
    # Frequencies are moved off the even grid so that the sea does not repeat.
    omega = omega + rng.uniform(-0.5, 0.5, omega.size) * (omega[1] - omega[0])
    ramp = 0.5 - 0.5 * np.cos(np.pi * np.minimum(time / (4 * 2 * np.pi / peak), 1.0))
    return a, ramp * np.exp(1j * omega[:, None] * time)


def happen(body: Body, plan: Plan, hidden: Sequence[Hidden] = (), dt: float | None = None) -> Run:
    """Return what the body does in a test with its hidden causes at work; in steps dt [s], fine ones if not given."""
    dt = dt or 1.0 / (STEPS_PER_RADIAN * float(body.frequencies().max()))
    time = np.arange(0.0, plan.duration + dt, dt)
    body = with_linear(body, hidden)
    n = len(body.dofs)
    elevation, force = np.zeros(time.size), np.zeros((n, time.size))
    if plan.height > 0.0:
        elevation, force = sea(plan, body, time)
    for item in hidden:
        if item.cause == "excitation_delay":
            force[:] = [np.interp(time - item.strength * item.parameters[0], time, row) for row in force]
        if item.cause == "excitation_gain":
            force[item.dof] *= 1.0 + item.strength * item.parameters[0]
    laws = [law for item in hidden if (law := item.law()) is not None] or [(0, 0, (0.0,) * 5)]
    codes, places, parameters = (np.array([law[i] for law in laws]) for i in range(3))
    x, v, a = integrate(dt, body.kernel(dt), (body.M + body.A_inf, body.C), force, np.array(plan.released),
                        (codes, places, parameters))
    for item in hidden:
        x = sensed(time, x, item)
    return Run(time, x, v, a, force, elevation)


def with_linear(body: Body, hidden: Sequence[Hidden]) -> Body:
    """Return the body with the causes that change its own inertia or memory."""
    for item in hidden:
        size, here = item.strength * item.parameters[0], np.diag(np.eye(len(body.dofs))[item.dof])
        if item.cause == "added_inertia":
            body = replace(body, M=body.M + size * here)
        if item.cause == "coupling_inertia":
            body = replace(body, M=body.M + size * np.sqrt(body.M[0, 0] * body.M[1, 1]) * np.fliplr(np.eye(2)))
        if item.cause == "radiation_damping":
            body = replace(body, modes=tuple(replace(mode, R=mode.R * (1.0 + size * here)) for mode in body.modes))
    return body


def sensed(time: FloatArray, x: FloatArray, item: Hidden) -> FloatArray:
    """Return displacements as a faulty sensor of one degree of freedom reads them."""
    size, d = item.strength * item.parameters[0], item.dof
    x = x.copy()
    if item.cause == "sensor_gain":
        x[d] *= 1.0 + size
    elif item.cause == "sensor_bias":
        x[d] += size
    elif item.cause == "sensor_delay":
        x[d] = np.interp(time - size, time, x[d])
    elif item.cause == "clock_drift":
        x = np.stack([np.interp(time * (1.0 + size), time, row) for row in x])
    elif item.cause == "cross_axis":
        x[d] += size * x[1 - d]  # one crooked sensor, so one share in every test
    elif item.cause == "sensor_hold":
        # The reading sticks for `size` of a typical period, again and again.
        hold = max(size * time[-1] / 20.0, 1e-9)
        x[d] = np.interp(np.floor(time / hold) * hold, time, x[d])
    return x


def write_down(run: Run, plan: Plan, nominal: Body, sensors: Sensors, rng: np.random.Generator) -> Record:
    """Return the record of a test: sampled, noisy, with the force that the nominal model makes of the same waves."""
    time = np.arange(plan.cut, plan.duration, sensors.step)
    if sensors.jitter:
        time = time + np.concatenate([[0.0], rng.uniform(-0.5, 0.5, time.size - 1) * sensors.jitter * sensors.step])
        time = time[time <= run.time[-1]]

    def sample(values: FloatArray, noise: float) -> FloatArray:
        clean = np.interp(time, run.time, values)
        return clean + noise * np.sqrt(np.mean(clean**2)) * rng.normal(size=time.size)

    channels = {}
    recorded = sea(plan, nominal, run.time)[1] if plan.height > 0.0 else run.force
    for i, dof in enumerate(nominal.dofs):
        values = sample(run.x[i], sensors.noise)
        if sensors.drift:
            values = values + sensors.drift * np.std(run.x[i]) * wandering(time / sensors.lasting, rng)
        if sensors.missing:
            values[rng.random(time.size) < sensors.missing] = np.nan
        channels[dof] = values
        if sensors.acceleration:
            channels[f"{dof}_acceleration"] = sample(run.a[i], 2.0 * sensors.noise)
        if plan.known:
            channels[f"{dof}_force"] = sample(recorded[i], 0.003)
    if plan.kind == "waves" and not plan.known:
        channels["wave_elevation"] = sample(run.elevation, 0.005)
    return Record(time, channels, kind=plan.kind, name=plan.name)


def wandering(time: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return a stationary first-order process of unit variance and unit memory (Ornstein and Uhlenbeck)."""
    memory = np.exp(-np.diff(time))
    values = rng.normal(size=time.size)
    for k, m in enumerate(memory, 1):
        values[k] = m * values[k - 1] + np.sqrt(1.0 - m**2) * values[k]
    return values


def plans(kind: str, body: Body, rng: np.random.Generator) -> tuple[list[Plan], Plan]:
    """Return the tests of a set of records, and one more of the same sort that stays unseen."""
    if len(body.dofs) == 6:
        return six_plans(body, rng)
    omega = float(body.frequencies().max())
    period = 2 * np.pi / omega
    light = "Roll" in body.dofs
    numbers = {"decays": (3, 0), "decays+waves": (2, 2), "waves": (0, 3), "elevation": (0, 3), "motion-only": (0, 3)}
    decays, seas = numbers[kind]
    base = rng.uniform(0.12, 0.25) if light else rng.uniform(0.2, 0.35) * body.size

    def decay(index: int, share: float) -> Plan:
        released = np.zeros(len(body.dofs))
        released[-1] = base * share * rng.choice([-1.0, 1.0])
        if len(body.dofs) == 2:
            released[0] = rng.uniform(0.2, 0.5) * body.size * share * rng.choice([-1.0, 1.0])
        return Plan(f"decay{index}", "decay", tuple(released), 0.0, omega, 0, period * (16 if light else 10))

    def storm(index: int, share: float) -> Plan:
        peak = omega * rng.uniform(0.75, 1.1)
        height = share * rng.uniform(0.10, 0.25) * body.size * (0.5 if light else 1.0)
        cut = rng.choice([0.0, 10.0]) * period
        what = "motion-only" if kind == "motion-only" else "waves"
        return Plan(f"sea{index}", what, (0.0,) * len(body.dofs), height, peak, int(rng.integers(2**31)),
                    cut + 22 * period, cut, kind in ("waves", "decays+waves"))

    shares = rng.permutation([0.4, 0.7, 1.0])
    seen = [decay(i, shares[i % 3]) for i in range(decays)] + [storm(i, shares[(i + decays) % 3]) for i in range(seas)]
    return seen, (decay(9, 0.85) if kind == "decays" else storm(9, 0.85))


def six_plans(body: Body, rng: np.random.Generator) -> tuple[list[Plan], Plan]:
    """Return a release of each motion that something restores, two seas, and one more sea that stays unseen."""
    omega = body.frequencies()
    fastest = float(omega.max())
    amplitudes = np.array([0.5, 0.5, 0.25, 0.0, 0.0, 0.0]) * body.size + np.array([0.0, 0.0, 0.0, 0.15, 0.08, 0.15])
    tests = []
    for i in np.flatnonzero(omega):
        released = np.zeros(6)
        released[i] = amplitudes[i] * rng.uniform(0.7, 1.0) * rng.choice([-1.0, 1.0])
        tests.append(Plan(f"decay{i}", "decay", tuple(released), 0.0, fastest, 0, 8 * 2 * np.pi / float(omega[i])))
    seas = [Plan(f"sea{k}", "waves", (0.0,) * 6, rng.uniform(0.15, 0.3) * body.size, fastest * rng.uniform(0.7, 0.95),
                 int(rng.integers(2**31)), 30 * 2 * np.pi / fastest) for k in (1, 2, 9)]
    return [*tests, *seas[:2]], seas[2]
