"""The corrected model for filters and control: linear (a Model, a ct.StateSpace), or with its effects as they are.

Linear effects stay as they are. In the linear forms a nonlinear one becomes the spring and the damper that do the same
work in a harmonic motion of given amplitude (equivalent linearisation; Krylov & Bogoliubov): k = -<f x>/<x^2>,
b = -<f v>/<v^2>.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.composite import signal_names, system_matrices
from radiation_ss.body.convert import as_model
from radiation_ss.body.model import Model
from radiation_ss.effects import Active, activated
from radiation_ss.effects.definition import vector_of
from radiation_ss.effects.nominal import natural_frequency
from radiation_ss.errors import InputError
from radiation_ss.fit.rational import frequency_response
from radiation_ss.hydro.data import HydroData
from radiation_ss.methods import accepting
from radiation_ss.simulation.corrected import Corrected
from radiation_ss.simulation.equations import MotionEquations, signals_of, state_equations

if TYPE_CHECKING:
    import control as ct


@dataclass(frozen=True, eq=False)
class Linear:
    """What effects add to a linear model: force = -M a - D v - C x - c x_r + E z, z' = Z [x; v; a; x_r; z]; `left_out`
    are those that no linear model of the body holds: of time, force or sensor.
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

    `amplitude` of the harmonic motion [m or rad]: one, or by degree of freedom; 0 about rest; by default sqrt(2) times
    the rms of the correction's records. `own_states`: keep those of linear effects; else they are a spring and a
    damper.
    """
    actives = corrected.actives(model)
    exact = [a for a in actives if a.effect.force is not None and (a.effect.linear or a.effect.family == "nominal")
             and (own_states or not a.effect.states)]
    found, left = jacobians(model, exact), []
    M, D, C = found.M.copy(), found.D.copy(), found.C.copy()
    for active in actives:
        if active in exact:
            continue
        equations, t = MotionEquations(model, [active]), ca.SX.sym("t")
        force = equations.beyond(ca.SX.sym("point", equations.ns + model.n), np.zeros((equations.drives, 3)), t,
                                 active.vector)
        if active.effect.force is None or any(ca.which_depends(force, t, 1)):  # on time itself, in still water
            left.append(active.label)
            continue
        # Lines that hold the whole body have no motion of their own: about rest.
        size, omega = motion_of(model, corrected, active, amplitude) if active.dof else (0.0, 0.0)
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


def motion_of(model: Model, corrected: Corrected, active: Active,
              amplitude: Mapping[str, float] | float | None) -> tuple[float, float]:
    """Return amplitude and circular frequency of the harmonic motion for an effect."""
    rms, omega = corrected.motion.get(active.dof, (None, natural_frequency(model, model.dofs.index(active.dof))))
    size = amplitude.get(active.dof) if isinstance(amplitude, Mapping) else amplitude
    if size is None and rms is not None:
        size = np.sqrt(2.0) * rms
    if size is None or not size >= 0.0:
        raise InputError(f"amplitude: {active.label} is nonlinear; give the amplitude of {active.dof} [m or rad] to "
                         "linearise at, or 0 for about rest")
    return float(size), float(omega)


def jacobians(model: Model, actives: Sequence[Active]) -> Linear:
    """Return the derivatives of effects' forces and rates at rest, in still water."""
    equations, n, m = MotionEquations(model, actives), model.n, model.fit.states
    point = ca.SX.sym("point", equations.ns + n)
    given = (point, np.zeros((equations.drives, 3)), 0.0, vector_of(actives))
    both = ca.vertcat(equations.beyond(*given), equations.follow(*given))
    slope = np.asarray(ca.Function("slope", [point], [ca.densify(ca.jacobian(both, point))])(0.0))
    r, x, v, z, a = np.split(slope, [m, m + n, m + 2 * n, equations.ns], axis=1)
    return Linear(-a[:n], -v[:n], -x[:n], -r[:n], z[:n], np.hstack([x, v, a, r, z])[n:])


def equivalent(model: Model, active: Active, amplitude: float, omega: float, *, periods: int = 6,
               steps: int = 128) -> tuple[float, float]:
    """Return stiffness and damping that do an effect's work in x = amplitude cos(omega t) on its degree of freedom.

    The second degree of freedom of a coupled effect moves alike; what acts between two sees the first one's motion.
    States of its own have settled in the last one of some periods.
    """
    equations, i = MotionEquations(model, [active]), model.dofs.index(active.dof) if active.dof else 0
    moving, still = np.zeros((model.n, 1)), np.zeros((equations.drives, 3))
    moving[[i] + ([model.dofs.index(active.other)] if active.effect.scope in ("pair", "directed") else [])] = 1.0

    def at(function: ca.Function, angle: FloatArray, states: FloatArray) -> FloatArray:
        motion = amplitude * np.array([np.cos(angle), -omega * np.sin(angle), -(omega**2) * np.cos(angle)])
        x, v, a = (moving * row for row in motion)
        point = np.concatenate([np.zeros((model.fit.states, angle.size)), x, v, states, a])
        columns = [np.asarray(function(column, still, 0.0, active.vector)).ravel() for column in point.T]
        return np.array(columns).T

    phase, states = 2.0 * np.pi * np.arange(steps) / steps, np.zeros((equations.own, steps))
    if equations.own:
        states = solve_ivp(lambda angle, s: at(equations.follow, np.array([angle]), s[:, None])[:, 0] / omega,
                           (0.0, 2.0 * np.pi * periods), states[:, 0], t_eval=2.0 * np.pi * (periods - 1) + phase,
                           max_step=phase[1], rtol=1e-6, atol=1e-9 * amplitude).y
    values = at(equations.beyond, phase, states)[i]
    x, v = amplitude * np.cos(phase), -amplitude * omega * np.sin(phase)
    return -float(values @ x) / float(x @ x), -float(values @ v) / float(v @ v)


