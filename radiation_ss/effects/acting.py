"""What an effect does on the degrees of freedom of a model: the one place where its signals are put together."""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, NamedTuple

from radiation_ss.effects.definition import Active


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
    if effect.scope == "dof" and not active.dof:
        return Action([(i, effect.force(SimpleNamespace(**{**vars(each), "z": s.z}), values))
                       for i, each in enumerate(signals)], rates)
    result = effect.force(s, values)
    if effect.scope == "between":
        return Action([(places[0], result), (places[1], -result)], rates)
    parts = result if isinstance(result, (tuple, list)) else (result,)
    return Action(list(zip(places or range(len(dofs)), parts)), rates)
