"""The corrected model as a linear one: for filters (a Model) and for control (a ct.StateSpace).

Linear effects are taken as they are. A nonlinear one becomes the spring and the damper that do the same work in a
harmonic motion of given amplitude (equivalent linearisation; Krylov & Bogoliubov): k = -<f x>/<x^2>, b = -<f v>/<v^2>.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.composite import signal_names
from radiation_ss.body.model import Model
from radiation_ss.effects import Active
from radiation_ss.effects.acting import acting
from radiation_ss.effects.definition import named
from radiation_ss.effects.nominal import natural_frequency
from radiation_ss.errors import InputError
from radiation_ss.fit.rational import frequency_response
from radiation_ss.hydro.data import HydroData
from radiation_ss.simulation.corrected import Corrected

if TYPE_CHECKING:
    import control as ct

PERIODS, STEPS = 6, 128  # an effect with states of its own settles before its last period counts


@dataclass(frozen=True, eq=False)
class Linear:
    """What effects add to a linear model: force = -M a - D v - C x - c x_r + E z, z' = Z [x; v; a; x_r; z].

    Parameters
    ----------
    M, D, C : ndarray, shape (n, n)
    c : ndarray, shape (n, m)
        Rows of the memory's output matrix.
    E : ndarray, shape (n, k)
    Z : ndarray, shape (k, 3 n + m + k)
    left_out : tuple of str
        Effects that no linear model of the body holds: they vary with time, or are those of force and sensor.
    """

    M: FloatArray
    D: FloatArray
    C: FloatArray
    c: FloatArray
    E: FloatArray
    Z: FloatArray
    left_out: tuple[str, ...] = ()


def linearise(model: Model, corrected: Corrected, amplitude: Mapping[str, float] | float | None = None, *,
              own_states: bool = True) -> Linear:
    """Return what a correction adds to the linear model.

    Parameters
    ----------
    model : Model
    corrected : Corrected
    amplitude : mapping of dof to float, or float, optional
        Amplitude of the harmonic motion [m or rad]; 0: about rest. By default sqrt(2) times the rms of the
        records that the correction comes from.
    own_states : bool
        Keep states of linear effects (a tank); otherwise these, too, become a spring and a damper.

    Raises
    ------
    InputError
        If an effect is nonlinear and the amplitude is not known.
    """
    actives = corrected.actives(model)
    exact = [a for a in actives if is_linear(a) and (own_states or not a.effect.states)]
    found, left = jacobians(model, exact), []
    M, D, C = found.M.copy(), found.D.copy(), found.C.copy()
    for active in actives:
        if active in exact:
            continue
        if active.effect.force is None or with_time(model, active):
            left.append(active.label)
            continue
        size, omega = motion_of(model, corrected, active, amplitude)
        if size == 0.0:
            at_rest = jacobians(model, [active])
            C, D, M = C + at_rest.C, D + at_rest.D, M + at_rest.M
            continue
        k, b = equivalent(model, active, size, omega)
        shape = np.zeros(model.n)
        shape[model.dofs.index(active.dof) if active.dof else 0] = 1.0
        if active.effect.scope == "between":
            shape[model.dofs.index(active.other)] = -1.0
        C, D = C + k * np.outer(shape, shape), D + b * np.outer(shape, shape)
    return replace(found, M=M, D=D, C=C, left_out=tuple(left))


def is_linear(active: Active) -> bool:
    """Whether an effect is a force that is linear in the motion."""
    return active.effect.force is not None and (active.effect.linear or active.effect.family == "nominal")


def motion_of(model: Model, corrected: Corrected, active: Active,
              amplitude: Mapping[str, float] | float | None) -> tuple[float, float]:
    """Return amplitude and circular frequency of the harmonic motion for an effect."""
    rms, omega = corrected.motion.get(active.dof, (None, natural_frequency(model, model.dofs.index(active.dof))))
    if isinstance(amplitude, Mapping):
        size = amplitude.get(active.dof)
    else:
        size = amplitude
    if size is None and rms is not None:
        size = np.sqrt(2.0) * rms
    if size is None or not size >= 0.0:
        raise InputError(f"amplitude: {active.label} is nonlinear; give the amplitude of {active.dof} [m or rad] to "
                         "linearise at, or 0 for about rest")
    return float(size), float(omega)


def symbols(model: Model, active: Active) -> tuple[list[Any], Any, Any, Any]:
    """Return the symbols x, v, a, x_r, z of an effect, its force on every degree of freedom, its rates, and time.

    Still water: no wave, no exciting force.
    """
    n, m, effect = model.n, model.fit.states, active.effect
    x, v, a, r = (ca.SX.sym(name, size) for name, size in (("x", n), ("v", n), ("a", n), ("r", m)))
    z, time, none = ca.SX.sym("z", effect.states), ca.SX.sym("t"), ca.SX(0)
    memory = ca.mtimes(ca.DM(model.fit.c), r) if m else ca.SX.zeros(n)
    signals = [SimpleNamespace(x=x[i], v=v[i], a=a[i], u=none, t=time, memory=memory[i], radiation=r, dof=dof,
                               elevation=none, elevation_rate=none, orbital=none, speed=none) for i, dof in enumerate(model.dofs)]
    forces, rates = acting(active, signals, model.dofs, named(effect, active.vector), ca.vertsplit(z))
    force = [ca.SX(0)] * n
    for place, value in forces:
        force[place] = force[place] + value
    return [x, v, a, r, z], ca.vertcat(*force), ca.vertcat(*rates) if rates else ca.SX(0, 1), time


def with_time(model: Model, active: Active) -> bool:
    """Whether an effect's force depends on time itself."""
    _, force, _, time = symbols(model, active)
    return any(ca.which_depends(force, time, 1))


