"""The record of a fitted radiation subsystem."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import ComplexArray, FloatArray, read_only
from radiation_ss.fit.rational import frequency_response, impulse_response
from radiation_ss.hydro.data import signal

if TYPE_CHECKING:
    import control as ct


@dataclass(frozen=True, eq=False)
class RadiationFit:
    """Strictly proper state-space model of K(s), body velocity to radiation force (the body feels minus it).

    Parameters
    ----------
    dofs : tuple of str
        Degrees of freedom, n of them.
    a, b, c : ndarray, shapes (N, N), (N, n), (n, N)
        Realisation of K(s) = c (s I - a)^-1 b.
    order : int
        Order asked for or chosen: the number of states of one entry, or of common poles of a joint fit.
    A_inf : ndarray, shape (n, n), optional
        Added mass at infinite frequency that K was formed with.
    method : str
        How it was fitted.
    """

    dofs: tuple[str, ...]
    a: FloatArray
    b: FloatArray
    c: FloatArray
    order: int
    A_inf: FloatArray | None = None
    method: str = "casadi"

    def __post_init__(self) -> None:
        n, states = len(self.dofs), np.shape(self.a)[0]
        for name, shape in (("a", (states, states)), ("b", (states, n)), ("c", (n, states))):
            object.__setattr__(self, name, read_only(getattr(self, name), name, shape))
        if self.A_inf is not None:
            object.__setattr__(self, "A_inf", read_only(self.A_inf, "A_inf", (n, n)))

    @property
    def states(self) -> int:
        """Number of states of the realisation."""
        return self.a.shape[0]

    def frequency_response(self, omega: ArrayLike) -> ComplexArray:
        """Return K(iw), shape (nw, n, n), evaluated for all frequencies at once."""
        return frequency_response(self.a, self.b, self.c, omega)

    def kernel(self, t: ArrayLike) -> FloatArray:
        """Return the retardation kernel L(t) = c exp(a t) b, shape (nt, n, n)."""
        return impulse_response(self.a, self.b, self.c, t)

    def to_ss(self) -> ct.StateSpace:
        """Return the native python-control system: inputs `<dof>_vel`, outputs `<dof>_rad`, states named."""
        import control as ct

        stems = [signal(dof) for dof in self.dofs]
        return ct.ss(self.a, self.b, self.c, np.zeros((len(stems), len(stems))),
                     inputs=[f"{s}_vel" for s in stems], outputs=[f"{s}_rad" for s in stems],
                     states=[f"rad{i + 1}" for i in range(self.states)], name="radiation")
