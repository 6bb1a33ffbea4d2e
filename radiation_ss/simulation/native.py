"""A model with effects as a system of other programs: CasADi's function of the state, python-control's system."""

import re
import warnings
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.composite import signal_names
from radiation_ss.body.convert import as_model
from radiation_ss.body.model import Model
from radiation_ss.effects import activated
from radiation_ss.effects.definition import DEPTHS, Active, vector_of
from radiation_ss.errors import InputWarning
from radiation_ss.hydro.data import signal
from radiation_ss.methods import accepting
from radiation_ss.simulation.equations import MotionEquations, sensed

if TYPE_CHECKING:
    import control as ct


@accepting(model=as_model)
def nonlinear_system(model: Model, effects: Iterable[Any] = (), name: str | None = None) -> "ct.NonlinearIOSystem":
    """Return the model with effects as a python-control system.

    Inputs are `<dof>_force` [N, N m] and, where an effect needs them, `wave_elevation` [m], `wave_elevation_rate`
    [m/s], `wave_envelope` [m], `<dof>_orbital` and `<dof>_orbital_below_<k>` [m/s, rad/s], at the body and k thirds of
    (m / rho)^(1/3) below it, and the forward speed `speed` [m/s]; outputs `<dof>` as its sensor reads it, `<dof>_vel`,
    `<dof>_acc`. States are named `rad<k>`, `<dof>`, `<dof>_vel` as in `cummins`, then `<effect>_<k>`. Delays of force
    and sensors, a phase of the force and the drift of a clock are left out; a warning and `params["left_out"]` name
    them.

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

    actives = without_delays(model, effects)
    function = state_equations(model, actives)
    states, inputs, outputs = signals_of(model, actives)

    def at(t: float, x: FloatArray, u: FloatArray, which: int) -> FloatArray:
        return np.asarray(function(t, x, u)[which]).ravel()

    return ct.nlsys(lambda t, x, u, params: at(t, x, u, 0), lambda t, x, u, params: at(t, x, u, 1),
                    states=states, inputs=inputs, outputs=outputs, name=re.sub(r"\W+", "_", name or model.name),
                    params={"left_out": left_out(actives)})


@accepting(model=as_model)
def state_equations(model: Model, effects: Iterable[Any] = ()) -> ca.Function:
    """Return x' and y of the model with effects as a CasADi function of (t, x, u); see `nonlinear_system`."""
    equations = MotionEquations(model, activated(effects, model))
    p = ca.DM(vector_of(equations.actives))
    m, n = model.fit.states, model.n
    t, s = ca.SX.sym("t"), ca.SX.sym("x", equations.ns)
    u = ca.SX.sym("u", n + (3 + len(DEPTHS) * n if equations.waves else 0) + equations.towed)
    level = [ca.horzcat(u[n], u[n + 1], t)] if equations.waves else []
    drive = ca.vertcat(*(ca.horzcat(u[i], 0.0, equations.clock(t, p)[i]) for i in range(n)), *level,
                       *(ca.horzcat(u[i], 0.0, t) for i in range(n + 2 * equations.waves, u.size1())))
    a = equations.acceleration(s, drive, t, p)
    v = s[m + n:m + 2 * n]
    own = equations.follow(ca.vertcat(s, a), drive, t, p)
    rate = ca.vertcat(ca.mtimes(ca.DM(model.fit.a), s[:m]) + ca.mtimes(ca.DM(model.fit.b), v), v, a, own)
    x, y = dict(zip(model.dofs, ca.vertsplit(s[m:m + n]))), []
    for dof, value in x.items():
        sensors = [(active, values) for active, values in equations.of(p)
                   if active.dof in (dof, "") and active.of_first_sensor]
        y.append(sensed(sensors, value, (x[active.other] for active, _ in sensors if active.other), t))
    found = [ca.densify(rate), ca.densify(ca.vertcat(*y, v, a))]
    return ca.Function("state_equations", [t, s, u], found, {"cse": True})


def signals_of(model: Model, effects: Iterable[Any] = ()) -> tuple[list[str], list[str], list[str]]:
    """Return the names of states, inputs and outputs of `state_equations`; see `nonlinear_system`."""
    actives = activated(effects, model)
    stems, (inputs, outputs) = [signal(dof) for dof in model.dofs], signal_names(model.dofs)
    waves = any(a.effect.needs == "waves" for a in actives)
    extra = ["wave_elevation", "wave_elevation_rate", "wave_envelope",
             *(f"{stem}_orbital{at}" for at in ("", *(f"_below_{k}" for k in range(1, len(DEPTHS)))) for stem in stems)
             ] if waves else []
    extra += ["speed"] if any(a.effect.needs == "speed" for a in actives) else []
    own = [f"{a.name}_{k}" for a in actives for k in range(a.effect.states)]
    own = [label if own.count(label) == 1 else f"{label}_{i}" for i, label in enumerate(own)]
    states = [*(f"rad{k + 1}" for k in range(model.fit.states)), *stems, *(f"{stem}_vel" for stem in stems), *own]
    return states, [*inputs, *extra], list(outputs)


def without_delays(model: Model, effects: Iterable[Any]) -> tuple[Active, ...]:
    """Return the effects as `activated` does; a warning names those that a system without delays leaves out."""
    actives = activated(effects, model)
    if labels := ", ".join(left_out(actives)):
        warnings.warn(InputWarning(f"{model.name}: {labels} left out: delays, phases and clocks of the force and the "
                                   "sensors belong to the system's inputs and outputs"), stacklevel=4)
    return actives


def left_out(actives: Iterable[Active]) -> tuple[str, ...]:
    """Return the labels of the effects that change the time of the force or of a sensor."""
    return tuple(a.label for a in actives if a.effect.clock_in is not None or a.effect.clock_out is not None)
