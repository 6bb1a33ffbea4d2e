"""The corrected model: the nominal numbers retuned within tolerance, and the effects found. corrected.json.

For filters and control it is linear (a Model, a ct.StateSpace), or has its effects as they are. In the linear forms a
nonlinear one becomes the spring and the damper that do the same work in a harmonic motion of given amplitude
(equivalent linearisation; Krylov & Bogoliubov): k = -<f x>/<x^2>, b = -<f v>/<v^2>.
"""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.atomic import write_whole
from radiation_ss.body.composite import signal_names, system_matrices
from radiation_ss.body.convert import as_model
from radiation_ss.body.model import Model
from radiation_ss.effects import Active
from radiation_ss.effects.definition import named, vector_of
from radiation_ss.effects.nominal import natural_frequency, nominal_effects, tolerances
from radiation_ss.errors import InputError
from radiation_ss.fit.rational import frequency_response
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.data import HydroData
from radiation_ss.methods import Brief
from radiation_ss.simulation.equations import MotionEquations
from radiation_ss.simulation.native import nonlinear_system, signals_of

if TYPE_CHECKING:
    import control as ct

SCHEMA = "radiation_ss.corrected/1"


@dataclass(frozen=True, repr=False)
class Corrected(Brief):
    """What a diagnosis adds to a model."""

    nominal: Mapping[tuple[str, str], float]  # By (name, dof): relative deviations of the model's own numbers
    effects: tuple[Active, ...]
    tolerance: Mapping[str, float] = field(default_factory=dict)  # That the deviations belong to
    # By dof: rms [m or rad] and typical frequency [rad/s] in the records, where a nonlinear effect is linearised
    motion: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    # By dof: M + A_inf [kg, kg m^2] and C [N/m, N m/rad] of the diagnosed model; empty: models are not compared with it
    body: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __str__(self) -> str:
        parts = [f"  {active.name} on {active.dof}: " + ", ".join(
            f"{name} {value:.4g}" for name, value in active.values.items())
            for active in self.effects]
        own = [f"  {name} of {dof} {value:+.2%}" for (name, dof), value in self.nominal.items()]
        return "\n".join(["Corrected: what a diagnosis adds to a model", *parts, *own])

    def actives(self, model: Model) -> tuple[Active, ...]:
        """Return everything to be simulated: retuned nominal numbers first, then effects.

        InputError if the model is not of the diagnosed body.
        """
        self.check_body(model)
        own = [number.active for number in nominal_effects(model, tolerances(self.tolerance), force=True)]
        return (*(active.with_values([value]) for active in own
                  if (value := self.nominal.get((active.name, active.dof)))),
                *(active.bound(model) for active in self.effects))

    def check_body(self, model: Model, alike: float = 0.01) -> None:
        """Refuse a model of other degrees of freedom, or whose inertia or stiffness is not `alike`, relative."""
        if not self.body:
            return
        if set(self.body) != set(model.dofs):
            raise InputError(f"corrected model: it is of {', '.join(self.body)}, the model given has "
                             f"{', '.join(model.dofs)}; it must be the diagnosed one")
        for dof, numbers in self.body.items():
            for name, then, now in zip(("inertia M + A_inf", "stiffness C"), numbers, numbers_of(model)[dof]):
                if abs(then - now) > alike * max(abs(then), abs(now)):
                    raise InputError(f"corrected model: {name} of {dof} was {then:.4g} (SI) in the diagnosis, the "
                                     f"model given has {now:.4g}; it must be the diagnosed one, alike to {alike:.0%}")

    def model(self, model: Model, amplitude: Mapping[str, float] | float | None = None) -> Model:
        """Return the corrected model as a Model, for `identify`, `DualEnKF`, `simulate`: better radiation coefficients.

        Mass and added mass cannot be told apart by motion: what was found is shared in proportion to their tolerances'
        squares, a missing inertia counts as added mass. The hydrodynamic table follows: A, B with the memory, X with
        the exciting force's size and phase. A force that is given to the model acts as given: a gain of the recorded
        one is no property of the body, and is in `to_ss`, `to_nlsys` and `simulate` alone.
        """
        model = as_model(model)
        extra = linearise(model, self, amplitude, own_states=False)
        mass = np.square(self.tolerance.get("mass", 0.02) * model.M)
        added = np.square(self.tolerance.get("A_inf", 0.02) * model.A_inf)
        retuned = linearise(model, Corrected(self.nominal, (), self.tolerance), 0.0).M
        share = np.divide(mass, mass + added, out=np.zeros_like(mass), where=mass + added > 0.0)
        M = model.M + share * retuned
        A_inf = model.A_inf + extra.M - share * retuned
        fit, hydro = with_memory(model.fit, extra), None
        if (data := model.hydro) is not None:
            K = (frequency_response(fit.a, fit.b, fit.c, data.omega)
                 - frequency_response(model.fit.a, model.fit.b, model.fit.c, data.omega))
            swing = K.imag / data.omega[:, None, None]
            X = None if data.X is None else corrected_force(np.array(data.X, dtype=complex), data, model, self)
            hydro = replace(data, A=data.A + (A_inf - model.A_inf) + swing, B=data.B + K.real, A_inf=A_inf, X=X)
        fit = fit.replace(A_inf=A_inf, entry_error=None, data=hydro)
        return model.replace(M=M, A_inf=A_inf, C=model.C + extra.C, D=model.D + extra.D, fit=fit, hydro=hydro,
                             name=f"{model.name}_corrected")

    def to_ss(self, model: Model, amplitude: Mapping[str, float] | float | None = None) -> "ct.StateSpace":
        """Return the corrected model as the composite system of `cummins`; states of linear effects (a tank) last.

        Its inputs are forces as they are recorded: a gain that was found acts on them.
        """
        import control as ct

        model = as_model(model)
        extra = linearise(model, self, amplitude)
        fit = model.fit.replace(c=model.fit.c + extra.c)
        F, G, H, J = system_matrices(model.replace(A_inf=model.A_inf + extra.M, C=model.C + extra.C,
                                                   D=model.D + extra.D, fit=fit))
        n, m = model.n, model.fit.states
        F, H, pull = np.pad(F, ((0, 0), (0, extra.E.shape[1]))), np.pad(H, ((0, 0), (0, extra.E.shape[1]))), J[2 * n:]
        F[m + n:, m + 2 * n:] = H[2 * n:, m + 2 * n:] = pull @ extra.E
        x, v, a, r, z = np.split(extra.Z, [n, 2 * n, 3 * n, 3 * n + m], axis=1)
        A = np.vstack([F, np.hstack([r, x, v, z]) + a @ H[2 * n:]])
        inputs, outputs = signal_names(model.dofs)
        gain = np.diag(input_slopes(self.actives(model), model.dofs))
        states, _, _ = signals_of(model, [a for a in self.actives(model) if a.effect.linear and a.effect.force])
        return ct.ss(A, np.vstack([G, a @ pull]) @ gain, H, J @ gain, inputs=list(inputs), outputs=list(outputs),
                     states=states, name=re.sub(r"\W+", "_", f"{model.name}_corrected"))

    def to_nlsys(self, model: Model) -> "ct.NonlinearIOSystem":
        """Return the corrected model as ct.NonlinearIOSystem, effects as they are; see `equations.nonlinear_system`."""
        model = as_model(model)
        return nonlinear_system(model, self.actives(model), f"{model.name}_corrected")

    def to_dict(self) -> dict[str, Any]:
        """Return the content of corrected.json."""
        return {"schema": SCHEMA, "tolerance": dict(self.tolerance),
                "motion": {dof: list(pair) for dof, pair in self.motion.items()},
                "body": {dof: list(pair) for dof, pair in self.body.items()},
                "nominal": [{"name": name, "dof": dof, "share": value} for (name, dof), value in self.nominal.items()],
                "effects": [{"name": a.name, "dof": a.dof, "other": a.other, "parameters": dict(a.values)}
                            for a in self.effects]}

    def write(self, path: str | Path) -> None:
        """Write corrected.json."""
        write_whole(path, json.dumps(self.to_dict(), indent=1) + "\n")


