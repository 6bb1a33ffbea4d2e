"""Mooring lines: the horizontal restoring as a polynomial, and from the catenary of each line."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from radiation_ss.arrays import positive
from radiation_ss.effects.contact import restoring_left
from radiation_ss.effects.definition import Effect, Parameter, Scales
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import mode, motion_unit

P = Parameter


def effects() -> list[Effect]:
    """Return the mooring's restoring as a free polynomial of the offset, of one motion and of the whole body."""
    return [
        Effect("mooring_restoring",
               {"linear": P("F/X", 1), "quadratic": P("F/X^2", lower=restoring_left(2),
                                                     upper=lambda s: -restoring_left(2)(s)),
                "cubic": P("F/X^3", 1)},
               lambda s, p: -(p.linear * s.x + p.quadratic * s.x**2 + p.cubic * s.x**3), family="stiffness",
               optional=True, summary="quasi-static mooring: -(k1 x + k2 x^2 + k3 x^3), k2 where lines differ"),
        Effect("mooring_lines",
               {"_".join(q): P(f"J/{'/'.join(map(motion_unit, q))}", int(hardens(q)), stored(q)) for q in ENERGY},
               lines_force, scope="body", family="stiffness", optional=True,
               summary="restoring of lines on the whole body, from an energy that is a polynomial of its motions"),
    ]


# What lines between body and seabed can store, to the fourth power in the horizontal plane.
ENERGY = tuple(tuple(term.split()) for term in (
    "Surge Surge", "Surge Sway", "Surge Heave", "Surge Pitch", "Sway Sway", "Sway Roll", "Sway Yaw", "Heave Heave",
    "Heave Pitch", "Roll Roll", "Roll Yaw", "Pitch Pitch", "Yaw Yaw",
    "Surge Surge Surge", "Surge Surge Sway", "Surge Sway Sway", "Sway Sway Sway", "Surge Yaw Yaw", "Sway Yaw Yaw",
    "Surge Surge Heave", "Sway Sway Heave", "Yaw Yaw Heave",
    "Surge Surge Surge Surge", "Surge Surge Sway Sway", "Sway Sway Sway Sway", "Yaw Yaw Yaw Yaw"))


def hardens(powers: Sequence[str]) -> bool:
    """Whether lines store energy in a motion in the horizontal plane to these even powers, never give it away.

    Of motions that no record has together the data tell nothing, and a body that they free of each other drifts away.
    """
    return all(powers.count(p) % 2 == 0 and p in ("Surge", "Sway", "Yaw") for p in powers)


def stored(powers: Sequence[str]) -> Callable[[Scales], float]:
    """Return the prior size of a coefficient of the energy, from the motions' sizes.

    The force that it makes in a typical motion is a share of the model's own: all of it where nothing else restores,
    else an eighth; less by a half for each power beyond the second.
    """
    def size(s: Scales) -> float:
        known = [(s.modes or dict.fromkeys(powers, s))[p] for p in powers if p in (s.modes or powers)]
        if len(known) < len(powers):
            return 0.0
        shares = [1.0 if not k.restored else 0.125 for k in known]
        energies = [share * k.force * k.x for share, k in zip(shares, known)]
        return 0.5 ** (len(powers) - 2) * min(energies) / float(np.prod([k.x for k in known]))
    return size


def lines_force(s: Any, p: Any) -> list[Any]:
    """Return minus the slope of the lines' energy by each motion; half a coefficient goes with a square."""
    at = {mode(other.dof): other.x for other in s.all}
    found = dict.fromkeys(at, 0.0)
    for powers in ENERGY:
        if all(power in at for power in powers):
            coefficient = getattr(p, "_".join(powers))
            for name in dict.fromkeys(powers):
                rest, times = list(powers), powers.count(name)
                rest.remove(name)
                share = 1.0 if len(powers) == 2 else times
                found[name] = found[name] - share * coefficient * math.prod(at[other] for other in rest)
    return [found[mode(other.dof)] for other in s.all]


