"""Hydrostatic restoring, and Froude-Krylov force in long waves, from the shape of a hull up to its deck."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import FloatArray
from radiation_ss.effects.definition import Effect
from radiation_ss.effects.parameter import Parameter
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import mode

ACTS_ON = ("Heave", "Roll", "Pitch")


class Station(NamedTuple):
    """A piece of a hull along x whose section does not change."""

    x: float  # Its middle [m]
    length: float  # Its extent along x [m]
    outline: FloatArray  # (k, 2): Corners (y, z) [m] of the closed section up to the deck, z up from the still water


def station(x: float, length: float, outline: ArrayLike) -> Station:
    """Return a station, its outline brought into counter-clockwise order.

    InputError if the outline has fewer than three corners or no area, or the length is not positive.
    """
    corners = np.asarray(outline, dtype=float)
    if corners.ndim != 2 or corners.shape[1:] != (2,) or len(corners) < 3 or not np.isfinite(corners).all():
        raise InputError(f"station at x = {x:g} m: outline of shape {corners.shape}; (k, 2) corners (y, z) [m], at "
                         "least three, are needed")
    y, z = corners.T
    area = 0.5 * float(np.sum(y * np.roll(z, -1) - np.roll(y, -1) * z))
    if area == 0.0 or not length > 0.0:
        raise InputError(f"station at x = {x:g} m: area {abs(area):g} m^2, length {length:g} m; both must be positive")
    return Station(float(x), float(length), corners if area > 0.0 else corners[::-1])


def hull_restoring(stations: Sequence[Station], *, mass: float, height: float, reference: float = 0.0,
                   rho: float = 1000.0, g: float = 9.81, waves: bool = False, name: str = "hull_restoring") -> Effect:
    """Return what the shape adds to the linear restoring in heave, roll and pitch, as an effect on the whole body.

    The immersed part of each section is taken below the water's plane, rolled by any angle; pitch is small. The force
    at rest and its linear part are taken away: the model's C has them. With `waves` the water's plane follows the
    elevation, as waves much longer than the body have it, less what is linear in the elevation.

    Parameters
    ----------
    stations : sequence of Station
        From `station`.
    mass : float
        Of the body [kg].
    height : float
        Centre of gravity above the still water [m].
    reference : float
        Height of the model's reference point above the still water [m].
    rho, g : float
        Density [kg/m^3], gravity [m/s^2].
    waves : bool
        Whether the effect needs the wave elevation.
    name : str
        Of the effect; its one parameter, `share`, is 1 for the shape as given.

    Examples
    --------
    >>> box = station(0.0, 10.0, [(-1.0, -0.5), (1.0, -0.5), (1.0, 1.0), (-1.0, 1.0)])
    >>> hull_restoring([box], mass=10000.0, height=0.1).name
    'hull_restoring'
    """
    if not stations:
        raise InputError("hull_restoring: no station is given")
    names = [*ACTS_ON, "wave"]
    at, zero = ca.SX.sym("q", 4), ca.SX.zeros(4)
    heave, roll, pitch, level = ca.vertsplit(at)
    arm = mass * g * (height - reference)
    total: list[Any] = [-mass * g, arm * ca.sin(roll), arm * pitch]
    for part in stations:
        area, moment = immersed(part, heave - part.x * pitch - level, roll, reference)
        lift = rho * g * part.length
        total = [total[0] + lift * area, total[1] + lift * moment, total[2] - lift * part.x * area]
    whole = ca.vertcat(*total)
    linear = ca.substitute(whole, at, zero) + ca.mtimes(ca.substitute(ca.jacobian(whole, at), at, zero), at)
    beyond = ca.Function("beyond", [at], [whole - linear])

    def force(s: Any, p: Any) -> list[Any]:
        motion: dict[str, Any] = {mode(other.dof): other.x for other in s.all}
        motion["wave"] = s.elevation if waves else 0.0
        point: list[Any] = [motion.get(key, 0.0) for key in names]
        found = dict(zip(ACTS_ON, ca.vertsplit(beyond(ca.vertcat(*point)))))
        return [p.share * found.get(mode(other.dof), 0.0) for other in s.all]

    share = Parameter("1", 1, lambda s: 0.3, upper=2.0)
    return Effect(name, {"share": share}, force, scope="body", family="stiffness", optional=True,
                  needs="waves" if waves else "", summary="nonlinear hydrostatics of the hull's shape")


def immersed(part: Station, rise: Any, roll: Any, reference: float) -> tuple[Any, Any]:
    """Return area below the water and its first moment about the reference point, of a section raised and rolled.

    Exact for straight edges: the area is the integral over y, along the outline, of the immersion, which is linear in
    the share s of an edge. Its mean and its mean times s are those of the part below the water.
    """
    y, z = part.outline[:, 0], part.outline[:, 1] - reference
    across = [y_k * ca.cos(roll) - z_k * ca.sin(roll) for y_k, z_k in zip(y, z)]
    depth = [-(y_k * ca.sin(roll) + z_k * ca.cos(roll) + reference + rise) for y_k, z_k in zip(y, z)]
    area = moment = ca.SX(0)
    for k, after in zip(range(len(y)), [*range(1, len(y)), 0]):
        first, last = depth[k], depth[after]
        change, width = last - first, across[after] - across[k]
        crossing = first * last < 0.0
        slope = ca.if_else(crossing, change, 1.0)
        a, b = ca.fmax(first, 0.0), ca.fmax(last, 0.0)
        mean = ca.if_else(crossing, (b**2 - a**2) / (2.0 * slope), 0.5 * (a + b))
        mean_share = ca.if_else(crossing, ((b**3 - a**3) / 3.0 - first * (b**2 - a**2) / 2.0) / slope**2,
                                a / 6.0 + b / 3.0)
        area += width * mean
        moment += width * (across[k] * mean + width * mean_share)
    return area, moment
