"""How a motion begins, from its record's first periods, and how long the integrator's steps may be."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from radiation_ss.arrays import FloatArray, couples, reached
from radiation_ss.body.model import Model
from radiation_ss.effects import Scales
from radiation_ss.effects.definition import Active, vector_of
from radiation_ss.effects.nominal import natural_frequency
from radiation_ss.errors import SolverError
from radiation_ss.fit.rational import frequency_response
from radiation_ss.records.columns import QUANTITIES
from radiation_ss.records.record import Record
from radiation_ss.records.signals import middle, spectrum_of
from radiation_ss.simulation.equations import MotionEquations
from radiation_ss.simulation.measured import mean_frequency, pace, power_of
from radiation_ss.simulation.prepared import Prepared, known_in_waves, wave_force
from radiation_ss.simulation.rollout import Rollout, reading


def start_of(model: Model, prepared: Prepared, states: int, directions: int = 3) -> FloatArray:
    """Return the Gaussian prior of a record's start: the state is basis @ q, q of unit variance, basis (states, k).

    Displacement and velocity are almost free, 10 times their typical size. The memory is what a motion of typical size
    and frequency can have left behind. Effects' own states, the last ones, start at rest: see `unrest_of`.
    """
    n, m = model.n, model.fit.states
    sizes = {i: motion_size(model, prepared, i) for i in seen_in(model, prepared)}
    columns = []
    for i, (size, omega_m) in sizes.items():
        if m:
            omega = omega_m * np.linspace(0.5, 1.5, 21)
            response = frequency_response(model.fit.a, model.fit.b[:, [i]], np.eye(m), omega)[:, :, 0]
            gram = (size * omega_m) ** 2 * np.real(np.einsum("wi,wj->ij", response, response.conj())) / omega.size
            values, vectors = eigh(gram)
            for k in np.argsort(values)[::-1][:directions]:
                if values[k] > 1e-8 * values[-1]:
                    columns.append(np.concatenate([vectors[:, k] * np.sqrt(values[k]), np.zeros(states - m)]))
    unit = np.eye(states)
    columns += [10.0 * size * omega_m**rows * unit[m + rows * n + i] for rows in (0, 1)
                for i, (size, omega_m) in sizes.items()]
    return np.stack(columns, axis=1)


def seen_in(model: Model, prepared: Prepared, least: float = 1e-4) -> list[int]:
    """Return the degrees of freedom that a record reads, and those coupled to them by `least` of both diagonals."""
    return reached(coupled(model, least), sorted({c.dof for c in prepared.channels})) or list(range(model.n))


def coupled(model: Model, least: float) -> NDArray[np.bool_]:
    """Return which motions a model couples by `least` of the geometric mean of both diagonals, (n, n)."""
    omega = np.array([natural_frequency(model, i) for i in range(model.n)])
    memory = np.abs(model.fit.frequency_response([*omega, *np.abs(np.linalg.eigvals(model.fit.a))])).max(axis=0)
    return couples(model.M + model.A_inf, ((memory, omega), (model.D, omega), (model.C, omega**2)), least)


def motion_size(model: Model, prepared: Prepared, dof: int) -> tuple[float, float]:
    """Return the root mean square displacement about its mean [m or rad] and a typical frequency [rad/s]."""
    omega = natural_frequency(model, dof)
    channel = next((c for c in prepared.channels if c.dof == dof), None)  # the displacement first
    if channel is None:
        return max(1e-12, *(float(np.std(c.value)) for c in prepared.channels)), omega
    order = QUANTITIES.index(channel.quantity)
    if order == 0 and channel.time.size >= 16:
        omega = mean_frequency(channel.time, channel.value, 0.05) or omega
    return max(float(np.std(channel.value)) / omega**order, 1e-12), omega


def fitted_start(rollout: Rollout, prepared: Prepared, drive: FloatArray, p: FloatArray,
                 near: FloatArray | None = None, accuracy: float = 1e-6) -> FloatArray:
    """Fit the start to the first periods of the record by damped Gauss-Newton with the prior of `start_of`.

    From rest, from rest in the first displacements that were read, or `near`, whichever is nearest: along a motion far
    from the true one the slopes of friction say nothing. It ends where a step gains less than the share `accuracy`.
    """
    basis = np.hstack([start_of(rollout.model, prepared, rollout.ns), *unrest_of(rollout, prepared).values()])
    head = head_of(rollout, prepared, p)
    given = rollout, head, drive[:head.grid.size], p, basis

    def cost(q: FloatArray) -> float:
        """Return the sum of squares; infinite where the motion grows without bounds."""
        try:
            return float(np.sum(missed(*given, q, slopes=False)[0] ** 2))
        except SolverError:
            return np.inf

    read, known, rest = np.zeros((3, rollout.ns))
    for channel in head.channels:
        if channel.quantity == "displacement":
            read[rollout.model.fit.states + channel.dof] = channel.value[0]
    if near is not None:
        known[:near.size] = near[:known.size]
    guesses = [np.asarray(np.linalg.lstsq(basis, state, rcond=None)[0], dtype=np.float64)
               for state in (read, known, rest) if state is not known or known.any()]
    costs = [cost(q) for q in guesses]
    q, now = guesses[int(np.argmin(costs))], min(costs)
    if not np.isfinite(now):
        raise SolverError("the motion grows without bounds from rest and from the displacements that were read first"
                          f"{rollout.why_unstable()}")
    for _ in range(12):
        off, slopes = missed(*given, q)
        if not np.isfinite(slopes).all():  # a law too steep for the steps: what there is is the start
            break
        move, before = np.linalg.lstsq(slopes, off, rcond=None)[0], now
        share, now = next(((share, left) for share in 0.5 ** np.arange(10.0)
                           if (left := cost(q + share * move)) < before), (0.0, before))
        q = q + share * move
        if before - now <= accuracy * now or np.abs(share * basis @ move).max() <= 1e-6 * np.abs(basis @ q).max():
            break
    return np.asarray(basis @ q)


def missed(rollout: Rollout, head: Prepared, drive: FloatArray, p: FloatArray, basis: FloatArray, q: FloatArray, *,
           slopes: bool = True) -> tuple[FloatArray, FloatArray]:
    """Return what the start basis @ q misses of the readings, in units of their size, and of its prior; derivatives."""
    none = np.zeros((rollout.np, q.size)) if slopes else None
    motion = rollout.run(basis @ q, drive, head.grid, p, columns=none, d_start=basis if slopes else None,
                         acceleration=any(c.quantity != "displacement" for c in head.channels))
    values, rows = [-1e-3 * q], [1e-3 * np.eye(q.size)]
    for channel in head.channels:
        value, slope = reading(rollout, motion, head.grid, channel, p, none)
        size = max(float(np.std(channel.value)), 1e-12)
        values.append((channel.value - value) / size)
        rows += [] if slope is None else [slope / size]
    return np.concatenate(values), np.concatenate(rows)


def head_of(rollout: Rollout, prepared: Prepared, p: FloatArray, periods: float = 1.5) -> Prepared:
    """Return the first natural periods of a prepared record, by its sensors' clocks.

    What a late sensor reads first was before the start, where a body that is under way is not simulated.
    """
    model, grid = rollout.model, prepared.grid
    slowest = min(natural_frequency(model, i) if model.C[i, i] > 0.0 else motion_size(model, prepared, i)[1]
                  for i in range(model.n))
    end = grid[0] + periods * 2.0 * np.pi / slowest
    nodes = max(3, min(int(np.ceil((end - grid[0]) / rollout.h)) + 2, grid.size))
    clocks = [(c, rollout.chain(c).clock(c.time, p)) for c in prepared.channels]
    seen = [(c, (at <= end) & ((at >= grid[0]) | (not c.under_way))) for c, at in clocks]
    channels = tuple(replace(c, time=c.time[there], value=c.value[there]) for c, there in seen if there.any())
    return replace(prepared, grid=grid[:nodes], channels=channels)


def unrest_of(rollout: Rollout, prepared: Prepared) -> dict[tuple[str, str, str], FloatArray]:
    """Return, by effect, the directions in which its own states may be off rest at the start, each (ns, states)."""
    model, at, found = rollout.model, rollout.ns - rollout.own, dict[tuple[str, str, str], FloatArray]()
    for active in rollout.actives:
        if active.effect.unrest is not None:
            i = model.dofs.index(active.dof) if active.dof else 0
            x, w = motion_size(model, prepared, i)
            force = max(model.C[i, i], (model.M + model.A_inf)[i, i] * w**2) * x
            length = float(prepared.grid[-1] - prepared.grid[0])
            sizes = active.effect.unrest(Scales(x, w * x, w**2 * x, 0.0, float(force), w, length))
            own = np.arange(at, at + len(sizes))
            found[active.name, active.dof, active.other] = np.eye(rollout.ns)[:, own] * sizes
        at += active.effect.states
    return found


def step_size(model: Model, records: Sequence[Record], actives: Sequence[Active] = ()) -> float:
    """Return an integrator step [s]: 0.45 rad of the fastest natural motion, 0.7 rad of the force's band edge.

    What an effect restores is not stepped exactly and takes 0.2 rad, of the records' motion where the model restores
    nothing. Effects also ask by their own rates in motions of the records' size; a kink is not followed below 1/64.
    """
    inertia = model.M + model.A_inf
    natural = edge = float(np.sqrt(max(np.linalg.eigvals(np.linalg.solve(inertia, model.C)).real.max(), 0.0)))
    for record in records:
        driven = record.get("force", model.dofs) is None and known_in_waves(model, record)
        waves = wave_force(model, record) if driven else ()
        edge = max([edge, *(band_edge(f.x, f(f.x)) for f in waves if np.any(f.c))])
        for i, dof in enumerate(model.dofs):
            natural = max(natural, (1.0 if model.C[i, i] > 0.0 else 2.25) * pace(model, record, i))
            values = record.channels.get(f"{dof}_force")
            if values is not None and np.isfinite(values).sum() > 8 and np.nanstd(values) > 0.0:
                edge = max(edge, band_edge(record.time, values))
    natural = natural or 0.45 / min((float(np.median(np.diff(r.time))) for r in records), default=1.0)
    whole = min(0.45 / natural, 0.7 / max(edge, 1e-12))
    if not actives:
        return whole
    rate = max(effect_rate(model, records, actives), 1e-12)
    return min(whole, 0.2 / rate if all(a.effect.linear for a in actives) else max(1.0 / rate, whole / 64))


def effect_rate(model: Model, records: Sequence[Record], actives: Sequence[Active]) -> float:
    """Return the largest eigenvalue [1/s] that effects bring in, at rest and at three times the records' rms; own
    states are 0, or 1 in motion, where hysteresis has its limit.
    """
    equations = MotionEquations(model, actives)
    m, n, ns = model.fit.states, model.n, equations.ns
    x, v = np.zeros(n), np.zeros(n)
    for record in records:
        for i, dof in enumerate(model.dofs):
            values = record.channels.get(dof)
            if values is not None and np.isfinite(values).sum() > 8 and np.nanstd(values) > 0.0:
                x[i] = max(x[i], 3.0 * np.nanstd(values))
                v[i] = max(v[i], 3.0 * np.nanstd(values) * middle(*spectrum_of(record, values)))
    p, drive = vector_of(actives), np.zeros((equations.drives, 3))
    found = 0.0
    for at_x, at_v in ((0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (1.0, 1.0)):
        point = np.concatenate([np.zeros(m), at_x * x, at_v * v, np.full(equations.own, at_v), np.zeros(n)])
        rows = np.asarray(equations.slope(point, drive, 0.0, p))[:, :ns]
        whole = np.zeros((ns, ns))
        whole[m:m + n, m + n:m + 2 * n], whole[equations.stepped] = np.eye(n), rows
        if np.isfinite(whole).all():
            found = max(found, float(np.abs(np.linalg.eigvals(whole)).max()))
    return found


def band_edge(time: FloatArray, values: FloatArray, share: float = 0.98) -> float:
    """Return the circular frequency below which a share of a signal's variance lies [rad/s]."""
    omega, power = power_of(time, values)
    return float(omega[np.searchsorted(np.cumsum(power), share * power.sum())])