def corrected_plant(corrected: Corrected, model: Model,
                    amplitude: Mapping[str, float] | float | None = None) -> ct.StateSpace:
    """Return the corrected model as the composite system of `cummins`; states of linear effects (a tank) come last."""
    import control as ct

    extra = linearise(model, corrected, amplitude)
    fit = model.fit.replace(c=model.fit.c + extra.c)
    F, G, H, J = system_matrices(model.replace(A_inf=model.A_inf + extra.M, C=model.C + extra.C, D=model.D + extra.D,
                                               fit=fit))
    n, m = model.n, model.fit.states
    F, H, pull = np.pad(F, ((0, 0), (0, extra.E.shape[1]))), np.pad(H, ((0, 0), (0, extra.E.shape[1]))), J[2 * n:]
    F[m + n:, m + 2 * n:] = H[2 * n:, m + 2 * n:] = pull @ extra.E
    x, v, a, r, z = np.split(extra.Z, [n, 2 * n, 3 * n, 3 * n + m], axis=1)
    A = np.vstack([F, np.hstack([r, x, v, z]) + a @ H[2 * n:]])
    inputs, outputs = signal_names(model.dofs)
    states, _, _ = signals_of(model, [a for a in corrected.actives(model) if a.effect.linear and a.effect.force])
    return ct.ss(A, np.vstack([G, a @ pull]), H, J, inputs=list(inputs), outputs=list(outputs), states=states,
                 name=re.sub(r"\W+", "_", f"{model.name}_corrected"))


def corrected_model(corrected: Corrected, model: Model, amplitude: Mapping[str, float] | float | None = None) -> Model:
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
    hydro = None
    if (data := model.hydro) is not None:
        K, positive = frequency_response(model.fit.a, model.fit.b, extra.c, data.omega), data.omega[:, None, None] > 0.0
        swing = np.where(positive, K.imag / np.where(positive, data.omega[:, None, None], 1.0), 0.0)
        X = None if data.X is None else corrected_force(np.array(data.X, dtype=complex), data, model, corrected)
        hydro = replace(data, A=data.A + (A_inf - model.A_inf) + swing, B=data.B + K.real, A_inf=A_inf, X=X)
    fit = model.fit.replace(c=model.fit.c + extra.c, A_inf=A_inf, entry_error=None, data=hydro)
    return model.replace(M=M, A_inf=A_inf, C=model.C + extra.C, D=model.D + extra.D, fit=fit, hydro=hydro,
                         name=f"{model.name}_corrected")


def corrected_force(X: ComplexArray, data: HydroData, model: Model, corrected: Corrected) -> ComplexArray:
    """Return the exciting force with the size and the phase found, X itself overwritten."""
    for active in corrected.actives(model):
        at = [model.dofs.index(active.dof)] if active.dof else list(range(model.n))
        name = active.name.removeprefix("common_")
        if name in ("nominal_force", "excitation_gain"):
            X[:, :, at] *= 1.0 + active.vector[0]
        if name in ("nominal_force_phase", "excitation_delay"):
            unit = natural_frequency(model, at[0]) if name == "nominal_force_phase" else 1.0
            X[:, :, at] *= np.exp(-1j * data.omega * active.vector[0] / unit)[:, None, None]
    return X


@accepting(model=as_model)
def nonlinear_system(model: Model, effects: Iterable[Any] = (), name: str | None = None) -> ct.NonlinearIOSystem:
    """Return the model with effects as a python-control system.

    Inputs are `<dof>_force` [N, N m] and, where an effect needs them, `wave_elevation` [m], `wave_elevation_rate`
    [m/s], `wave_envelope` [m], `<dof>_orbital` [m/s, rad/s] and the forward speed `speed` [m/s]; outputs `<dof>` as its
    sensor reads it, `<dof>_vel`, `<dof>_acc`. States are named `rad<k>`, `<dof>`, `<dof>_vel` as in `cummins`, then
    `<effect>_<k>`. Delays of force and sensors and a phase of the force are left out; `params["left_out"]` names them.

    Parameters
    ----------
    effects : iterable
        As in `simulate`.
    name : str, optional
        Of the system; the model's if absent.

    Examples
    --------
    >>> import numpy as np, radiation_ss as rss
    >>> rigid = rss.RadiationFit(("Roll",), np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 0)
    >>> model = rss.Model(("Roll",), [[2.0]], [[1.0]], [[50.0]], rigid)
    >>> system = nonlinear_system(model, [("quadratic_drag", {"coefficient": 3.0})])
    >>> system.state_labels, system.input_labels, system.output_labels
    (['roll', 'roll_vel'], ['roll_force'], ['roll', 'roll_vel', 'roll_acc'])
    """
    import control as ct

    actives = activated(effects, model)
    function = state_equations(model, actives)
    states, inputs, outputs = signals_of(model, actives)

    def at(t: float, x: FloatArray, u: FloatArray, which: int) -> FloatArray:
        return np.asarray(function(t, x, u)[which]).ravel()

    left_out = tuple(a.label for a in actives if a.effect.clock_in is not None or a.effect.clock_out is not None)
    return ct.nlsys(lambda t, x, u, params: at(t, x, u, 0), lambda t, x, u, params: at(t, x, u, 1),
                    states=states, inputs=inputs, outputs=outputs, name=re.sub(r"\W+", "_", name or model.name),
                    params={"left_out": left_out})


def corrected_system(corrected: Corrected, model: Model) -> ct.NonlinearIOSystem:
    """Return the corrected model as ct.NonlinearIOSystem, effects as they are; see `nonlinear_system`."""
    return nonlinear_system(model, corrected.actives(model), f"{model.name}_corrected")
