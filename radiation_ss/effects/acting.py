"""What an effect does on the degrees of freedom of a model: the one place where its signals are put together.

`effect_block` gives one effect as a python-control system, for ct.interconnect.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple

import casadi as ca
import numpy as np

from radiation_ss.effects.definition import Active, named
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import signal

if TYPE_CHECKING:
    import control as ct


class Action(NamedTuple):
    """Forces with the position of their degree of freedom, and rates of the effect's own states."""

    forces: list[tuple[int, Any]]
    rates: list[Any]


def acting(active: Active, signals: Sequence[Any], dofs: Sequence[str], values: Any, z: Sequence[Any]) -> Action:
    """Return an effect's forces and rates from the signals of all degrees of freedom.

    A signal is an object with x, v, a and what else `Effect.force` is told: numbers, arrays or expressions; `values`
    are the parameters as attributes, from `named`, z the effect's own states.
    """
    effect, places = active.effect, [dofs.index(dof) for dof in (active.dof, active.other) if dof]
    s = SimpleNamespace(**vars(signals[places[0] if places else 0]))
    s.all, s.z, s.other = list(signals), list(z), signals[places[1]] if len(places) > 1 else None
    if effect.scope == "between":
        for name in ("x", "v", "a"):
            setattr(s, name, getattr(s, name) - getattr(s.other, name))
    rates = list(effect.rates(s, values)) if effect.rates is not None else []
    if effect.force is None:
        return Action([], rates)
    result = effect.force(s, values)
    if effect.scope == "between":
        return Action([(places[0], result), (places[1], -result)], rates)
    parts = result if isinstance(result, (tuple, list)) else (result,)
    return Action(list(zip(places or range(len(dofs)), parts)), rates)


def effect_block(active: Active) -> ct.NonlinearIOSystem:
    """Return the effect's force as a system from motion to force.

    Inputs are those of `<dof>`, `<dof>_vel`, `<dof>_acc`, `<dof>_force` (the exciting force), `<dof>_orbital`,
    `wave_elevation`, `wave_elevation_rate`, `wave_envelope` and `speed` that it depends on, of both degrees of freedom
    where it couples two; outputs `<dof>_<effect>` [N or N m] of each that it acts on, to be added to the exciting
    force. Acceleration matters to few effects; those that take it (inertia) make an algebraic loop with the composite
    and belong into the mass matrix instead.

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
    per_dof = ("", "_vel", "_acc", "_force", "_orbital")
    stems = [signal(place) for place in places]
    names = [f"{stem}{suffix}" for stem in stems for suffix in per_dof]
    names += ["wave_elevation", "wave_elevation_rate", "wave_envelope", "speed"]
    inputs, states, time = ca.SX.sym("u", len(names)), ca.SX.sym("z", effect.states), ca.SX.sym("t")
    signals = [SimpleNamespace(**dict(zip("xvau", ca.vertsplit(inputs[k:k + 4]))), orbital=inputs[k + 4], dof=place,
                               t=time, memory=ca.SX(0), elevation=inputs[-4], elevation_rate=inputs[-3],
                               envelope=inputs[-2], speed=inputs[-1])
               for place, k in zip(places, range(0, len(names), len(per_dof)))]
    forces, follow = acting(active, signals, places, named(effect, active.vector), ca.vertsplit(states))
    value = ca.vertcat(*(force for _, force in forces))
    rates = ca.vertcat(*follow) if follow else ca.SX(0, 1)
    # Only the signals that matter become inputs: an acceleration that is not needed would look like a loop.
    used = [k for k, needed in enumerate(ca.which_depends(ca.vertcat(value, rates), inputs, 1)) if needed]
    picked = ca.vertcat(*[inputs[k] for k in used]) if used else ca.SX(0, 1)
    force = ca.Function("force", [time, states, picked], [value])
    rate = ca.Function("rate", [time, states, picked], [rates])

    def update(t: float, z: Any, u: Any, params: Any) -> Any:
        return np.asarray(rate(t, z, u)).ravel()

    def output(t: float, z: Any, u: Any, params: Any) -> Any:
        return np.asarray(force(t, z, u)).ravel()

    return ct.nlsys(update if effect.states else None, output, states=effect.states or None,
                    inputs=[names[k] for k in used],
                    outputs=[f"{stems[place]}_{effect.name}" for place, _ in forces],
                    name=f"{'_'.join(stems)}_{effect.name}")
