"""Many motions of one model at a time: other forces, parameters and starts for each member; NumPy or JAX."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
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
                      backend: str = "numpy") -> EnsembleMotion:
    """Simulate many members of a model with effects by the integrator of `simulate`, all at the same steps.

    Memory grows with members times samples: the force. Call it for one batch of members after another.

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
    members = max(len(p), len(s), len(u) if u.ndim == 3 else 1)
    fine = times[0] + 0.5 * h * np.arange(2 * substeps * (times.size - 1) + 1)
    drive = np.atleast_3d(np.moveaxis(CubicSpline(times, u, axis=-1)(fine), (-1, -2), (0, 1)))  # (halves, n, members)
    state = np.broadcast_to(s.T, (equations.ns, members))
    F = np.zeros((equations.ns, equations.ns))
    F[:equations.ns - equations.own, :equations.ns - equations.own] = model.matrices()[0]
    moving = slice(model.fit.states, model.fit.states + model.n)
    step = lawson(Compiled(_beyond(equations)), expm(0.5 * h * F), h, moving)
    run = {"numpy": run_numpy, "jax": run_jax}.get(backend)
    if run is None:
        raise InputError(f"backend: {backend!r} is unknown; use numpy or jax")
    moved = state[moving]
    final, peak, square = run(step, (np.array(state), np.abs(moved), np.zeros(moved.shape)), drive, fine, p.T)
    return EnsembleMotion(peak.T, np.sqrt(square.T / (substeps * (times.size - 1))), final.T)


def _beyond(equations: MotionEquations) -> ca.Function:
    """Return the rates beyond the linear model, velocities then own states, as a function of (s, u, t, p)."""
    n = equations.model.n
    s, u, t, p = ca.SX.sym("s", equations.ns), ca.SX.sym("u", n), ca.SX.sym("t"), ca.SX.sym("p", equations.np)
    added, rest, own = equations.rates(s, ca.horzcat(u, ca.SX.zeros(n), t * ca.SX.ones(n)), t, p)
    rates = ca.vertcat(ca.mtimes(added, s) + rest, own)
    return ca.Function("beyond", [s, u, t, p, ca.SX.sym("none", 0)], [ca.densify(rates)])


def lawson(rates: Compiled, half: FloatArray, h: float, moving: slice) -> Step:
    """Return one step of Lawson's Runge-Kutta method for arrays (states, members) of any array library.

    From states, peaks and sums of squares to those one step later; drive and time are at its start, middle and end.
    `moving`: the displacements among the states.
    """
    first = moving.stop
    thin = half[:, first:]

    def step(before: Watched, drive: Any, time: Any, p: Any, xp: Any) -> Watched:
        def rate(point: Any, k: int) -> Any:
            found = run_instructions(rates, [*point, *drive[k], time[k], *p], xp)
            return xp.stack([xp.broadcast_to(row, point[0].shape) for row in found])

        state, peak, square = before
        middle = half @ state
        k1 = rate(state, 0)
        k2 = rate(middle + 0.5 * h * thin @ k1, 1)
        plain = xp.concatenate([xp.zeros((first, k2.shape[1])), 0.5 * h * k2])
        k3 = rate(middle + plain, 1)
        k4 = rate(half @ middle + h * thin @ k3, 2)
        last = xp.concatenate([xp.zeros((first, k4.shape[1])), h / 6.0 * k4])
        after = half @ (middle + h / 6.0 * (thin @ k1)) + h / 3.0 * thin @ (k2 + k3) + last
        return after, xp.maximum(peak, xp.abs(after[moving])), square + after[moving] ** 2

    return step


def run_numpy(step: Step, start: Watched, drive: FloatArray, time: FloatArray, p: FloatArray) -> Watched:
    """Return final states, peaks and sums of squares of the displacements after each step."""
    with np.errstate(all="ignore"):
        for k in range(0, len(time) - 2, 2):
            start = step(start, drive[k:k + 3], time[k:k + 3], p, np)
    return start


def run_jax(step: Step, start: Watched, drive: FloatArray, time: FloatArray, p: FloatArray) -> Watched:
    """Return what `run_numpy` returns, by one compiled loop on JAX's default device."""
    try:
        import jax
    except ImportError:
        raise InputError("backend: jax is not installed; pip install radiation_ss[jax]") from None
    jnp = jax.numpy
    with jax.enable_x64(True):
        numbers = jnp.asarray(p)
        parts = [jnp.stack([jnp.asarray(values[k:len(time) - 2 + k:2]) for k in range(3)], axis=1)
                 for values in (drive, time)]
        found, _ = jax.jit(lambda carry, now: jax.lax.scan(
            lambda before, at: (step(before, at[0], at[1], numbers, jnp), None), carry, now))(
                tuple(map(jnp.asarray, start)), tuple(parts))
        return tuple(map(np.asarray, found))  # type: ignore[return-value]
