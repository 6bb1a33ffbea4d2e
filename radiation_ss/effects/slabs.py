"""The prior of an effect's parameters, from the force that it makes in a typical motion."""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.effects.definition import DEPTHS, Effect, named
from radiation_ss.effects.parameter import Scales, Slab
from radiation_ss.errors import InputError


def slab(effect: Effect, name: str, scales: Scales, cut: float = 4.0, share: float = 0.12) -> Slab:
    """Return the prior of a parameter: where it is centred, its standard deviation and its physical bounds.

    Parameters
    ----------
    effect : Effect
    name : str
        Of the parameter.
    scales : Scales
        Typical sizes in the records at hand.
    cut : float
        Standard deviations at which the prior of a shape ends where the parameter states no bound; a strength's has
        no end.
    share : float
        Of the model's own linear force, for strengths of forces that state no slab; 1 for a restoring force where the
        model has none.

    Examples
    --------
    >>> from radiation_ss.effects import effect_named
    >>> sizes = Scales(x=0.1, v=0.2, a=0.4, u=0.0, force=50.0, omega=2.0, duration=60.0)
    >>> slab(effect_named("sensor_gain"), "gain", sizes).sd
    0.3
    """
    parameter, scales = effect.parameters[name], effect.sizes(scales)
    given = parameter.slab
    if parameter.fixed:
        sd = 0.0
    elif given is None and (effect.force is None or not parameter.strength):
        raise InputError(f"effect {effect.name}: parameter {name} needs a slab")
    elif callable(given):
        sd = float(given(scales))
    else:
        loose = effect.family == "stiffness" and not scales.restored
        size = (1.0 if loose else share) if given is None else float(given)
        sd = size * unit_share(effect, name, scales) if parameter.strength else size
    mean = tuple(float(v) for v in parameter.starts(scales)) if parameter.starts is not None else (0.0,)
    lower, upper = (float(b(scales)) if callable(b) else b for b in (parameter.lower, parameter.upper))
    if lower is None:
        lower = -np.inf if parameter.strength else min(mean) - cut * sd
        lower = max(lower, 0.0) if parameter.sign > 0 else lower
    if upper is None:
        upper = np.inf if parameter.strength else max(mean) + cut * sd
    inside = tuple(dict.fromkeys(min(max(value, lower), upper) for value in mean))
    return Slab(inside, sd, lower, upper)


def unit_share(effect: Effect, name: str, scales: Scales) -> float:
    """Return the value of a parameter at which the effect's typical force is the model's own linear force."""
    probe = [1.0 if key == name else (float(p.starts(scales)[0]) if p.starts is not None else 0.0)
             for key, p in effect.parameters.items()]
    size = typical_force(effect, scales, probe)
    if not size > 0.0:
        raise InputError(f"effect {effect.name}: parameter {name} makes no force in a typical motion; give its slab")
    return scales.force / size


def typical_force(effect: Effect, scales: Scales, values: Sequence[float]) -> float:
    """Return the root mean square of the effect's force in a harmonic motion of typical size."""
    phase = 2.0 * np.pi * (np.arange(64) + 0.5) / 64
    s = in_harmonic_motion(effect, scales, phase)
    s.other, s.all = in_harmonic_motion(effect, scales.second, phase), [s]
    assert effect.force is not None
    result = effect.force(s, named(effect, values))
    first = result[0] if isinstance(result, tuple) else result
    return float(np.sqrt(np.mean(np.square(numeric(first) * np.ones(64)))))


def in_harmonic_motion(effect: Effect, scales: Scales, phase: FloatArray) -> SimpleNamespace:
    """Return the signals of a degree of freedom that moves as x = sqrt(2) rms cos(phase)."""
    cosine, sine = np.sqrt(2.0) * np.cos(phase), np.sqrt(2.0) * np.sin(phase)
    flow = scales.orbital * np.sqrt(2.0) * np.cos(phase + 1.0)
    return SimpleNamespace(x=scales.x * cosine, v=-scales.v * sine, a=-scales.a * cosine,
                           u=np.sqrt(2.0) * scales.u * np.cos(phase + 1.0), t=phase / scales.omega,
                           elevation=scales.elevation * np.sqrt(2.0) * np.cos(phase + 1.0),
                           elevation_rate=-scales.omega * scales.elevation * np.sqrt(2.0) * np.sin(phase + 1.0),
                           envelope=np.sqrt(2.0) * scales.elevation * np.ones(phase.size),
                           orbital=flow, below=[0.5**at * flow for at in DEPTHS[1:]], dof="", speed=scales.speed,
                           memory=-scales.force * sine, y=scales.x * cosine, z=[scales.x * sine] * effect.states,
                           scales=scales)


def numeric(value: Any) -> Any:
    """Turn a CasADi constant into an array; leave numbers alone."""
    return np.asarray(value.full()).ravel() if hasattr(value, "full") else value