def numbers_of(model: Model) -> dict[str, tuple[float, float]]:
    """Return inertia M + A_inf and stiffness C of each degree of freedom, by which a body is known again."""
    return {dof: (float(inertia), float(stiffness)) for dof, inertia, stiffness in
            zip(model.dofs, np.diag(model.M + model.A_inf), np.diag(model.C))}


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
    the rms of the correction's records. `own_states`: keep those of linear effects; else only those that follow the
    velocities as the radiation's do, and the others are a spring and a damper.
    """
    actives = corrected.actives(model)
    exact = [a for a in actives if a.effect.force is not None and (a.effect.linear or a.effect.family == "nominal")
             and (own_states or not a.effect.states or a.effect.bind is not None)]
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
        size, omega = motion_of(model, corrected, active, active.dof, amplitude) if active.dof else (0.0, 0.0)
        if active.effect.scope == "pair" and not active.effect.states:
            both = [(size, omega), motion_of(model, corrected, active, active.other, amplitude)]
            if any(each > 0.0 for each, _ in both):
                springs, dampers = equivalent_of_pair(model, active, both)
                C, D = C + springs, D + dampers
                continue
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


def input_slopes(actives: Sequence[Active], dofs: Sequence[str]) -> FloatArray:
    """Return how much of a small recorded force acts on each degree of freedom."""
    u, found = ca.SX.sym("u"), np.ones(len(dofs))
    for active in actives:
        if active.effect.input is not None:
            acting = active.effect.input(SimpleNamespace(u=u, t=0.0), named(active.effect, active.vector))
            slope = float(ca.Function("slope", [u], [ca.jacobian(acting, u)])(0.0))
            found[[active.dof in (dof, "") for dof in dofs]] *= slope
    return found


def with_memory(fit: RadiationFit, extra: Linear) -> RadiationFit:
    """Return the radiation with the states that a correction adds to it, z' = Z_v v + Z_r x_r + Z_z z."""
    n, m = len(fit.dofs), fit.states
    _, v, _, r, z = np.split(extra.Z, [n, 2 * n, 3 * n, 3 * n + m], axis=1)
    return fit.replace(a=np.block([[fit.a, np.zeros((m, len(z)))], [r, z]]), b=np.concatenate([fit.b, v]),
                       c=np.concatenate([fit.c + extra.c, -extra.E], axis=1))


