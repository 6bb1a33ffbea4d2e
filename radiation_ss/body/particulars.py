"""What drawings, an inclining test and a decay tell of a body, checked; and what a period and a damping ratio imply."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import brentq

from radiation_ss.arrays import check_height
from radiation_ss.body.dynamics import natural_modes
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import RIGID, ROTATIONS, mode, motion_unit
from radiation_ss.units import check_water

if TYPE_CHECKING:
    from radiation_ss.body.model import Model

ByDof = float | Mapping[str, float] | None
Transfer = Callable[[complex], complex]
ELSEWHERE = {"gm": "GM", "stiffness": "C"}  # names that the command line, and tolerances, have
RESTORED = ("Roll", "Pitch")  # rotations with a metacentric height


@dataclass(frozen=True)
class Particulars:
    """Numbers of a body, SI; those that differ between degrees of freedom are one number or a mapping by name.

    Parameters
    ----------
    dof : str or sequence of str
        Surge, Sway, Heave, Roll, Pitch, Yaw, or `body__Heave` with several bodies; others with a unit.
    units : mapping of str to str
        Unit of the displacement, "m" or "rad", of degrees of freedom that are no rigid-body mode: {"flap": "rad"}.
    mass : float or mapping
        [kg]
    GM : float or mapping
        Metacentric height [m] of Roll and Pitch: C = mass g GM.
    C : float or mapping
        Stiffness [N/m, N m/rad]. Absent in Surge, Sway and Yaw: zero.
    gyradius : float or mapping
        Radius of gyration of rotations [m], about the centre of gravity where `centre_of_gravity` is given: the inertia
        about the axis of the motion is m (gyradius^2 + arm^2) then; without it about that axis itself, m gyradius^2.
    period : float or mapping
        Period of a free decay [s].
    damping_ratio : float or mapping
        Of a free decay; 0.05 is 5 % of critical.
    added_mass : float or mapping
        At infinite frequency [kg, kg m^2].
    centre_of_gravity : float
        Height z [m], z up from the still water surface; for a section or radiation data.
    rho, g : float
        [kg/m^3, m/s^2]
    """

    dof: Any = None
    units: Mapping[str, str] = field(default_factory=dict)
    mass: ByDof = None
    GM: ByDof = None
    C: ByDof = None
    gyradius: ByDof = None
    period: ByDof = None
    damping_ratio: ByDof = None
    added_mass: ByDof = None
    centre_of_gravity: float | None = None
    rho: float = 1000.0
    g: float = 9.81

    def __post_init__(self) -> None:
        dofs = (self.dof,) if isinstance(self.dof, str) else tuple(self.dof or ())
        if not dofs:
            raise InputError(f"dof: {self.dof!r}; name the degrees of freedom, {', '.join(RIGID)} or with a unit")
        for dof in dofs:
            if mode(str(dof)) not in RIGID and self.units.get(dof) not in ("m", "rad"):
                raise InputError(f"dof: {dof!r} is none of {', '.join(RIGID)}; one of your own needs the unit of its "
                                 f"displacement: units={{{dof!r}: 'm'}} or 'rad', --dof {dof}=m")
        for named, unit in self.units.items():
            if named not in dofs or (mode(str(named)) in RIGID and unit != motion_unit(named)):
                raise InputError(f"units of {named}: units are of the displacement of a degree of freedom of your own; "
                                 "numbers are in SI (kg, m, s), motions of a rigid body in m and rad")
        object.__setattr__(self, "dof", tuple(dofs))
        if self.centre_of_gravity is not None:
            check_height(self.centre_of_gravity, "centre_of_gravity")
        for name in ("mass", "GM", "C", "gyradius", "period", "damping_ratio", "added_mass", "rho", "g"):
            if (value := getattr(self, name)) is not None:
                self._check(name, value)

    def _check(self, name: str, value: Any) -> None:
        for dof, number in value.items() if isinstance(value, Mapping) else [("", value)]:
            at = f"{name} of {dof}" if dof else name
            if dof and dof not in self.dof:
                raise InputError(f"{at}: not among the degrees of freedom {', '.join(self.dof)}")
            try:
                number = float(number)
            except (TypeError, ValueError):
                raise InputError(f"{at}: {number!r} is not a number") from None
            possible = {"GM": True, "C": True, "damping_ratio": number >= 0.0, "added_mass": number >= 0.0}
            if not np.isfinite(number) or not possible.get(name, number > 0.0):
                raise InputError(f"{at}: {number:g}; a positive number is needed (SI: kg, m, s)")
            check_water(at, number, name)
            if name == "damping_ratio" and number >= 1.0:
                raise InputError(f"{at}: {number:g}; a share of critical damping below 1 is needed (0.05 is 5 %)")

    def of(self, name: str, dof: str) -> float | None:
        """Return one number of a degree of freedom; None where it is not given or means nothing there."""
        value = getattr(self, name)
        if value is None or isinstance(value, Mapping):
            found = (value or {}).get(dof)
            return None if found is None else float(found)
        concerned = [d for d in self.dof if (mode(d) in RESTORED if name == "GM" else
                                             self.turns(d) if name == "gyradius" else True)]
        if not concerned:
            means = RESTORED if name == "GM" else ROTATIONS
            raise InputError(f"{name}: means nothing for {', '.join(self.dof)}; it belongs to {' or '.join(means)}")
        if dof not in concerned:
            return None
        if len(concerned) > 1 and name not in ("mass", "gyradius"):
            example = ", ".join(f"{d!r}: ..." for d in concerned)
            raise InputError(f"{name}: say it for each degree of freedom, {{{example}}}")
        return float(value)

    def turns(self, dof: str) -> bool:
        """Whether a degree of freedom is a rotation."""
        return mode(dof) in ROTATIONS or self.units.get(dof) == "rad"

    def inertia(self, dof: str) -> float | None:
        """Return mass or m gyradius^2 of a degree of freedom [kg, kg m^2], None if it does not follow."""
        mass, gyradius = self.of("mass", dof), self.of("gyradius", dof)
        if mass is None or not self.turns(dof):
            return mass
        return None if gyradius is None else mass * gyradius**2

    def stiffness(self, dof: str) -> float | None:
        """Return the stiffness of a degree of freedom [N/m, N m/rad]; None if it is not given."""
        C, GM = self.of("C", dof), self.of("GM", dof)
        if GM is None:
            return C
        mass = self.of("mass", dof)
        if C is not None:
            raise InputError(f"GM and C of {dof}: give one of the two")
        if mass is None:
            raise InputError(f"GM of {dof}: needs the mass, C = mass g GM")
        return mass * self.g * GM

    def scaled(self, name: str, factor: float) -> "Particulars":
        """Return a copy with one number times a factor."""
        value = getattr(self, name)
        changed: Any = ({dof: factor * number for dof, number in value.items()} if isinstance(value, Mapping)
                        else factor * value)
        return replace(self, **{name: changed})


def particulars(given: Mapping[str, Any]) -> Particulars:
    """Return the particulars of keywords; InputError names those that there are."""
    names = [f.name for f in fields(Particulars)]
    if unknown := [name for name in given if name not in names]:
        near = [name for name in names if name.lower() == ELSEWHERE.get(unknown[0], unknown[0]).lower()]
        hint = f"; did you mean {near[0]}?" if near else f"; use {', '.join(names)}"
        raise InputError(f"body: {unknown[0]!r} is unknown{hint}")
    return Particulars(**given)


def size_doubts(p: Particulars, model: "Model", most: float = 100.0) -> Iterator[str]:
    """Yield a sentence for each motion of a body far from the size of the water of its mass.

    In heave a body of vertical sides is m g / C deep; in roll and pitch its radius of gyration, with the added inertia,
    is sqrt(I / m). Neither is more than `most` times the side of the cube of water (m / rho)^(1/3), nor the depth less
    than that share of it.
    """
    for i, dof in enumerate(p.dof):
        mass, C, inertia = p.of("mass", dof), float(model.C[i, i]), float((model.M + model.A_inf)[i, i])
        if mass is None:
            continue
        side = (mass / p.rho) ** (1.0 / 3.0)
        water = f"and the mass is that of a cube of water of {side:.4g} m"
        if mode(dof) == "Heave" and C > 0.0 and not 1.0 / most < mass * p.g / (side * C) < most:
            yield (f"{dof}: with stiffness {C:.4g} N/m the body is {mass * p.g / C:.4g} m deep, {water}; check mass "
                   "[kg], period [s] and C [N/m]")
        if mode(dof) in RESTORED and inertia > (most * side) ** 2 * mass:
            yield (f"{dof}: with inertia {inertia:.4g} kg m^2 the radius of gyration is {np.sqrt(inertia / mass):.4g} "
                   f"m, {water}; check mass [kg], gyradius [m], period [s] and GM [m]")


def refuse_other_swing(p: Particulars, model: "Model") -> None:
    """Refuse a period that only a mode of the radiation has: the body's own displacement goes by another."""
    for dof, found in zip(model.dofs, natural_modes(model).period):
        asked = p.of("period", dof)
        if asked is not None and not np.isclose(found, asked, rtol=1e-4):
            raise InputError(f"period of {dof}: {asked:g} s; no body that is released oscillates so with this inertia "
                             "and radiation; check the period [s] and the mass [kg]")


