"""A model in one line, from what a decay, an inclining test or a section's offsets give."""

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.composite import mass_matrix, no_radiation
from radiation_ss.body.convert import as_model
from radiation_ss.body.model import TOLERANCES, Model, checked_tolerance
from radiation_ss.body.particulars import (
    RESTORED,
    Particulars,
    damping_of_ratio,
    from_period,
    particulars,
    refuse_other_swing,
    size_doubts,
)
from radiation_ss.errors import InputError, InputWarning
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.data import RIGID, ROTATIONS, HydroData, mode

HORIZONTAL = ("Surge", "Sway", "Yaw")
SECTION_MODES = ("Sway", "Heave", "Roll")


def body(system: Any = None, /, *, radiation: HydroData | RadiationFit | str | Path | None = None, section: Any = None,
         length: float | None = None, depth: float = np.inf, tolerance: float | Mapping[str, float] | None = None,
         name: str = "body", **numbers: Any) -> Model:
    """Return a model from a few numbers: mass, GM or C, gyradius, period, damping_ratio of each degree of freedom.

    A decay's period gives the one number that is missing: the added inertia where inertia and stiffness are known, the
    inertia where only the stiffness is, the stiffness where the inertia and the added mass are. The damping ratio gives
    the linear damping D beside radiation. Without radiation the model is a mass on a spring with a damper.

    Parameters
    ----------
    system : control.StateSpace, optional
        A whole body with the signals of `rss.cummins`, instead of numbers; see `rss.as_model`.
    radiation : HydroData, RadiationFit or path, optional
        Radiation, from a file of `read_hydro` or a fit; what the file says of inertia and stiffness holds where no
        number is given.
    section, length : optional
        A section, its offsets (y, z) [m] or a file of them, and the length of the body [m]: radiation and hydrostatics
        come from `section_2d`; the mass is the displacement unless given.
    depth : float
        Water depth [m] for the section.
    tolerance : float or mapping of str to float, optional
        How far numbers may be off, relative: one number for the model's own, or by name: of what is given (mass, GM, C,
        gyradius, period, added_mass), carried to what follows from it, and of the model (mass, stiffness, A_inf,
        kernel, force). A guess of a gyradius is {"gyradius": 0.1}.
    name : str
    **numbers
        dof, units, mass, GM, C, gyradius, period, damping_ratio, added_mass, centre_of_gravity, rho, g; see
        `radiation_ss.body.particulars.Particulars`. One number, or a mapping by degree of freedom. A gyradius is about
        the centre of gravity where that is given (Steiner's theorem moves it to the axis of the motion), else about
        the axis itself.

    Raises
    ------
    InputError
        If numbers are missing, contradict each other, or leave nothing for the period to tell.

    Examples
    --------
    A tanker at 1:68 by its particulars and a roll decay (Alexandersson & Kjellberg, SSPA 2018):

    >>> import radiation_ss as rss
    >>> ship = rss.body(dof="Roll", mass=993.0, GM=0.0843, gyradius=0.341, period=2.545, damping_ratio=0.0017,
    ...                 tolerance={"gyradius": 0.03}, name="KVLCC2")
    >>> print(ship)
    Model KVLCC2
      Roll  M 115.5, A_inf 19.26 kg m^2, C 821.2 N m/rad, D 1.131 N m s/rad; period 2.545 s, damping ratio 0.0017
      radiation: none
      tolerance: mass 6.09 %, A_inf 36.51 %
    """
    said = dict(tolerance) if isinstance(tolerance, Mapping) else {}
    every = {} if tolerance is None or isinstance(tolerance, Mapping) else dict.fromkeys(TOLERANCES, tolerance)
    if system is not None:
        if numbers or any(given is not None for given in (radiation, section, length)):
            raise InputError("body: a system and numbers are given; give one of the two")
        return as_model(system).replace(name=name, tolerance=every or said)
    p, data, fit = _inputs(radiation, section, length, depth, numbers)
    M, A_inf, C, D = _matrices(p, data, fit)
    if data is not None:
        data = data.replace(M=M, C=C, D=D)
    model = Model(p.dof, M, A_inf, C, fit or no_radiation(p.dof), D, data, name)
    refuse_other_swing(p, model)
    for text in size_doubts(p, model):
        warnings.warn(InputWarning(text), stacklevel=2)
    return model.replace(tolerance=every or _tolerances(said, p, data, fit, model))


