"""An effect as a python-control system, for ct.interconnect."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from radiation_ss.errors import InputError
from radiation_ss.hydro.data import signal
from radiation_ss.simulation.effects.definition import Active, named

if TYPE_CHECKING:
    import control as ct


def effect_block(active: Active) -> ct.NonlinearIOSystem:
    """Return the effect's force as a system from motion to force.

    Inputs are those of `<dof>`, `<dof>_vel`, `<dof>_acc`, `<dof>_force` (the exciting force) that it depends on;
    output `<dof>_<effect>` [N or N m],
    to be added to the exciting force. The acceleration matters to few effects; those that take it (inertia) make an
    algebraic loop with the composite and belong into the mass matrix instead.

    Raises
    ------
    InputError
        If the effect is not a force on one degree of freedom.
    """
    import control as ct

    effect = active.effect
    if effect.force is None or effect.scope != "dof":
        raise InputError(f"effect {effect.name}: only a force on one degree of freedom is a block")
    inputs, states, time = ca.SX.sym("u", 4), ca.SX.sym("z", effect.states), ca.SX.sym("t")
    s = SimpleNamespace(x=inputs[0], v=inputs[1], a=inputs[2], u=inputs[3], t=time, memory=ca.SX(0),
                        z=[states[k] for k in range(effect.states)])
    s.other, s.all = s, [s]
    p = named(effect, active.vector)
    value = effect.force(s, p)
    rates = ca.vertcat(*effect.rates(s, p)) if effect.rates is not None else ca.SX(0, 1)
    # Only the signals that matter become inputs: an acceleration that is not needed would look like a loop.
    used = [k for k, needed in enumerate(ca.which_depends(ca.vertcat(value, rates), inputs, 1)) if needed]
    picked = ca.vertcat(*[inputs[k] for k in used]) if used else ca.SX(0, 1)
    force = ca.Function("force", [time, states, picked], [value])
    rate = ca.Function("rate", [time, states, picked], [rates])
    stem = signal(active.dof)
    names = [stem, f"{stem}_vel", f"{stem}_acc", f"{stem}_force"]

    def update(t: float, z: Any, u: Any, params: Any) -> Any:
        return np.asarray(rate(t, z, u)).ravel()

    def output(t: float, z: Any, u: Any, params: Any) -> Any:
        return np.asarray(force(t, z, u)).ravel()

    return ct.nlsys(update if effect.states else None, output, states=effect.states or None,
                    inputs=[names[k] for k in used], outputs=[f"{stem}_{effect.name}"],
                    name=f"{stem}_{effect.name}")
