"""What an effect is: one CasADi expression with its parameters; and what it does on the motions of a model."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.effects.parameter import Parameter, Scales, Slab
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import body, mode

__all__ = ["Active", "Effect", "Parameter", "Scales", "Slab", "named"]
Expression = Callable[[Any, Any], Any]
# Where the flow of the waves is known, below the surface, in shares of the edge of a cube of the body's displacement
DEPTHS = tuple(k / 3 for k in range(4))
SCOPES = ("dof", "body", "pair", "directed", "between")


@dataclass(frozen=True)
class Effect:
    """Something that the linear model leaves out, defined once; fits, simulation and control blocks all use it.

    Parameters
    ----------
    name : str
    parameters : mapping of str to Parameter
    force : callable (s, p) -> expression, optional
        Force added to the equation of motion [N or N m]. `s` has x, v, a (displacement, velocity, acceleration), u
        (exciting force), t, memory (radiation force), elevation with its elevation_rate and envelope, orbital (velocity
        of the linear wave along the degree of freedom; of its slope for rotations) and below, those at each other
        of `DEPTHS`, speed of the effect's degree of freedom, `s.other` (the second one of a pair), `s.all` (all of
        them) and z (the effect's own states). May depend on a linearly. Of two degrees of freedom: the force on the
        first, or the forces on both. With scope "between", x, v, a are the first motion minus the second, and
        the force on the second is the opposite.
    rates : callable (s, p) -> list of expressions, optional
        Time derivatives of the effect's own states z.
    states : int
        Number of own states.
    input, output : callable (s, p) -> expression, optional
        The exciting force that really acts, from the recorded s.u; the reading of a sensor, from the true s.y.
    clock_in, clock_out : callable (s, p) -> expression, optional
        The time at which the input acts or the sensor reads, from s.t: t - delay.
    scope : str
        "dof": one copy for each degree of freedom; "body": one copy; "pair": one for each two degrees of freedom, which
        play the same part; "directed": for each two of them one each way, what goes on in the first with the second;
        "between": what joins the same motion of two bodies (float__Heave and spar__Heave).
    family : str
        damping, stiffness, inertia, input, sensor, offset or resonance.
    linear : bool
        Linear and time-invariant in the motion: an unknown force absorbs it, so motion alone cannot test it.
    needs : str
        "" or "force": only seen in records whose exciting force is known and not zero; "waves": only in records with
        the wave elevation at the body; "speed": only where records have different forward speeds.
    per_record : bool
        Every record has parameters of its own.
    halvings : int
        How often the integrator's step is halved at least: laws that turn within a fraction of a period need it.
    unrest : callable (scales) -> sequence of float, optional
        Standard deviation of each own state at a record's start, which is then fitted; at rest if absent.
    rate_free : bool
        Depends on the path and its direction, not on how fast it is gone: dry friction.
    optional : bool
        Considered only where it is named; not part of what `diagnose` looks for by default.
    rare : bool or callable (values) -> bool
        Met less often than others, or with these values: its prior probability is smaller.
    bind : callable (effect, model, values) -> Effect, optional
        Gives the effect what it takes from the model that it acts on: see `Active.bound`.
    common : bool
        The same in each motion of the body, considered where there are several: a copy with scope "body", with scope
        "dof" one copy beside those of each motion.
    modes : tuple of str
        Motions that it can act on ("Heave"), of a pair both, of one body ("Heave,Pitch"); all if empty.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> from radiation_ss.effects import Parameter
    >>> sail = rss.Effect("sail", {"area": Parameter("N/(m/s)^2")}, force=lambda s, p: -p.area * s.v * abs(s.v))
    >>> sail.family
    'damping'
    """

    name: str
    parameters: Mapping[str, Parameter]
    force: Expression | None = None
    rates: Expression | None = None
    states: int = 0
    input: Expression | None = None
    output: Expression | None = None
    clock_in: Expression | None = None
    clock_out: Expression | None = None
    scope: str = "dof"
    family: str = "damping"
    linear: bool = False
    needs: str = ""
    per_record: bool = False
    halvings: int = 0
    unrest: Callable[[Scales], Sequence[float]] | None = None
    summary: str = field(default="", compare=False)
    optional: bool = False
    rare: bool | Callable[[Mapping[str, float]], bool] = False
    bind: Callable[["Effect", Any, Mapping[str, float]], "Effect"] | None = None
    common: bool = False
    rate_free: bool = False
    modes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        acts = [self.force, self.input, self.output, self.clock_in, self.clock_out]
        if all(part is None for part in acts):
            raise InputError(f"effect {self.name}: give a force, an input or an output expression")
        if self.scope not in SCOPES:
            raise InputError(f"effect {self.name}: scope {self.scope!r} is unknown; use one of {', '.join(SCOPES)}")
        if not any(p.strength for p in self.parameters.values()):
            raise InputError(f"effect {self.name}: at least one parameter must be a strength (no starts)")

    @property
    def sensor(self) -> bool:
        """Whether only the reading is changed, not the motion."""
        return self.output is not None or self.clock_out is not None

    @property
    def settled(self) -> bool:
        """Whether it acts in a test so slow that only position and direction matter, and no frequency does."""
        timeless = all(p.unit != "rad/s" for p in self.parameters.values())
        acts = self.family in ("stiffness", "offset", "nominal") or self.output is not None
        acts = acts or (self.input is not None and self.needs != "force")
        return timeless and (self.rate_free or acts)

    @property
    def by_pace(self) -> bool:
        """Whether it acts in a slow test as far as the body does not rest at its readings: damping, and clocks."""
        damps = self.family == "damping" and self.force is not None and self.scope == "dof"
        late = (self.clock_in is not None or self.clock_out is not None) and not self.per_record
        return ((damps and not (self.states or self.needs)) or late) and not self.settled

    @property
    def coupled(self) -> bool:
        """Whether it takes two degrees of freedom."""
        return self.scope in ("pair", "directed", "between")

    def sizes(self, scales: Scales) -> Scales:
        """Return the sizes of what the effect sees: of the relative motion where it acts between two bodies.

        >>> from radiation_ss.effects import Scales
        >>> sail.sizes(Scales(x=1.0, v=2.0, a=4.0, u=8.0, force=8.0, omega=2.0, duration=60.0)).v
        2.0
        """
        return replace(scales.relative, other=scales.relative) if self.scope == "between" else scales

    def places(self, dofs: Sequence[str]) -> list[tuple[str, str]]:
        """Return first and second degree of freedom ("" where there is none) of each copy.

        >>> sail.places(["Heave", "Pitch"])
        [('Heave', ''), ('Pitch', '')]
        """
        if self.scope == "body":
            return [("", "")] if len(dofs) > 1 or not self.common else []
        if self.scope == "dof":
            single = [(dof, "") for dof in dofs if not self.modes or mode(dof) in self.modes]
            return [*single, ("", "")] if self.common and len(dofs) > 1 else single
        if self.scope == "between":
            return [(a, b) for i, a in enumerate(dofs) for b in dofs[i + 1:]
                    if "__" in a and "__" in b and a.split("__")[-1] == b.split("__")[-1]]
        if self.modes:
            return [(a, b) for a in dofs for b in dofs
                    if f"{mode(a)},{mode(b)}" in self.modes and body(a) == body(b)]
        return [(a, b) for i, a in enumerate(dofs) for j, b in enumerate(dofs)
                if i < j or (i != j and self.scope == "directed")]


@dataclass(frozen=True)
class Active:
    """An effect put to work on a degree of freedom with numbers for its parameters.

    Parameters
    ----------
    effect : Effect
    dof : str
        Degree of freedom; of a pair the first ("" for the whole body).
    values : mapping of str to float
    other : str
        The second degree of freedom of a pair.
    """

    effect: Effect
    dof: str
    values: Mapping[str, float] = field(default_factory=dict)
    other: str = ""

    def __post_init__(self) -> None:
        unknown = sorted(set(self.values) - set(self.effect.parameters))
        if unknown:
            raise InputError(f"effect {self.name}: it has no parameter {unknown[0]!r}, but "
                             f"{', '.join(self.effect.parameters)}")

    @property
    def name(self) -> str:
        """The effect's name."""
        return self.effect.name

    @property
    def key(self) -> tuple[str, str, str]:
        """Name and places."""
        return self.name, self.dof, self.other

    @property
    def label(self) -> str:
        """Name and place, as 'quadratic_drag on Heave'."""
        link = "with" if self.effect.scope == "directed" else "and"
        where = f"{self.dof} {link} {self.other}" if self.other else self.dof
        return f"{self.name} on {where}" if where else self.name

    @property
    def rare(self) -> bool:
        """Whether it is met less often than others; see `Effect.rare`."""
        rare = self.effect.rare
        return rare(self.values) if callable(rare) else rare

    @property
    def form(self) -> tuple[int, str, str]:
        """What its equations in symbols depend on, whatever its numbers: the effect as it is bound, and its place."""
        return id(self.effect), self.dof, self.other

    @property
    def of_first_sensor(self) -> bool:
        """Whether a motion's displacement is read so."""
        return self.values.get("all_sensors", 0.0) >= 0.0

    @property
    def of_other_sensors(self) -> bool:
        """Whether a motion's velocity and acceleration are read so."""
        return (self.effect.clock_out is not None and self.dof == "") or self.values.get("all_sensors", 0.0) != 0.0

    def bound(self, model: Any) -> "Active":
        """Return it with what its effect takes from the model, as copies of the radiation's states."""
        bind = self.effect.bind
        return self if bind is None else replace(self, effect=bind(self.effect, model, self.values))

    @property
    def vector(self) -> list[float]:
        """Parameter values in the order of the effect's definition; absent ones are 0."""
        return [float(self.values.get(name, 0.0)) for name in self.effect.parameters]

    def with_values(self, values: Sequence[float]) -> "Active":
        """Return a copy with other numbers."""
        return Active(self.effect, self.dof, dict(zip(self.effect.parameters, map(float, values))), self.other)


def vector_of(actives: Sequence[Active]) -> FloatArray:
    """Return the parameters of effects, one after another."""
    return np.concatenate([np.zeros(0), *(active.vector for active in actives)])


def named(effect: Effect, values: Sequence[Any]) -> SimpleNamespace:
    """Return the parameters as attributes, as expressions read them."""
    return SimpleNamespace(**dict(zip(effect.parameters, values)))


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
