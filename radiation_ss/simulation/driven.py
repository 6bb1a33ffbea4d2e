"""Tests whose motion or load the rig sets: the force that a given motion takes, and the place where a load holds."""

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import BSpline, CubicSpline, make_interp_spline

from radiation_ss.arrays import FloatArray
from radiation_ss.body.convert import as_model
from radiation_ss.body.model import Model
from radiation_ss.effects import Active, activated
from radiation_ss.effects.definition import vector_of
from radiation_ss.errors import InputError, SolverError
from radiation_ss.hydro.data import signal
from radiation_ss.methods import accepting
from radiation_ss.records.convert import as_one_record
from radiation_ss.records.record import Record
from radiation_ss.records.signals import middle, spectrum_of
from radiation_ss.simulation.compiled import Compiled
from radiation_ss.simulation.equations import MotionEquations
from radiation_ss.simulation.linear import exact_step, propagate
from radiation_ss.simulation.prepared import known_in_waves, laid_out, wave_force, wave_motion, without_fast

if TYPE_CHECKING:
    import control as ct

Spline = Callable[..., FloatArray]  # of time and order of the derivative


@accepting(model=as_model, record=as_one_record)
def prescribed_force(model: Model, record: Record, effects: Iterable[Any] = (), *,
                     band: float = 6.0) -> "ct.TimeResponseData":
    """Return the force that moves the body as a record says: the load cell's reading of a forced-motion test.

    It is (M + A_inf) x'' + D x' + radiation + C x, less what effects and waves exert: the equation of motion's force,
    of the sign of an exciting force. A body that moves as the record begins is taken to have moved before as in its
    first period, harmonically; one at rest has been at rest. Within half a period of the highest frequency kept of both
    ends the acceleration, and so the force, is off by tenths.

    Parameters
    ----------
    model : Model, control.StateSpace or path
    record : Record
        With the displacement of at least one degree of freedom; the others stand still. A wave_elevation exerts the
        exciting force X.
    effects : iterable
        As in `simulate`; without faults of sensors and of the load cell: what is returned is the true force of x.
    band : float
        Highest frequency of the motion that is kept, in multiples of its median one: a displacement sensor's noise
        grows with the square of frequency in the acceleration.

    Returns
    -------
    control.TimeResponseData
        Outputs `<dof>_force` [N, N m], inputs `<dof>` [m, rad].

    Raises
    ------
    InputError
        If no displacement of the model's degrees of freedom is measured.

    Examples
    --------
    >>> import numpy as np, radiation_ss as rss
    >>> rigid = rss.RadiationFit(("Heave",), np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 0)
    >>> model, t = rss.Model(("Heave",), [[2.0]], [[1.0]], [[50.0]], rigid), np.arange(0.0, 20.0, 0.02)
    >>> test = rss.Record(t, {"Heave": 0.1 * np.sin(2.0 * t)}, kind="prescribed")
    >>> force = np.ravel(prescribed_force(model, test).outputs)
    >>> round(float(np.ptp(force[300:700]) / 2), 2)  # 0.1 (50 - 3 * 2^2)
    3.8
    """
    import control as ct

    have = [dof for dof in model.dofs if dof in record.channels and np.isfinite(record.channels[dof]).sum() >= 4]
    if not have:
        raise InputError(f"record {record.name}: no displacement of {', '.join(model.dofs)}; a prescribed motion needs "
                         "at least one")
    still = CubicSpline(record.time[[0, -1]], np.zeros(2))
    splines = [smooth_motion(record, dof, band) if dof in have else still for dof in model.dofs]
    equations = MotionEquations(model, activated(effects, model))
    time = record.time
    x, v, a = (np.stack([f(time, order) for f in splines], axis=1) for order in range(3))
    drive = wave_drive(model, record, equations, time)
    omega = middle(*spectrum_of(record, record.channels[have[0]]))
    r = radiation_states(model, splines, time, omega)
    p = vector_of(equations.actives)
    state = np.concatenate([r, x, v], axis=1)
    z = own_states(equations, splines, CubicSpline(time, state), drive, time, p)
    point = np.concatenate([state, z, a], axis=1)
    beyond = Compiled(equations.beyond)(time.size, point[:, None], drive, time[:, None, None], p)[:, 0]
    inertia = model.M + model.A_inf
    force = a @ inertia.T + r @ model.fit.c.T + v @ model.D.T + x @ model.C.T - beyond
    stems = [signal(dof) for dof in model.dofs]
    return ct.TimeResponseData(time, force.T, inputs=x.T, issiso=False, output_labels=[f"{s}_force" for s in stems],
                               input_labels=stems, title=record.name, sysname=model.name, success=True)


