"""Effects that a linear model leaves out: an open library."""

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from functools import cache
from importlib import import_module
from math import isfinite
from typing import Any

import numpy as np

from radiation_ss.arrays import listed
from radiation_ss.effects.definition import Active, Effect, Scales, acting, named
from radiation_ss.effects.slabs import in_harmonic_motion, numeric
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import RIGID, mode
from radiation_ss.methods import door

__getattr__, _later = door(__name__, {
    "definition": "Parameter Slab",
    "further": "fractional",
    "hull": "hull_restoring station",
    "mooring": "catenary Line",
    "nominal": "tolerances",
    "slabs": "slab",
})
__all__ = ["Active", "Effect", "Scales", "activate", "effect_named", "library", "named", "numeric", "optional",
           "register_effect", *_later]


@cache
def shelf() -> dict[str, Effect]:
    """The library; filled on first use, because casadi is loaded then."""
    modules = (import_module(f"{__name__}.{name}") for name in ("catalogue", "nominal", "further", "mooring"))
    return {effect.name: effect for module in modules for effect in module.effects()}


def library() -> Mapping[str, Effect]:
    """Return the effects by name that `diagnose` takes by default."""
    return {name: effect for name, effect in shelf().items() if not effect.optional}


def optional() -> Mapping[str, Effect]:
    """Return the effects by name that are considered only where they are named: `effects=[*library(), "immersion"]`."""
    return {name: effect for name, effect in shelf().items() if effect.optional}


def register_effect(effect: Effect, *, replace: bool = False) -> Effect:
    """Add an effect of one's own to the library; `diagnose` and `simulate` know it from then on.

    Parameters
    ----------
    effect : Effect
    replace : bool
        Allow a name that is taken.

    Raises
    ------
    InputError
        If the name is taken.

    Examples
    --------
    >>> from radiation_ss.effects import Parameter
    >>> register_effect(Effect("cubic_drag", {"coefficient": Parameter("F/(X/s)^3", sign=1)},
    ...                        force=lambda s, p: -p.coefficient * s.v**3), replace=True).name
    'cubic_drag'
    """
    if effect.name in shelf() and not replace:
        raise InputError(f"effect {effect.name!r} exists; choose another name or say replace=True")
    shelf()[effect.name] = effect
    return effect


def effect_named(name: str) -> Effect:
    """Return an effect of the library; InputError says which names are near, or all."""
    if name not in shelf():
        alike = sorted(known for known in shelf() if name in known.split("_")) or get_close_matches(name, shelf())
        there = f"nearest are {', '.join(alike)}" if alike else f"the library has {', '.join(sorted(shelf()))}"
        raise InputError(f"effect {name!r} is unknown; {there}")
    return shelf()[name]


def activated(effects: Any, model: Any) -> tuple[Active, ...]:
    """Return a model's effects as `activate` does; what a diagnosis found, its `corrected`, brings its own."""
    found = activate(effects.actives(model) if hasattr(effects, "actives") else effects, model.dofs)
    return tuple(active.bound(model) for active in found)


def activate(effects: Any, dofs: Sequence[str]) -> tuple[Active, ...]:
    """Turn what a user writes into active effects.

    Parameters
    ----------
    effects : iterable of Active, or of (name, dof, {parameter: value}) tuples, or of mappings with the keys name, dof
        and parameters (as in corrected.json); or one of them; None for none
    dofs : sequence of str
        The model's degrees of freedom; the dof may be left out where there is only one.
    """
    one = isinstance(effects, Mapping) or (
        isinstance(effects, tuple) and len(effects) > 1 and isinstance(effects[0], str | Effect))
    return tuple(item if isinstance(item, Active) else _activate(item, tuple(dofs))
                 for item in ([effects] if one else () if effects is None else listed(effects)))


def _activate(item: Any, dofs: tuple[str, ...]) -> Active:
    row = item
    if isinstance(item, list | tuple) and item and isinstance(item[-1], Mapping):
        row = {"name": item[0], "dof": item[1] if len(item) > 2 else "", "parameters": item[-1]}
    if not isinstance(row, Mapping) or "name" not in row:
        raise InputError(f"effects: {item!r}; write (name, dof, {{parameter: value}})")
    name, dof, other = row["name"], row.get("dof") or "", row.get("other") or ""
    values = dict(row.get("parameters", {}))
    effect = name if isinstance(name, Effect) else effect_named(name)
    name = effect.name
    if "," in dof:
        dof, other = (part.strip() for part in dof.split(",", 1))
    if not dof and len(dofs) == 1 and effect.scope != "body":
        dof = dofs[0]
    for place in filter(None, (dof, other)):
        if place not in dofs:
            raise InputError(f"effect {name}: degree of freedom {place!r} is not among {list(dofs)}")
    if effect.coupled and not other:
        rest = [d for d in dofs if d != dof]
        if len(rest) != 1:
            pairs = effect.places(dofs) or [(dofs[0], dofs[1])] if len(dofs) > 1 else [("Sway", "Roll")]
            raise InputError(f"effect {name}: name the second degree of freedom, dof = '{','.join(pairs[0])}'")
        other = rest[0]
    if other and dof == other:
        raise InputError(f"effect {name}: {dof} stands for both degrees of freedom; two different ones are needed")
    if effect.scope == "between" and len({mode(dof), mode(other)}.intersection(RIGID)) == 2:
        raise InputError(f"effect {name}: {dof} and {other} are different motions; it joins the same motion of two "
                         "bodies, float__Heave,spar__Heave")
    if effect.scope != "body" and not dof and not effect.common:
        raise InputError(f"effect {name}: name its degree of freedom, one of {list(dofs)}")
    try:
        numbers = {key: float(v[0] if isinstance(v, (list, tuple)) else v) for key, v in values.items()}
    except (TypeError, ValueError, IndexError):
        raise InputError(f"effect {name}: its parameters {values} are not all numbers") from None
    wrong = [key for key, value in numbers.items() if not isfinite(value)]
    if wrong:
        raise InputError(f"effect {name}: {wrong[0]} is {numbers[wrong[0]]}; a finite number is needed")
    active = Active(effect, dof, numbers, other)
    strengths = [key for key, p in effect.parameters.items() if p.strength]
    without = "side" if "side" in effect.parameters.keys() - numbers else " or ".join(strengths)
    if without == "side" or not any(key in numbers for key in strengths):
        raise InputError(f"effect {name}: {without} is missing, without which it does nothing")
    absent = [key for key, p in effect.parameters.items() if not p.strength and not numbers.get(key)]
    if absent and not _is_a_number(active, dofs):
        raise InputError(f"effect {name}: its force is no number with {' = '.join(absent)} = 0, as what is not given; "
                         f"give {', '.join(f'{key} [{effect.parameters[key].unit}]' for key in absent)}")
    return active


def _is_a_number(active: Active, dofs: tuple[str, ...]) -> bool:
    """Return whether an effect's force, and the rates of its own states, are finite in a motion of size one."""
    effect, one = active.effect, np.ones(1)
    sizes = Scales(1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, elevation=1.0, orbital=1.0, speed=1.0)
    signals, values = [in_harmonic_motion(effect, sizes, one)] * len(dofs), named(effect, [*np.array(active.vector)])
    with np.errstate(all="ignore"):
        forces, rates = acting(active, signals, dofs, values, [one] * effect.states)
    return all(np.isfinite(numeric(value)).all() for value in (*rates, *(force for _, force in forces)))
