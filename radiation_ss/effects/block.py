"""An effect as a python-control system, for ct.interconnect."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from radiation_ss.effects.definition import Active, named
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import signal

if TYPE_CHECKING:
    import control as ct


def effect_block(active: Active) -> ct.NonlinearIOSystem:
    """Return the effect's force as a system from motion to force.

    Inputs are those of `<dof>`, `<dof>_vel`, `<dof>_acc`, `<dof>_force` (the exciting force) that it depends on, of
    both degrees of freedom where it couples two; outputs `<dof>_<effect>` [N or N m] of each that it acts on, to be
    added to the exciting force. The acceleration matters to few effects; those that take it (inertia) make an
    algebraic loop with the composite and belong into the mass matrix instead.

    Raises
    ------
    InputError
        If the effect is not a force on one or two degrees of freedom.
    """
    import control as ct

    effect = active.effect
    if effect.force is None or effect.scope == "body":
        raise InputError(f"effect {effect.name}: only a force on one or two degrees of freedom is a block")
    places = [place for place in (active.dof, active.other) if place]
    inputs, states, time = ca.SX.sym("u", 4 * len(places)), ca.SX.sym("z", effect.states), ca.SX.sym("t")
    signals = [SimpleNamespace(x=inputs[k], v=inputs[k + 1], a=inputs[k + 2], u=inputs[k + 3], t=time, memory=ca.SX(0))
               for k in range(0, 4 * len(places), 4)]
    s = signals[0]
    s.other, s.all, s.z = signals[-1], signals, [states[k] for k in range(effect.states)]
    p = named(effect, active.vector)
    forces = effect.force(s, p)
    value = ca.vertcat(*forces) if isinstance(forces, (tuple, list)) else forces
    rates = ca.vertcat(*effect.rates(s, p)) if effect.rates is not None else ca.SX(0, 1)
    # Only the signals that matter become inputs: an acceleration that is not needed would look like a loop.
    used = [k for k, needed in enumerate(ca.which_depends(ca.vertcat(value, rates), inputs, 1)) if needed]
    picked = ca.vertcat(*[inputs[k] for k in used]) if used else ca.SX(0, 1)
    force = ca.Function("force", [time, states, picked], [value])
    rate = ca.Function("rate", [time, states, picked], [rates])
    stems = [signal(place) for place in places]
    names = [f"{stem}{suffix}" for stem in stems for suffix in ("", "_vel", "_acc", "_force")]

    def update(t: float, z: Any, u: Any, params: Any) -> Any:
        return np.asarray(rate(t, z, u)).ravel()

    def output(t: float, z: Any, u: Any, params: Any) -> Any:
        return np.asarray(force(t, z, u)).ravel()

    return ct.nlsys(update if effect.states else None, output, states=effect.states or None,
                    inputs=[names[k] for k in used],
                    outputs=[f"{stem}_{effect.name}" for stem in stems[: ca.SX(value).size1()]],
                    name=f"{'_'.join(stems)}_{effect.name}")
