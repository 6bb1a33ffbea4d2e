"""Many motions of one model at a time: other forces, parameters and starts for each member; NumPy or JAX."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import expm

from radiation_ss.arrays import FloatArray
from radiation_ss.body.convert import as_model
from radiation_ss.body.model import Model
from radiation_ss.effects import activated
from radiation_ss.effects.definition import vector_of
from radiation_ss.errors import InputError
from radiation_ss.methods import accepting
from radiation_ss.simulation.compiled import Compiled, run_instructions
from radiation_ss.simulation.equations import MotionEquations

Watched = tuple[Any, Any, Any]  # states, peaks of the displacements, sums of their squares; members as columns
Step = Callable[[Watched, Any, Any, Any, Any], Watched]
Shares = tuple[NDArray[np.int64], FloatArray, FloatArray]  # of `shares_of_samples`
Run = Callable[[FloatArray, FloatArray, FloatArray], Watched]


@dataclass(frozen=True, eq=False)
class EnsembleMotion:
    """What is kept of many motions: peak and rms (members, n) of the displacements [m or rad], infinite or NaN where a
    member grows without bounds, and the state at the last time (members, ns).
    """

    peak: FloatArray
    rms: FloatArray
    final: FloatArray


@accepting(model=as_model)
def simulate_ensemble(model: Model, time: ArrayLike, force: ArrayLike, effects: Iterable[Any] = (), *,
                      parameters: ArrayLike | None = None, start: ArrayLike | None = None, substeps: int = 1,
                      backend: str = "numpy", batch: int = 100_000) -> EnsembleMotion:
    """Simulate many members of a model with effects by the integrator of `simulate`, all at the same steps.

    Between its samples the force is a cubic spline. A device holds the force of one batch at a time.

    Parameters
    ----------
    time : array_like, shape (nt,)
        Uniform [s].
    force : array_like, shape (members, n, nt)
        Exciting force [N, N m]; or (n, nt), the same for all.
    effects : iterable
        As in `simulate`; effects of the waves, of sensors and delays are refused.
    parameters : array_like, shape (members, np), optional
        Numbers of the effects, one after another in the order of their definitions; those given with the effects if
        absent.
    start : array_like, shape (members, ns) or (ns,), optional
        States at the first time: radiation, displacements, velocities, effects' own; rest if absent.
    substeps : int
        Steps of the integrator to a sample.
    backend : str
        "numpy", or "jax": on the accelerator that JAX finds, in double precision (`pip install radiation_ss[jax]`).
    batch : int
        Members that are stepped at a time. JAX compiles once for all batches of one size.

    Raises
    ------
    InputError
        If a shape does not fit, times are not uniform, an effect cannot be stepped so, or the backend is unknown.
    """
    times, actives = np.asarray(time, dtype=float), activated(effects, model)
    steps = np.diff(times)
    if times.ndim != 1 or steps.size < 3 or steps.min() <= 0.0 or np.ptp(steps) > 1e-6 * steps[0]:
        raise InputError("time: at least four uniform, ascending times [s] are needed")
    h = float(times[-1] - times[0]) / steps.size / substeps
    for active in actives:
        if active.effect.needs in ("waves", "speed") or active.effect.sensor or active.effect.clock_in is not None:
            raise InputError(f"effect {active.label}: an ensemble takes neither waves, speed, sensors nor delays")
    equations = MotionEquations(model, actives)
    u = np.asarray(force, dtype=float)
    if u.ndim not in (2, 3) or u.shape[-2:] != (model.n, times.size):
        raise InputError(f"force: shape {u.shape} found, (members, {model.n}, {times.size}) needed")
    given = vector_of(actives)
    p = np.atleast_2d(given if parameters is None else np.asarray(parameters, dtype=float))
    s = np.atleast_2d(np.zeros(equations.ns) if start is None else np.asarray(start, dtype=float))
    for label, value, width in (("parameters", p, equations.np), ("start", s, equations.ns)):
        if value.ndim != 2 or value.shape[1] != width:
            raise InputError(f"{label}: shape {value.shape} found, (members, {width}) needed")
    u = u if u.ndim == 3 else u[None]
    members = max(len(p), len(s), len(u))
    for label, count in (("force", len(u)), ("parameters", len(p)), ("start", len(s))):
        if count not in (1, members):
            raise InputError(f"{label}: {count} members found, 1 or {members} needed")
    runs: dict[str, Callable[[Step, Shares, slice], Run]] = {"numpy": numpy_run, "jax": jax_run}
    if backend not in runs:
        raise InputError(f"backend: {backend!r} is unknown; use numpy or jax")
    if batch < 1:
        raise InputError(f"batch: {batch} members at a time; at least 1 is needed")
    moving = slice(model.fit.states, model.fit.states + model.n)
    step = lawson(Compiled(_beyond(equations)), expm(0.5 * h * equations.linear), h, equations.stepped, moving)
    run = runs[backend](step, shares_of_samples(times, substeps), moving)
    found = []
    for at in range(0, members, batch):
        state, forces, numbers = (values[at:at + batch] if len(values) > 1 else values for values in (s, u, p))
        found.append(run(np.broadcast_to(state.T, (equations.ns, min(batch, members - at))), forces, numbers.T))
    final, peak, square = (np.concatenate(parts, axis=1).T for parts in zip(*found))
    return EnsembleMotion(peak, np.sqrt(square / (substeps * (times.size - 1))), final)


def _beyond(equations: MotionEquations) -> ca.Function:
    """Return the rates of the stepped states beyond the linear model as a function of (s, u, t, p)."""
    n = equations.model.n
    s, u, t, p = ca.SX.sym("s", equations.ns), ca.SX.sym("u", n), ca.SX.sym("t"), ca.SX.sym("p", equations.np)
    added, rest, own = equations.rates(s, ca.horzcat(u, ca.SX.zeros(n), t * ca.SX.ones(n)), t, p)
    rates = ca.vertcat(ca.mtimes(added, s) + rest, own)
    return ca.Function("beyond", [s, u, t, p, ca.SX.sym("none", 0)], [ca.densify(rates)])


def lawson(rates: Compiled, half: FloatArray, h: float, rows: NDArray[np.int64], moving: slice) -> Step:
    """Return one step of Lawson's Runge-Kutta method for arrays (states, members) of any array library.

    From states, peaks and sums of squares to those one step later; drive and time are at its start, middle and end.
    `rows`: the states whose rates are not linear; `moving`: the displacements.
    """
    thin, unit = half[:, rows], np.eye(len(half))[:, rows]

    def step(before: Watched, drive: Any, time: Any, p: Any, xp: Any) -> Watched:
        def rate(point: Any, k: int) -> Any:
            found = run_instructions(rates, [*point, *drive[k], time[k], *p], xp)
            return xp.stack([xp.broadcast_to(row, point[0].shape) for row in found])

        state, peak, square = before
        middle = half @ state
        k1 = rate(state, 0)
        k2 = rate(middle + 0.5 * h * thin @ k1, 1)
        k3 = rate(middle + 0.5 * h * unit @ k2, 1)
        k4 = rate(half @ middle + h * thin @ k3, 2)
        after = half @ (middle + h / 6.0 * (thin @ k1)) + h / 3.0 * thin @ (k2 + k3) + h / 6.0 * unit @ k4
        return after, xp.maximum(peak, xp.abs(after[moving])), square + after[moving] ** 2

    return step


def shares_of_samples(time: FloatArray, substeps: int, width: int = 32) -> Shares:
    """Return what each step between uniform samples takes of a force: weights (steps, 3, width) on its samples from the
    first one of each step on give the cubic spline at start, middle and end, at the times (steps, 3).

    A sample's share in a spline falls by 2 + sqrt(3) from knot to knot: at half the width it is 1e-9.
    """
    width = min(width, time.size)
    at = (np.arange(substeps * (time.size - 1))[:, None] + np.array([0.0, 0.5, 1.0])) / substeps
    first = np.clip(at[:, 0].astype(int) + 1 - width // 2, 0, time.size - width)
    weights = CubicSpline(np.arange(width), np.eye(width))(at - first[:, None])
    return first, weights, time[0] + at * (time[-1] - time[0]) / (time.size - 1)


def numpy_run(step: Step, shares: Shares, moving: slice) -> Run:
    """Return what steps a batch of members from states (ns, members), forces (members, n, nt) and parameters."""
    def run(state: FloatArray, forces: FloatArray, p: FloatArray) -> Watched:
        samples, width = np.ascontiguousarray(forces.transpose(2, 1, 0)), shares[1].shape[2]
        watched = state, np.abs(state[moving]), np.zeros_like(state[moving])
        with np.errstate(all="ignore"):
            for first, weights, time in zip(*shares):
                watched = step(watched, np.tensordot(weights, samples[first:first + width], 1), time, p, np)
        return watched

    return run


def jax_run(step: Step, shares: Shares, moving: slice) -> Run:
    """Return what does the same by one compiled loop on JAX's default device."""
    try:
        import jax
    except ImportError:
        raise InputError("backend: jax is not installed; pip install radiation_ss[jax]") from None
    jnp, width = jax.numpy, shares[1].shape[2]

    @jax.jit
    def compiled(state: Any, forces: Any, p: Any) -> Watched:
        samples = forces.transpose(2, 1, 0)

        def one(watched: Watched, now: Any) -> tuple[Watched, None]:
            first, weights, time = now
            drive = jnp.tensordot(weights, jax.lax.dynamic_slice_in_dim(samples, first, width), 1)
            return step(watched, drive, time, p, jnp), None

        start = state, jnp.abs(state[moving]), jnp.zeros_like(state[moving])
        return jax.lax.scan(one, start, shares)[0]  # type: ignore[no-any-return]

    def run(*batch: FloatArray) -> Watched:
        with jax.enable_x64(True):
            return tuple(map(np.asarray, compiled(*map(jnp.asarray, batch))))  # type: ignore[return-value]

    return run