def jacobians(model: Model, actives: Sequence[Active]) -> Linear:
    """Return the derivatives of effects' forces and rates at rest."""
    n, m = model.n, model.fit.states
    k = sum(a.effect.states for a in actives)
    F, E, Z, at = np.zeros((n, 3 * n + m)), np.zeros((n, k)), np.zeros((k, 3 * n + m + k)), 0
    for active in actives:
        parts, force, rates, time = symbols(model, active)
        own = active.effect.states
        both = ca.vertcat(*parts)
        function = ca.Function("slope", [both, time], [ca.densify(ca.jacobian(ca.vertcat(force, rates), both))])
        slope = np.asarray(function(np.zeros(both.size1()), 0.0)).reshape(n + own, -1)
        F += slope[:n, :3 * n + m]
        E[:, at:at + own] = slope[:n, 3 * n + m:]
        Z[at:at + own, :3 * n + m] = slope[n:, :3 * n + m]
        Z[at:at + own, 3 * n + m + at:3 * n + m + at + own] = slope[n:, 3 * n + m:]
        at += own
    return Linear(-F[:, 2 * n:3 * n], -F[:, n:2 * n], -F[:, :n], -F[:, 3 * n:], E, Z)


def equivalent(model: Model, active: Active, amplitude: float, omega: float) -> tuple[float, float]:
    """Return stiffness and damping that do an effect's work in x = amplitude cos(omega t) on its degree of freedom.

    The second degree of freedom of a coupled effect moves alike; what acts between two sees the first one's motion.
    """
    parts, force, rates, time = symbols(model, active)
    i = model.dofs.index(active.dof) if active.dof else 0
    moving = np.zeros((model.n, 1))
    moving[[i] + ([model.dofs.index(active.other)] if active.effect.scope in ("pair", "directed") else [])] = 1.0
    still, z = np.zeros(model.fit.states), parts[-1]
    force_at = ca.Function("force", [*parts, time], [force[i], rates])

    def at(angle: FloatArray, states: FloatArray) -> list[FloatArray]:
        motion = amplitude * np.array([np.cos(angle), -omega * np.sin(angle), -(omega**2) * np.cos(angle)])
        x, v, a = (moving * row for row in motion)
        return [np.atleast_2d(np.asarray(part)) for part in force_at(x, v, a, still, states, 0.0)]

    phase = 2.0 * np.pi * np.arange(STEPS) / STEPS
    states = np.zeros((z.size1(), STEPS))
    if z.size1():
        path = solve_ivp(lambda angle, s: at(np.array([angle]), s)[1].ravel() / omega, (0.0, 2.0 * np.pi * PERIODS),
                         states[:, 0], t_eval=2.0 * np.pi * (PERIODS - 1) + phase, max_step=phase[1], rtol=1e-6,
                         atol=1e-9 * amplitude)
        states = path.y
    values = np.broadcast_to(at(phase, states)[0].ravel(), (STEPS,))
    x, v = amplitude * np.cos(phase), -amplitude * omega * np.sin(phase)
    return -float(values @ x) / float(x @ x), -float(values @ v) / float(v @ v)