def pole(period: float, ratio: float) -> complex:
    """Return the pole of a decay with this period of its oscillation [s] and damping ratio [1/s].

    >>> s = pole(2.0, 0.1)
    >>> round(s.imag, 6), round(-s.real / abs(s), 6)
    (3.141593, 0.1)
    """
    return 2.0 * np.pi / period * complex(-ratio / np.sqrt(1.0 - ratio**2), 1.0)


def from_period(period: float, ratio: float | None, K: Transfer, *, inertia: float | None = None,
                stiffness: float | None = None) -> tuple[float, float]:
    """Return what is missing, inertia with added mass or stiffness, and the damping beside radiation.

    A free oscillation s = pole(period, ratio) obeys s I + K(s) + C / s = -D: the imaginary part gives the missing one
    of I and C, the real part D. Without a ratio D is zero, and the ratio is that of radiation alone. `period`: of
    the oscillation [s]. `ratio`: damping ratio, 0 to 1. `K`: radiation transfer function K(s) at complex s [1/s].
    `inertia`, `stiffness`: M + A_inf or C, one of them.
    """
    def solve(ratio: float) -> tuple[float, float]:
        s = pole(period, ratio)
        known = s * (inertia or 0.0) + K(s) + (stiffness or 0.0) / s
        unit = s if inertia is None else 1.0 / s
        missing = -known.imag / unit.imag
        return missing, -(known + missing * unit).real

    if ratio is not None:
        missing, damping = solve(ratio)
        if damping < -1e-9 * abs(pole(period, ratio)) * max(abs(missing), inertia or 0.0):
            raise InputError(f"damping_ratio: {ratio:g} is less than what radiation alone gives, "
                             f"{own_ratio(solve, period):.3g}; give a larger ratio, or leave it out")
        return missing, max(damping, 0.0)
    return solve(own_ratio(solve, period))[0], 0.0