def smooth_motion(record: Record, dof: str, band: float) -> BSpline:
    """Return a displacement, quintic, without what is faster than `band` times its median frequency."""
    there = np.isfinite(record.channels[dof])
    raw = CubicSpline(record.time[there], record.channels[dof][there])
    top = band * middle(*spectrum_of(record, record.channels[dof]))
    smooth = without_fast(raw, top) if top > 0.0 else raw
    return make_interp_spline(smooth.x, smooth(smooth.x), k=min(5, smooth.x.size - 1) // 2 * 2 + 1)


def radiation_states(model: Model, splines: Sequence[Spline], time: FloatArray, omega: float) -> FloatArray:
    """Return the radiation states along a motion (nt, m), its velocity linear over a quarter of a sample."""
    if not model.fit.states:
        return np.zeros((time.size, 0))
    step = 0.25 * float(np.median(np.diff(time)))
    even = np.arange(time[0], time[-1] + step, step)
    v = np.stack([f(np.minimum(even, time[-1]), 1) for f in splines], axis=1)
    a, b, start = model.fit.a, model.fit.b, np.zeros(model.fit.states)
    moving = np.abs(v).max() * np.array([1.0, omega])
    begun = np.array([[f(time[0], 1), f(time[0], 2)] for f in splines])
    if omega > 0.0 and np.any(np.abs(begun) > 0.05 * moving):
        phase = omega * (even[:max(round(2.0 * np.pi / omega / step), 4)] - even[0])
        wave = np.stack([np.cos(phase), np.sin(phase)], axis=1)
        cosine, sine = np.linalg.lstsq(wave, v[:phase.size], rcond=None)[0]
        steady = np.linalg.solve(1j * omega * np.eye(start.size) - a, b @ (cosine - 1j * sine))
        start[:] = steady.real
    return np.asarray(CubicSpline(even, propagate(exact_step(a, b, step), v, start))(time))


def wave_drive(model: Model, record: Record, equations: MotionEquations, time: FloatArray) -> FloatArray:
    """Return the exciting force of the record's waves and, where effects need them, the waves, (nt, 3, drives)."""
    still = CubicSpline(time[[0, -1]], np.zeros(2))
    splines = [*(wave_force(model, record) if known_in_waves(model, record) else [still] * model.n),
               *(wave_motion(model, record) if equations.waves else [])]
    if equations.towed:
        splines.append(CubicSpline(time[[0, -1]], np.full(2, record.speed)))
    return laid_out(splines, time)


def own_states(equations: MotionEquations, splines: Sequence[Spline], state: CubicSpline, drive: FloatArray,
               time: FloatArray, p: FloatArray) -> FloatArray:
    """Return the effects' own states along a motion, from rest, shape (nt, own)."""
    if not equations.own:
        return np.zeros((time.size, 0))
    driven = CubicSpline(time, drive)

    def rate(t: float, z: FloatArray) -> FloatArray:
        point = np.concatenate([state(t), z, [f(t, 2) for f in splines]])
        return np.asarray(equations.follow(point, driven(t).T, t, p)).ravel()

    found = solve_ivp(rate, (time[0], time[-1]), np.zeros(equations.own), t_eval=time, rtol=1e-6,
                      atol=1e-9, max_step=4.0 * float(np.median(np.diff(time))))
    return np.asarray(found.y.T)


def equilibrium(model: Model, force: FloatArray, actives: Iterable[Active] = (), *, iterations: int = 60) -> FloatArray:
    """Return the displacements (nt, n) at which a body rests under steady forces (nt, n) [N, N m], by Newton's method.

    Each row with a line search from the linear model's place; own states, velocities and waves are zero.
    """
    equations, n = MotionEquations(model, tuple(actives)), model.n
    x, f = ca.SX.sym("x", n), ca.SX.sym("f", n)
    point = ca.vertcat(ca.SX.zeros(model.fit.states), x, ca.SX.zeros(2 * n + equations.own))
    drive = ca.horzcat(ca.vertcat(f, ca.SX.zeros(equations.drives - n)), ca.SX.zeros(equations.drives, 2))
    left = equations.beyond(point, drive, 0.0, vector_of(equations.actives)) - ca.mtimes(ca.DM(model.C), x)
    start, left = force @ np.linalg.pinv(model.C).T, left / (np.abs(force).max() or 1.0)
    balance = ca.Function("balance", [x, f], [left, ca.densify(ca.jacobian(left, x))])
    slopes = np.asarray(balance(start.T, force.T)[1]).reshape(n, -1, n)
    if free := [dof for dof, rows in zip(model.dofs, slopes) if not rows.any(axis=1).all()]:
        raise InputError(f"static test: nothing restores {', '.join(free)}; give the model a stiffness there, or "
                         "an effect that restores")
    place = ca.rootfinder("place", "newton", {"x": x, "p": f, "g": left}, {
        "max_iter": iterations, "abstol": 1e-10, "line_search": True, "error_on_fail": False})
    found = place(start.T, force.T)
    if not np.abs(np.asarray(balance(found, force.T)[0])).max() < 1e-9:
        raise SolverError("static test: no equilibrium is found under the force")
    return np.asarray(found).T