@dataclass(frozen=True)
class Line:
    """A mooring line of uniform weight from an anchor on a flat seabed.

    Parameters
    ----------
    length : float
        Unstretched length [m].
    weight : float
        Submerged weight per length [N/m].
    depth : float
        Height of the fairlead above the anchor [m].
    distance : float
        Horizontal distance from fairlead to anchor with the body at rest [m].
    heading : float
        Direction from fairlead to anchor in the horizontal plane [rad], 0 along +x (surge).
    axial : float
        Axial stiffness EA [N].

    Raises
    ------
    InputError
        If a size is not positive, or the line hangs slack below the fairlead.
    """

    length: float
    weight: float
    depth: float
    distance: float
    heading: float = 0.0
    axial: float = 1e12

    def __post_init__(self) -> None:
        for name, unit in (("length", "m"), ("weight", "N/m"), ("depth", "m"), ("distance", "m"), ("axial", "N")):
            positive(getattr(self, name), f"line: {name}", unit, or_infinite=name == "axial")
        if self.length <= self.depth or self.distance <= self.length - self.depth:
            raise InputError(f"line: length {self.length:g} m; it must be above the depth {self.depth:g} m and below "
                             f"depth + distance ({self.depth + self.distance:g} m), or the line holds nothing")

    def tension(self, distance: Any, iterations: int = 12) -> Any:
        """Return the horizontal tension [N] at a horizontal distance [m], a number or a CasADi expression.

        The elastic catenary with the seabed's support while a part lies on it, and hung free beyond (Jonkman 2007,
        appendix B, without friction of the seabed; the vertical stretch is that of the inextensible line's tension).
        Newton's method on log(tension), whose step is limited.
        """
        L, h = self.length, self.depth
        log_a, u = ca.SX.sym("u"), ca.SX.sym("d")
        a, give = ca.exp(log_a), self.weight / self.axial  # tension over weight per length
        low = h - 0.5 * give * h * (2.0 * a + h)
        lying = L - ca.sqrt(low**2 + 2.0 * low * a) + a * ca.acosh(1.0 + low / a)
        half = ca.asinh(np.sqrt(L**2 - h**2) / (2.0 * a))
        low_free = h - 0.5 * give * L * h / ca.tanh(half)
        hanging = 2.0 * a * ca.asinh(ca.sqrt(L**2 - low_free**2) / (2.0 * a))
        missed = ca.if_else(2.0 * a * low < L**2 - low**2, lying, hanging) + a * give * L - u
        step = ca.fmax(ca.fmin(missed / ca.jacobian(missed, log_a), 2.0), -2.0)
        newton = ca.Function("newton", [log_a, u], [log_a - step])
        found: Any = np.log((L**2 - h**2) / (2.0 * h))
        for _ in range(iterations):
            found = newton(found, distance)
        return self.weight * ca.exp(found)


def catenary(lines: Sequence[Line], name: str = "catenary") -> Effect:
    """Return the quasi-static horizontal force of mooring lines as an effect on surge and sway.

    Its one parameter is the share of the computed force that acts; 1 is the lines as given.

    Parameters
    ----------
    lines : sequence of Line
    name : str
        Of the effect.

    Examples
    --------
    >>> from numpy import pi
    >>> three = [Line(835.0, 1065.0, 186.0, 797.0, heading) for heading in (pi / 3, pi, -pi / 3)]
    >>> catenary(three).name
    'catenary'
    """
    if not lines:
        raise InputError("catenary: no line is given")

    def force(s: Any, p: Any) -> list[Any]:
        named = {mode(other.dof): other.x for other in s.all}
        x, y = named.get("Surge", 0.0), named.get("Sway", 0.0)
        total = {"Surge": 0.0, "Sway": 0.0}
        for line in lines:
            east, north = line.distance * np.cos(line.heading) - x, line.distance * np.sin(line.heading) - y
            distance = ca.sqrt(east**2 + north**2)
            pull = p.share * line.tension(distance) / distance
            total = {"Surge": total["Surge"] + pull * east, "Sway": total["Sway"] + pull * north}
        return [total.get(mode(other.dof), 0.0) for other in s.all]

    share = P("1", 1, lambda s: 0.3, upper=3.0)
    return Effect(name, {"share": share}, force, scope="body", family="stiffness", optional=True,
                  summary="mooring lines hung as catenaries, quasi-static")