def own_ratio(solve: Callable[[float], tuple[float, float]], period: float) -> float:
    """Return the least damping ratio at which `solve` finds no damping beside radiation."""
    def beside(ratio: float) -> float:
        return solve(ratio)[1]

    if abs(beside(0.0)) <= 1e-12 * abs(beside(0.5)):
        return 0.0
    tried = np.linspace(0.0, 0.99, 100)  # with radiation several may do: the others are radiation's own
    turns = np.flatnonzero(np.diff(np.sign([beside(ratio) for ratio in tried])))
    if not turns.size:
        raise InputError(f"period: {period:g} s; the body does not oscillate so with this radiation")
    return float(brentq(beside, tried[turns[0]], tried[turns[0] + 1]))


def damping_of_ratio(ratio: float, K: Transfer, inertia: float, stiffness: float) -> float:
    """Return the damping beside radiation that makes the damping ratio of a body of known inertia and stiffness.

    Of s = w (-ratio + i sqrt(1 - ratio^2)) the frequency w is sought at which s I + K(s) + C / s is real: it is -D.
    """
    if stiffness <= 0.0:
        raise InputError("damping_ratio: a body without stiffness does not oscillate; give a stiffness, or the linear "
                         "damping by model.attached(damping={...}) [N s/m or N m s/rad]")

    def impedance(w: float) -> complex:
        s = w * complex(-ratio, np.sqrt(1.0 - ratio**2))
        return s * inertia + K(s) + stiffness / s

    high = 10.0 * np.sqrt(stiffness / inertia)
    try:
        w = float(brentq(lambda w: impedance(w).imag, 1e-3 * high, high))
    except ValueError:
        raise InputError(f"damping_ratio: {ratio:g}; with this radiation the body does not oscillate so") from None
    damping = -impedance(w).real
    if damping < -1e-9 * w * inertia:
        raise InputError(f"damping_ratio: {ratio:g} is less than what radiation alone gives; give a larger ratio, or "
                         "leave it out")
    return max(damping, 0.0)
