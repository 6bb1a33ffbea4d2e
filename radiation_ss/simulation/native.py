"""The model with effects as a nonlinear system of python-control, and as a CasADi function for optimal control."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.composite import signal_names
from radiation_ss.body.model import Model
from radiation_ss.effects import activated
from radiation_ss.effects.definition import vector_of
from radiation_ss.hydro.data import signal
from radiation_ss.simulation.corrected import Corrected
from radiation_ss.simulation.equations import MotionEquations
from radiation_ss.simulation.reading import readout

if TYPE_CHECKING:
    import control as ct


def state_equations(model: Model, effects: Iterable[Any] = ()) -> ca.Function:
    """Return x' and y of the model with effects as a CasADi function of (t, x, u).

    States are those of the radiation model, displacements, velocities, and of effects, in this order; inputs and
    outputs are those of `nonlinear_system`. Delays of force and sensors are left out.
    """
    equations = MotionEquations(model, activated(effects, model))
    p = ca.DM(vector_of(equations.actives))
    m, n = model.fit.states, model.n
    t, s = ca.SX.sym("t"), ca.SX.sym("x", equations.ns)
    u = ca.SX.sym("u", n + (2 + n if equations.waves else 0) + equations.towed)
    level = [ca.horzcat(u[n], u[n + 1], t)] if equations.waves else []
    drive = ca.vertcat(*(ca.horzcat(u[i], 0.0, equations.clock(t, p)[i]) for i in range(n)), *level,
                       *(ca.horzcat(u[i], 0.0, t) for i in range(n + 2 * equations.waves, u.size1())))
    a = equations.acceleration(s, drive, t, p)
    v = s[m + n:m + 2 * n]
    own = equations.follow(ca.vertcat(s, a), drive, t, p)
    rate = ca.vertcat(ca.mtimes(ca.DM(model.fit.a), s[:m]) + ca.mtimes(ca.DM(model.fit.b), v), v, a, own)
    y = ca.vertcat(*readout(equations, s[m:m + n], t, p), v, a)
    return ca.Function("state_equations", [t, s, u], [ca.densify(rate), ca.densify(y)], {"cse": True})


def signals_of(model: Model, effects: Iterable[Any] = ()) -> tuple[list[str], list[str], list[str]]:
    """Return the names of states, inputs and outputs of `state_equations`; see `nonlinear_system`."""
    actives = activated(effects, model)
    stems, (inputs, outputs) = [signal(dof) for dof in model.dofs], signal_names(model.dofs)
    waves = any(a.effect.needs == "waves" for a in actives)
    extra = ["wave_elevation", "wave_elevation_rate", *(f"{stem}_orbital" for stem in stems)] if waves else []
    extra += ["speed"] if any(a.effect.needs == "speed" for a in actives) else []
    own = [f"{a.name}_{k}" for a in actives for k in range(a.effect.states)]
    own = [label if own.count(label) == 1 else f"{label}_{i}" for i, label in enumerate(own)]
    states = [*(f"radiation_{k}" for k in range(model.fit.states)), *stems, *(f"{stem}_vel" for stem in stems), *own]
    return states, [*inputs, *extra], list(outputs)


def nonlinear_system(model: Model, effects: Iterable[Any] = (), name: str | None = None) -> ct.NonlinearIOSystem:
    """Return the model with effects as a python-control system.

    Inputs are `<dof>_force` [N, N m] and, where an effect needs them, `wave_elevation` [m], `wave_elevation_rate`
    [m/s], `<dof>_orbital` [m/s, rad/s] and the forward speed `speed` [m/s]; outputs `<dof>` as its sensor reads it,
    `<dof>_vel`, `<dof>_acc`. States are named `radiation_<k>`, `<dof>`, `<dof>_vel` and `<effect>_<k>`. Delays of force
    and sensors are left out; `params["left_out"]` names them.

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
                    states=states, inputs=inputs, outputs=outputs, name=name or model.name,
                    params={"left_out": left_out})


def corrected_system(corrected: Corrected, model: Model) -> ct.NonlinearIOSystem:
    """Return the corrected model as ct.NonlinearIOSystem, effects as they are; see `nonlinear_system`."""
    return nonlinear_system(model, corrected.actives(model), f"{model.name}_corrected")