def corrected_plant(corrected: Corrected, model: Model,
                    amplitude: Mapping[str, float] | float | None = None) -> ct.StateSpace:
    """Return the corrected model as the composite system: inputs `<dof>_force`, outputs as `cummins`.

    States of linear effects (a tank) come last. See `linearise` for the amplitude.
    """
    import control as ct

    extra = linearise(model, corrected, amplitude)
    n, m, k = model.n, model.fit.states, extra.E.shape[1]
    inverse = np.linalg.inv(model.M + model.A_inf + extra.M)
    acceleration = inverse @ np.hstack([-(model.fit.c + extra.c), -(model.C + extra.C), -(model.D + extra.D), extra.E])
    A = np.zeros((m + 2 * n + k, m + 2 * n + k))
    A[:m, :m], A[:m, m + n:m + 2 * n] = model.fit.a, model.fit.b
    A[m:m + n, m + n:m + 2 * n] = np.eye(n)
    A[m + n:m + 2 * n] = acceleration
    x, v, a, r, z = np.split(extra.Z, [n, 2 * n, 3 * n, 3 * n + m], axis=1)
    A[m + 2 * n:] = np.hstack([r, x, v, z]) + a @ acceleration
    B = np.zeros((m + 2 * n + k, n))
    B[m + n:m + 2 * n], B[m + 2 * n:] = inverse, a @ inverse
    H = np.zeros((3 * n, A.shape[0]))
    H[:2 * n, m:m + 2 * n], H[2 * n:] = np.eye(2 * n), acceleration
    inputs, outputs = signal_names(model.dofs)
    return ct.ss(A, B, H, np.vstack([np.zeros((2 * n, n)), inverse]), inputs=list(inputs), outputs=list(outputs))


def corrected_model(corrected: Corrected, model: Model,
                    amplitude: Mapping[str, float] | float | None = None) -> Model:
    """Return the corrected model as a Model, for `identify`, `DualEnKF`, `simulate`: better radiation coefficients.

    Mass and added mass cannot be told apart by motion: what was found is shared in proportion to their tolerances'
    squares, a missing inertia counts as added mass. The hydrodynamic table follows: A, B with the memory, X with the
    exciting force's size and phase.
    """
    extra = linearise(model, corrected, amplitude, own_states=False)
    mass = np.square(corrected.tolerance.get("mass", 0.02) * model.M)
    added = np.square(corrected.tolerance.get("A_inf", 0.02) * model.A_inf)
    retuned = linearise(model, Corrected(corrected.nominal, (), corrected.tolerance), 0.0).M
    share = np.divide(mass, mass + added, out=np.zeros_like(mass), where=mass + added > 0.0)
    M = model.M + share * retuned
    A_inf = model.A_inf + extra.M - share * retuned
    hydro = None if model.hydro is None else corrected_table(model.hydro, model, corrected, extra.c, A_inf)
    fit = model.fit.replace(c=model.fit.c + extra.c, A_inf=A_inf, entry_error=None, data=hydro)
    return model.replace(M=M, A_inf=A_inf, C=model.C + extra.C, D=model.D + extra.D, fit=fit, hydro=hydro,
                         name=f"{model.name}_corrected")


def corrected_table(data: HydroData, model: Model, corrected: Corrected, row: FloatArray,
                    A_inf: FloatArray) -> HydroData:
    """Return the table of coefficients with the memory's and the exciting force's correction (6)-(7)."""
    K = frequency_response(model.fit.a, model.fit.b, row, data.omega)
    at = np.where(data.omega > 0.0, data.omega, 1.0)[:, None, None]
    swing = np.where(data.omega[:, None, None] > 0.0, K.imag / at, 0.0)
    X = None if data.X is None else corrected_force(np.array(data.X, dtype=complex), data, model, corrected)
    return replace(data, A=data.A + (A_inf - model.A_inf) + swing, B=data.B + K.real, A_inf=A_inf, X=X)


def corrected_force(X: ComplexArray, data: HydroData, model: Model, corrected: Corrected) -> ComplexArray:
    """Return the exciting force with the size and the phase found, X itself overwritten."""
    for active in corrected.actives(model):
        i = model.dofs.index(active.dof) if active.dof else 0
        if active.name in ("nominal_force", "excitation_gain"):
            X[:, :, i] *= 1.0 + active.vector[0]
        if active.name in ("nominal_force_phase", "excitation_delay"):
            unit = natural_frequency(model, i) if active.name == "nominal_force_phase" else 1.0
            X[:, :, i] *= np.exp(-1j * data.omega * active.vector[0] / unit)[:, None]
    return X