def _inputs(radiation: Any, section: Any, length: float | None, depth: float, numbers: Mapping[str, Any],
            ) -> tuple[Particulars, HydroData | None, RadiationFit | None]:
    """Return particulars, coefficients of their degrees of freedom and the radiation model."""
    if section is not None:
        if radiation is not None or length is None:
            raise InputError("section: needs the length of the body [m], and no other radiation")
        return _of_section(particulars({"dof": SECTION_MODES, **numbers}), section, length, depth)
    if length is not None:
        raise InputError("length: belongs to a section; give its offsets too")
    if radiation is None:
        p = particulars(numbers)
        if p.centre_of_gravity is not None:
            raise InputError("centre_of_gravity: belongs to a section or to radiation data; without them give the "
                             "gyradius about the axis of the motion")
        return p, None, None
    if isinstance(radiation, RadiationFit):
        p = particulars({"dof": radiation.dofs, **numbers})
        if p.dof != tuple(radiation.dofs):
            raise InputError(f"dof: {', '.join(p.dof)}, but the radiation model is of {', '.join(radiation.dofs)}")
        return p, radiation.data, radiation
    from radiation_ss.fit.radiation import fit_radiation
    from radiation_ss.hydro.files import read_hydro

    data = read_hydro(radiation) if isinstance(radiation, str | Path) else radiation
    if not isinstance(data, HydroData):
        raise InputError(f"radiation: {type(data).__name__} found; a HydroData, a RadiationFit or a file is needed")
    p = particulars({"dof": data.dofs, "rho": data.rho, "g": data.g, **numbers})
    data = data.select(p.dof).with_A_inf()
    return p, data, fit_radiation(data)


def _of_section(p: Particulars, section: Any, length: float, depth: float, most: float = 100.0,
                ) -> tuple[Particulars, HydroData, RadiationFit]:
    """Return the particulars of a prismatic body with its displacement, its coefficients and their fit."""
    from radiation_ss.fit.radiation import fit_radiation
    from radiation_ss.hydro.section.solver import as_section, section_2d

    shape = as_section(section)
    if not 1.0 / most < length / shape.half_breadth < most:
        warnings.warn(InputWarning(f"length: {length:g} m, and the section's half breadth is {shape.half_breadth:.4g} "
                                   "m; check that both are in metres"), stacklevel=4)
    # From waves ten times the size of the body to ones that only its waterline feels: w^2 b / g from 0.01 to 8.
    omega = np.linspace(0.1, np.sqrt(8.0), 60) * np.sqrt(p.g / shape.half_breadth)
    data = section_2d(shape, omega, depth, rho=p.rho, g=p.g, centre_of_gravity=p.centre_of_gravity or 0.0)
    data = data.times(length).select(p.dof)
    displaced = p.rho * shape.area * length
    if p.mass is None:
        p = Particulars(**{**vars(p), "mass": displaced})
    elif (mass := p.of("mass", p.dof[0])) is not None and abs(mass - displaced) > 0.2 * displaced:
        warnings.warn(InputWarning(f"mass: {mass:.4g} kg, but the section displaces {displaced:.4g} kg, which floats "
                                   "without lines; check mass [kg], offsets and length [m]"), stacklevel=4)
    if "Roll" in p.dof and p.centre_of_gravity is None and p.of("GM", "Roll") is None and p.of("C", "Roll") is None:
        raise InputError("GM, C or centre_of_gravity: needed for Roll")
    return p, data, fit_radiation(data)


