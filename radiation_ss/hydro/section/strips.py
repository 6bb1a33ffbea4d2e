"""Strip theory at zero speed: the coefficients of a ship from those of its sections."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import positive, read_only
from radiation_ss.errors import InputError
from radiation_ss.hydro.clean import rigid_inertia, velocity_transform
from radiation_ss.hydro.data import HydroData
from radiation_ss.hydro.section.shapes import SectionLike, as_section
from radiation_ss.hydro.section.solver import section_2d

DOFS = ("Sway", "Heave", "Roll", "Pitch", "Yaw")


def strip_theory(stations: Sequence[tuple[float, SectionLike | None]], omega: ArrayLike, depth: float = np.inf, *,
                 centre_of_gravity: float = 0.0, gyradii: tuple[float, float, float] | None = None,
                 **options: Any) -> HydroData:
    """Return the coefficients of a slender ship without speed, sum of two-dimensional flows about its sections.

    Between stations the coefficients are linear in x. Surge is left out, and so is the flow along the ship: it wants a
    slender body and waves that are short beside its length (Salvesen, Tuck & Faltinsen 1970, speed zero).

    Parameters
    ----------
    stations : sequence of (float, section)
        Position x [m], forward, and the section there: anything `section_2d` takes, None for a tip without area.
    omega, depth, options
        As `section_2d` has them (panels, rho, g).
    centre_of_gravity : float
        Height z of G [m]; its x is that of the centre of buoyancy.
    gyradii : tuple of float, optional
        Of roll, pitch and yaw about G [m]; M is given only with them (mass = displacement).

    Returns
    -------
    HydroData
        About (0, 0, 0); X for beam seas towards +y, notes with the checks of the sections.

    Raises
    ------
    InputError
        If there are fewer than two stations, x does not ascend, or a section is no section.
    SolverError
        As `section_2d`.
    """
    x = np.array([float(position) for position, _ in stations])
    if x.size < 2 or not np.isfinite(x).all() or np.any(np.diff(x) <= 0.0):
        raise InputError("stations: at least two needed, x in metres and ascending")
    shapes = [None if shape is None else as_section(shape) for _, shape in stations]
    flows = [None if shape is None else section_2d(shape, omega, depth, centre_of_gravity=centre_of_gravity, **options)
             for shape in shapes]
    known = [flow for flow in flows if flow is not None]
    if not known:
        raise InputError("stations: all are tips without a section")
    first = known[0]

    def along(name: str) -> np.ndarray:
        """Integrate T^T (.) T, or (.) T for X, over the ship: Simpson's rule, exact for linear strips."""
        strips = [0.0 * getattr(first, name) if flow is None else getattr(flow, name) for flow in flows]
        total = 0.0
        for (p, a), (q, b) in pairwise(zip(x, strips)):
            for position, strip, weight in ((p, a, 1.0), (0.5 * (p + q), 0.5 * (a + b), 4.0), (q, b, 1.0)):
                T = velocity_transform(DOFS, np.array([position, 0.0, 0.0]))[:3]  # to the section's three motions
                total = total + (q - p) / 6.0 * weight * (strip @ T if name == "X" else T.T @ strip @ T)
        return np.asarray(total)

    areas, moments = np.array([(0.0, 0.0) if shape is None else (shape.area, shape.area * shape.centre_of_buoyancy)
                               for shape in shapes]).T
    volume = np.trapezoid(areas, x)
    C = along("C")
    C[3, 3] += first.rho * first.g * (np.trapezoid(moments, x) - volume * centre_of_gravity)
    x_B = sum((b - a) / 6.0 * (p * a + (p + q) * (a + b) + q * b) for a, b, p, q in zip(x, x[1:], areas, areas[1:]))
    M = None
    if gyradii is not None:
        squares = np.diag([positive(k, "gyradii", "m") ** 2 for k in read_only(gyradii, "gyradii [m]", (3,))])
        M = first.rho * volume * rigid_inertia(1.0, squares, np.array([x_B / volume, 0.0, centre_of_gravity]))[1:, 1:]
    return HydroData(omega=first.omega, A=along("A"), B=along("B"), A_inf=along("A_inf"), C=C, M=M, X=along("X"),
                     dofs=DOFS, rho=first.rho, g=first.g, depth=first.depth, directions=first.directions,
                     source=f"strip theory, {len(known)} sections",
                     notes=tuple(dict.fromkeys(f"{flow.source}: {flow.notes[0]}" for flow in known)))

