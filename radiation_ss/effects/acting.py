"""What an effect does on the degrees of freedom of a model: the one place where its signals are put together."""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, NamedTuple

from radiation_ss.effects.definition import Active, Effect, Expression
from radiation_ss.errors import InputError


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
    rates = list(written(effect, effect.rates, s, values)) if effect.rates is not None else []
    if effect.force is None:
        return Action([], rates)
    if effect.scope == "dof" and not active.dof:
        return Action([(i, written(effect, effect.force, SimpleNamespace(**{**vars(each), "z": s.z}), values))
                       for i, each in enumerate(signals)], rates)
    result = written(effect, effect.force, s, values)
    if effect.scope == "between":
        return Action([(places[0], result), (places[1], -result)], rates)
    parts = result if isinstance(result, (tuple, list)) else (result,)
    return Action(list(zip(places or range(len(dofs)), parts)), rates)


def written(effect: Effect, law: Expression, s: Any, values: Any) -> Any:
    """Return what an effect's law makes of its signals; InputError if it decides by them in Python."""
    try:
        return law(s, values)
    except (RuntimeError, ValueError) as error:
        if "truth value" not in str(error):
            raise
        raise InputError(f"effect {effect.name}: its law decides by `if`, `max` or `and`, which a formula of signals "
                         "cannot; write casadi.if_else(s.v > 0, 1, -1), casadi.fmax or casadi.sign") from None