def _matrices(p: Particulars, data: HydroData | None, fit: RadiationFit | None) -> tuple[FloatArray, ...]:
    """Return M, A_inf, C and D, shape (n, n)."""
    if fit is None or len(p.dof) == 1:
        rows = [_one_dof(p, dof, data, fit) for dof in p.dof]
        M, A_inf, C, D = (np.diag(column) for column in np.array(rows).T)
        return M, A_inf, C, D
    for name in ("period", "damping_ratio", "added_mass"):
        if getattr(p, name) is not None:
            raise InputError(f"{name}: with radiation and several degrees of freedom it does not say one number; leave "
                             "it out, or make a model of one degree of freedom")
    A_inf = _known(data.A_inf if data is not None else fit.A_inf, "added mass at infinite frequency (A_inf)")
    M = _known(getattr(data, "M", None), "mass") if p.mass is None else _inertia_matrix(p, data)
    given = [p.stiffness(dof) for dof in p.dof]
    C = np.array(data.C) if data is not None and data.C is not None else np.diag(
        [_stiffness(value, dof) for value, dof in zip(given, p.dof)])
    for i, value in enumerate(given):
        if value is not None:
            C[i, i] = value
    return M, A_inf, C, data.D if data is not None and data.D is not None else np.zeros_like(C)


def _inertia_matrix(p: Particulars, data: HydroData | None) -> FloatArray:
    """Return the rigid-body mass matrix about the reference point of the data."""
    if own := [dof for dof in p.dof if mode(dof) not in RIGID]:
        raise InputError(f"mass: does not tell how {own[0]} is coupled to the other motions; leave it out if the "
                         "radiation's file has the inertia, or make a Model of its matrices")
    masses = {p.of("mass", dof) for dof in p.dof}
    if len(masses) > 1 or None in masses:
        raise InputError("mass: one number is needed with radiation; of several bodies give model matrices")
    point = (0.0, 0.0, 0.0) if data is None else tuple(np.nan_to_num(data.reference_point))
    z = point[2] if p.centre_of_gravity is None else p.centre_of_gravity
    turning = [dof for dof in p.dof if mode(dof) in ROTATIONS]
    gyradii = {mode(dof): p.of("gyradius", dof) for dof in turning}
    if None in gyradii.values():
        raise InputError(f"gyradius: needed for {', '.join(turning)} [m]")
    return mass_matrix(float(masses.pop() or 0.0), (point[0], point[1], z), dofs=p.dof, reference_point=point,
                       gyradii=[gyradii.get(name) or 0.0 for name in ROTATIONS])


def _one_dof(p: Particulars, dof: str, data: HydroData | None, fit: RadiationFit | None,
             ) -> tuple[float, float, float, float]:
    """Return M, A_inf, C and D of one degree of freedom by itself; a period tells the one that is not stated."""
    def K(s: complex) -> complex:
        return 0.0 if fit is None else complex((fit.c @ np.linalg.solve(s * np.eye(fit.states) - fit.a, fit.b))[0, 0])

    M, A, C = _stated(p, dof, data, fit)
    period, ratio = p.of("period", dof), p.of("damping_ratio", dof)
    if period is None:
        C = _stiffness(C, dof)
        if M is None or A is None:
            what = "mass" if p.of("mass", dof) is None else "gyradius" if M is None else "added_mass"
            raise InputError(f"{what} of {dof}: missing; give it, or the period of a decay, from which it follows")
        return M, A, C, 0.0 if ratio is None else damping_of_ratio(ratio, K, M + A, C)
    if C is None:
        if M is None or A is None:
            raise InputError(f"period of {dof}: gives the stiffness where mass and added_mass are known, or the added "
                             "mass where mass and C (or GM) are; give one more")
        return M, A, *from_period(period, ratio, K, inertia=M + A)
    if M is not None and A is not None:
        raise InputError(f"period of {dof}: mass, stiffness and added mass leave nothing for it to tell; leave one out "
                         "(gyradius, GM, C or added_mass), and it follows from the period; what the radiation's file "
                         "holds is given, too")
    if C <= 0.0:
        raise InputError(f"period of {dof}: {period:g} s, but the stiffness is {C:g}; such a body does not oscillate")
    total, D = from_period(period, ratio, K, stiffness=C)
    return *_shared_out(total, M, A, C, f"period of {dof}: {period:g} s"), C, D