def motion_of(model: Model, corrected: Corrected, active: Active, dof: str,
              amplitude: Mapping[str, float] | float | None) -> tuple[float, float]:
    """Return amplitude and circular frequency of the harmonic motion of a degree of freedom for an effect."""
    rms, omega = corrected.motion.get(dof, (None, natural_frequency(model, model.dofs.index(dof))))
    size = amplitude.get(dof) if isinstance(amplitude, Mapping) else amplitude
    if size is None and rms is not None:
        size = np.sqrt(2.0) * rms
    if size is None or not size >= 0.0:
        raise InputError(f"amplitude: {active.label} is nonlinear; give the amplitude of {dof} [m or rad] to "
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
    moving = np.zeros((model.n, 1))
    moving[[i] + ([model.dofs.index(active.other)] if active.effect.scope in ("pair", "directed") else [])] = 1.0
    still = np.zeros((equations.drives, 3))

    def at(function: ca.Function, angle: FloatArray, states: FloatArray) -> FloatArray:
        motion = amplitude * np.array([np.cos(angle), -omega * np.sin(angle), -(omega**2) * np.cos(angle)])
        x, v, a = (moving * row for row in motion)
        point = np.concatenate([np.zeros((model.fit.states, angle.size)), x, v, states, a])
        return np.asarray(function(point, still, 0.0, active.vector))

    phase, states = 2.0 * np.pi * np.arange(steps) / steps, np.zeros((equations.own, steps))
    if equations.own:
        states = solve_ivp(lambda angle, s: at(equations.follow, np.array([angle]), s[:, None])[:, 0] / omega,
                           (0.0, 2.0 * np.pi * periods), states[:, 0], t_eval=2.0 * np.pi * (periods - 1) + phase,
                           max_step=phase[1], rtol=1e-6, atol=1e-9 * amplitude).y
    values = at(equations.beyond, phase, states)[i]
    x, v = amplitude * np.cos(phase), -amplitude * omega * np.sin(phase)
    return -float(values @ x) / float(x @ x), -float(values @ v) / float(v @ v)


def equivalent_of_pair(model: Model, active: Active, motions: Sequence[tuple[float, float]], *, steps: int = 32,
                       least: float = 1e-6) -> tuple[FloatArray, FloatArray]:
    """Return stiffness and damping (n, n) that do a pair's work in harmonic motions of two dofs, of any phase.

    `motions`: amplitude and circular frequency of each; one that is at rest moves by `least` of its unit.
    """
    equations, places = MotionEquations(model, [active]), [model.dofs.index(dof) for dof in (active.dof, active.other)]
    phases = np.meshgrid(*[2.0 * np.pi * (np.arange(steps) + 0.5) / steps] * 2)
    x, v, a = np.zeros((3, model.n, steps**2))
    for place, phase, (size, omega) in zip(places, phases, motions):
        moved, turn = max(size, least), np.ravel(phase)
        x[place], v[place], a[place] = (moved * np.array([np.cos(turn), -omega * np.sin(turn),
                                                          -(omega**2) * np.cos(turn)]))
    point = np.concatenate([np.zeros((model.fit.states, steps**2)), x, v, a])
    force = np.asarray(equations.beyond(point, np.zeros((equations.drives, 3)), 0.0, active.vector))
    k, b = np.zeros((2, model.n, model.n))
    square = np.ix_(places, places)
    for found, motion in ((k, x[places]), (b, v[places])):
        found[square] = -(force[places] @ motion.T) / np.sum(motion**2, axis=1)
    return k, b


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
