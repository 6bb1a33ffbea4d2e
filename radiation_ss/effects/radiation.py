"""Errors of the model's radiation: a force larger or smaller by a share, and a memory of another length."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import casadi as ca

from radiation_ss.body.model import Model
from radiation_ss.effects.definition import Effect
from radiation_ss.effects.parameter import Parameter as P
from radiation_ss.errors import InputError


def effects() -> list[Effect]:
    """Return the effect; without a model it is its share alone."""
    def other_length(s: Any) -> tuple[float, ...]:
        return 0.0, 0.3, 0.8, -0.3

    return [Effect("radiation_damping",
                   {"share": P("1", 0, lambda s: 0.2, lower=-1.0), "slower": P("1", 0, lambda s: 1.0),
                    "longer": P("1", 0, starts=other_length, fixed=True)},
                   lambda s, p: -p.share * s.memory, linear=True, common=True, bind=with_memory,
                   rare=lambda values: values.get("longer", 0.0) != 0.0,
                   summary="the radiation force is larger or smaller than computed, by one share of one motion or of "
                           "all, and its memory fades more slowly: K + share K + slower (K(t / (1 + longer)) - K)")]


def with_memory(effect: Effect, model: Model, values: Mapping[str, float]) -> Effect:
    """Return the effect with own states: those of the model's radiation at another pace, driven by the same motion.

    Their force is K(t / (1 + longer)) by the velocities: as large at first as K, for a time 1 + longer times as long.
    A memory of the model's own length needs none.
    """
    fit, pace = model.fit, 1.0 + values.get("longer", 0.0)
    if fit.states == 0 or pace == 1.0:
        return effect
    if not pace > 0.0:
        raise InputError(f"effect {effect.name}: longer {pace - 1.0:g} found, more than -1 needed; the memory lasts "
                         "1 + longer times as long")

    def rates(s: Any, p: Any) -> list[Any]:
        own, velocity = ca.vertcat(*s.z), ca.vertcat(*(each.v for each in s.all))
        return ca.vertsplit(ca.mtimes(ca.DM(fit.a / pace), own) + ca.mtimes(ca.DM(fit.b), velocity))

    def force(s: Any, p: Any) -> Any:
        row = ca.DM(fit.c[model.dofs.index(s.dof)])
        return -p.share * s.memory - p.slower * (ca.dot(row, ca.vertcat(*s.z)) - s.memory)

    return replace(effect, force=force, rates=rates, states=fit.states)