def _stated(p: Particulars, dof: str, data: HydroData | None, fit: RadiationFit | None,
            ) -> tuple[float | None, float | None, float | None]:
    """Return M, A_inf and C: the number given, or else the data's, or else (A_inf) the fit's; None where none is."""
    def entry(holder: HydroData | RadiationFit | None, field: str) -> float | None:
        value = getattr(holder, field, None)
        return None if value is None else float(value[0, 0])

    M = entry(data, "M") if p.of("mass", dof) is None else p.inertia(dof)
    if fit is not None and p.of("mass", dof) is not None and M is not None and mode(dof) in RIGID:
        M = float(_inertia_matrix(p, data)[0, 0])  # about the reference point, as of several degrees of freedom
    A = entry(data, "A_inf") if p.of("added_mass", dof) is None else p.of("added_mass", dof)
    C = entry(data, "C") if p.stiffness(dof) is None else p.stiffness(dof)
    if C == 0.0 and p.stiffness(dof) is None and mode(dof) in HORIZONTAL:
        C = None  # hydrostatics restore none of these: it says nothing of a mooring
    return M, entry(fit, "A_inf") if A is None else A, C


def _shared_out(total: float, M: float | None, A: float | None, C: float, said: str,
                most: float = 30.0) -> tuple[float, float]:
    """Return M and A_inf of an inertia in all; warns where the added one is more than `most` times the body's."""
    known = M if M is not None else A or 0.0
    if total < known or (M is None and total == known):
        least = 2.0 * np.pi * np.sqrt(known / C)
        whose = "the body without added mass" if M is not None else "the added mass alone"
        raise InputError(f"{said} is shorter than {least:.4g} s, that of {whose} (inertia {known:.4g}, stiffness "
                         f"{C:.4g}); check mass, gyradius, GM or C, and that the period is in seconds")
    if M is not None and total > (1.0 + most) * M:
        warnings.warn(InputWarning(f"{said} and stiffness {C:.4g} leave an added inertia {total / M - 1.0:.3g} times "
                                   "the body's; check the period [s], and GM [m] or C [SI]"), stacklevel=6)
    return (known, total - known) if M is not None else (total - known, known)


def _stiffness(C: float | None, dof: str) -> float:
    if C is None and mode(dof) not in HORIZONTAL:
        GM = ", or GM [m]" if mode(dof) in RESTORED else ""
        raise InputError(f"C of {dof}: missing; give C [N/m or N m/rad]{GM}")
    return C or 0.0


def _known(value: FloatArray | None, what: str) -> FloatArray:
    if value is None:
        raise InputError(f"{what}: missing; give it")
    return value


def _tolerances(given: Mapping[str, float], p: Particulars, data: HydroData | None, fit: RadiationFit | None,
                model: Model) -> dict[str, float]:
    """Return tolerances of the model: what is said of it, and what follows from those of the numbers given.

    Each number is moved by its tolerance; the changes of the diagonals of M, A_inf and C add up as squares.
    """
    inputs = ("mass", "GM", "C", "gyradius", "period", "added_mass")
    alias = {"stiffness": "C" if p.C is not None else "GM", "A_inf": "added_mass"}
    squares = dict.fromkeys(("mass", "A_inf", "stiffness"), 0.0)
    found: dict[str, float] = {}
    for name, value in given.items():
        checked_tolerance({name: value}, (name,))
        moved = alias.get(name, name)
        if moved in inputs and getattr(p, moved, None) is not None:
            other = _moved(p, moved, value, data, fit)
            for key, now, then in zip(squares, (model.M, model.A_inf, model.C), other):
                size = np.diag(now)
                change = np.abs(np.diag(then) - size)[size != 0.0] / np.abs(size[size != 0.0])
                squares[key] += float(change.max(initial=0.0)) ** 2
        elif name in TOLERANCES:
            found[name] = value
        else:
            raise InputError(f"tolerance: {name!r} is not among the numbers given, nor one of {', '.join(TOLERANCES)}")
    carried = {name: min(float(np.sqrt(square)), 0.9) for name, square in squares.items() if square > 0.0}
    return {**carried, **found}


def _moved(p: Particulars, name: str, share: float, data: HydroData | None, fit: RadiationFit | None,
           ) -> tuple[FloatArray, ...]:
    """Return M, A_inf, C and D with one number larger by a share; smaller where no body is like that."""
    try:
        return _matrices(p.scaled(name, 1.0 + share), data, fit)
    except InputError:
        return _matrices(p.scaled(name, 1.0 / (1.0 + share)), data, fit)
